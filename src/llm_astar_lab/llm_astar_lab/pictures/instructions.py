# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Draws what became of an instruction: its regions, where the path violates it, what it visited.

The regions and the parts of the path are those that the verification measured.
"""

from textwrap import fill
from typing import Any

import numpy as np
import shapely
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus
from llm_astar_planner.planning.report import clause_line
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from llm_astar_lab.pictures import style
from llm_astar_lab.pictures.instructed import SHORT, InstructedPath
from llm_astar_lab.pictures.places import Projection, draw_region

COLOURS = {status: style.CLAUSES[status.name] for status in ClauseStatus}
# Where the path is not to be is hatched, where it is to be is not.
HATCH = '////'
TINT = 0.16
# Of the text above the picture: its size in points, the height of a line, and its characters.
SIZE = 9.0
LINE_INCHES = 0.18
CHARACTERS_PER_INCH = 13


def draw_instruction(axes: Axes, path: InstructedPath, project: Projection) -> None:
    """Draw the regions of all clauses, the violating parts of the path, and the visits."""
    map_outline = path.measurement.regions.map_outline
    for outcome in path.outcome.clauses:
        for area in path.shown_areas(outcome.clause):
            shape = shapely.intersection(area.outline, map_outline)
            look = region_style(outcome)
            draw_region(axes, shapely.transform(shape, project), **look, zorder=2.2)
    for outcome in path.outcome.clauses:
        colour = COLOURS[outcome.status]
        for points in path.violating_parts(outcome):
            axes.plot(*project(points).T, color=colour, linewidth=4.5, zorder=3.5)
        if outcome.status in SHORT and outcome.where is not None:
            point = project(np.array([outcome.where]))
            axes.plot(*point.T, 'X', color=colour, markersize=11, mec='white', zorder=3.8)
    for visit in path.visited_points():
        x, y = project(np.array([visit]))[0]
        green = COLOURS[ClauseStatus.KEPT]
        axes.plot(x, y, 'o', color=green, markersize=13, mec='white', zorder=4.5)
        axes.plot(x, y, marker='$✓$', color='white', markersize=7, zorder=4.6)


def region_style(outcome: ClauseOutcome) -> dict[str, Any]:
    """Return how the region of a clause is drawn: filled if kept, or where no path should be.

    What is avoided is not in the colour of what is visited.
    """
    is_closed = outcome.clause.is_closed
    is_kept = outcome.status is ClauseStatus.KEPT
    colour = style.AVOIDED if is_closed and is_kept else COLOURS[outcome.status]
    tint = 0.0 if outcome.status in SHORT and not is_closed else TINT
    hatch = HATCH if is_closed else None
    return {'facecolor': (colour, tint), 'edgecolor': colour, 'hatch': hatch, 'linewidth': 1.6}


def add_instruction_legend(figure: Figure, path: InstructedPath) -> None:
    """Write the instruction and what became of each clause above the picture.

    The figure grows by as much as that takes.
    """
    handles: list[Artist] = [Patch(**region_style(outcome)) for outcome in path.outcome.clauses]
    labels = [clause_line(outcome.to_json()) for outcome in path.outcome.clauses]
    short = [outcome.status for outcome in path.outcome.clauses if outcome.status in SHORT]
    if short:
        red = COLOURS[min(short, key=SHORT.index)]
        handles.append(Line2D([], [], color=red, linewidth=4.5, marker='X', mec='white'))
        labels.append('where the path falls short of a clause')
    if next(path.visited_points(), None) is not None:
        green = COLOURS[ClauseStatus.KEPT]
        handles.append(Line2D([], [], color=green, linestyle='', marker='o', markersize=9))
        labels.append('visited in its turn')
    width, height = figure.get_size_inches()
    columns = int(CHARACTERS_PER_INCH * width)
    title = fill(f'instruction: "{path.outcome.interpretation.text}"', columns)
    labels = [fill(label, columns) for label in labels]
    lines = sum(text.count('\n') + 1 for text in (title, *labels))
    figure.set_size_inches(width, height + LINE_INCHES * lines)
    legend = figure.legend(
        handles, labels, title=title, loc='outside upper center', frameon=False, fontsize=SIZE,
        title_fontsize=SIZE, labelspacing=0.3,
    )  # fmt: skip
    for text in (legend.get_title(), *legend.get_texts()):
        # Words of an instruction are no formulas.
        text.set_parse_math(False)
