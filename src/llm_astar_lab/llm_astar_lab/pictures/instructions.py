# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Draws what became of an instruction: its regions, where the path violates it, what it visited.

The regions and the parts of the path are those that the verification measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from textwrap import fill
from typing import Any

import numpy as np
import shapely
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.instructions.regions import WALLS, Along
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.geometry import Area, polyline
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import RegionError
from llm_astar_planner.instructions.verification.visit import attempts
from llm_astar_planner.planning.types import clause_line
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from llm_astar_lab.pictures import style
from llm_astar_lab.pictures.places import Projection, draw_region

COLOURS = {status: style.CLAUSES[status.name] for status in ClauseStatus}
# What a path falls short of, the worst first.
SHORT = (ClauseStatus.NOT_KEPT, ClauseStatus.IMPOSSIBLE, ClauseStatus.AS_FAR_AS_POSSIBLE)
# Where the path is not to be is hatched, where it is to be is not.
HATCH = '////'
TINT = 0.16
# Of the text above the picture: its size in points, the height of a line, and its characters.
SIZE = 9.0
LINE_INCHES = 0.18
CHARACTERS_PER_INCH = 13


@dataclass(frozen=True, eq=False)
class InstructedPath:
    """A path with what became of its instruction; `points` [n, 2], n > 0, are metres."""

    outcome: InstructionOutcome
    route: Route
    points: NDArray[np.float64]

    @cached_property
    def measurement(self) -> Measurement:
        """The path as the verification measures it."""
        specification = self.outcome.interpretation.specification
        return Measurement(specification, polyline(self.points), self.route)

    def shown_areas(self, clause: Clause) -> Iterator[Area]:
        """Yield the areas that a clause is about; those of unknown names are left out."""
        regions, reach = self.measurement.regions, reach_of(clause)
        resolve = regions.resolve_avoided if isinstance(clause, Avoid) else regions.resolve
        for region in clause.regions:
            # All walls together cannot be drawn as a region.
            if not (isinstance(region, Along) and region.place == WALLS):
                with suppress(RegionError):
                    area = resolve(region).area
                    yield area.grown(reach) if reach else area
        if clause.is_closed and not clause.regions:
            yield self.measurement.walls.zone(reach)

    def violating_parts(self, outcome: ClauseOutcome) -> Iterator[NDArray[np.float64]]:
        """Yield the stretches of the path, points [n, 2], that violate a clause about lengths."""
        is_closed, is_bound = outcome.clause.is_closed, isinstance(outcome.clause, StayIn)
        if outcome.status not in SHORT or not (is_closed or is_bound):
            return
        path = self.measurement.path
        for area in self.shown_areas(outcome.clause):
            spans = area.spans(path)
            if is_bound:
                edges = np.concatenate(([0.0], spans.ravel(), [path.length]))
                spans = edges.reshape(-1, 2)
            for first, last in spans:
                if last > first:
                    yield path.part(first, last).corners

    def visited_points(self) -> Iterator[tuple[float, float]]:
        """Yield the points at which the path visits regions, in the order of the clauses."""
        for group in attempts(self.measurement):
            for attempt in group:
                if attempt.done and attempt.place >= self.measurement.begin:
                    yield self.measurement.drive.point(attempt.place)


def reach_of(clause: Clause) -> float:
    """Return how many metres around its regions a path is not to come."""
    reach = getattr(clause, 'metres', 0.0) or getattr(clause, 'margin', 0.0)
    return float(reach) if clause.is_closed else 0.0


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
    """Return how the region of a clause is drawn: filled if kept, or where no path should be."""
    colour = COLOURS[outcome.status]
    is_closed = outcome.clause.is_closed
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
