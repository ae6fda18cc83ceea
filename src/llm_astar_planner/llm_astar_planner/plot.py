"""Pictures of maps and plans, in the colours of the paper's figures.

Everything draws on matplotlib Figures without pyplot, so it works headless and in threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.barrier_map import BarrierMap
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from llm_astar_planner.planner import Plan
from llm_astar_planner.search.result import Cell

OBSTACLE, EXPANDED, ALSO_EXPANDED, PATH = '#1f2430', '#c9ccd3', '#f6c1cf', '#d62728'
START, GOAL = '#1f77b4', '#2ca02c'
# Waypoints by verdict, told apart by shape of the outline as well as by colour.
WAYPOINT_COLOURS = {
    'accepted': '#ffb000',
    'out_of_order': '#e377c2',
    'unreachable': '#9467bd',
    'occupied': '#8c564b',
    'out_of_bounds': '#7f7f7f',
}


def draw_map(
    axes: Axes, blocked: NDArray[np.bool_], *layers: tuple[NDArray[np.bool_], str]
) -> None:
    """Fill cells: `blocked` [height, width] above the `layers`, masks of that shape with colours.

    Earlier layers are drawn over later ones.
    """
    image = np.ones((*blocked.shape, 3))
    for mask, colour in reversed(((blocked, OBSTACLE), *layers)):
        image[mask] = to_rgb(colour)
    axes.imshow(image, origin='lower', interpolation='nearest')
    axes.set_xticks([])
    axes.set_yticks([])


def draw_ends(axes: Axes, start: Cell, goal: Cell) -> None:
    """Mark start (blue) and goal (green)."""
    for cell, colour in ((start, START), (goal, GOAL)):
        axes.plot(*cell, marker='s', color=colour, markersize=6, markeredgecolor='white', zorder=4)


def draw_plan(axes: Axes, blocked: NDArray[np.bool_], plan: Plan, start: Cell, goal: Cell) -> None:
    """Draw a plan: expanded cells, waypoints coloured by verdict, path, start and goal."""
    draw_map(axes, blocked, (plan.expanded, EXPANDED))
    if len(plan.path):
        axes.plot(plan.path[:, 0], plan.path[:, 1], color=PATH, linewidth=1.8, zorder=2)
    draw_waypoints(axes, plan)
    draw_ends(axes, start, goal)


def draw_waypoints(axes: Axes, plan: Plan) -> None:
    """Draw a plan's waypoints as stars, those that were dropped as crosses."""
    height, width = plan.expanded.shape
    for point in plan.waypoints:
        if 0 <= point.x < width and 0 <= point.y < height:
            marker = '*' if point.verdict.used else 'X'
            colour = WAYPOINT_COLOURS[point.verdict.value]
            axes.plot(
                point.x, point.y, marker=marker, color=colour, markersize=11,
                markeredgecolor='black', markeredgewidth=0.6, linestyle='', zorder=3,
            )  # fmt: skip


def compare_figure(
    blocked: NDArray[np.bool_],
    plans: Sequence[Plan],
    titles: Sequence[str],
    ends: tuple[Cell, Cell],
) -> Figure:
    """Set plans of one sample side by side, the paper's Figure 2."""
    height, width = blocked.shape
    panel = 5.0
    size = (panel * len(plans), panel * height / width + 0.75)
    figure = Figure(figsize=size, layout='constrained')
    for axes, plan, title in zip(np.atleast_1d(figure.subplots(1, len(plans))), plans, titles):
        draw_plan(axes, blocked, plan, *ends)
        found = f'length {plan.length:.2f}' if len(plan.path) else plan.code.name
        axes.set_title(
            f'{title}\noperation {plan.operation}, storage {plan.storage}, {found}', fontsize=9
        )
    return figure


def save_map_pictures(maps: Sequence[BarrierMap], folder: str | Path) -> list[Path]:
    """Write one PNG a map with its start-goal pairs numbered. Returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for barrier_map in maps:
        path = folder / f'map_{barrier_map.id:03d}.png'
        _map_figure(barrier_map).savefig(path, dpi=90)
        paths.append(path)
    return paths


def _map_figure(barrier_map: BarrierMap) -> Figure:
    blocked = barrier_map.to_grid().blocked()
    height, width = blocked.shape
    figure = Figure(figsize=(6.0, 6.0 * height / width + 0.4), layout='constrained')
    axes = figure.subplots()
    draw_map(axes, blocked)
    for pair, sample in enumerate(barrier_map.samples):
        start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
        axes.plot(*zip(start, goal), color='#9aa0ac', linewidth=0.6, linestyle=':')
        draw_ends(axes, start, goal)
        axes.annotate(str(pair), start, textcoords='offset points', xytext=(4, 3), fontsize=7)
    axes.set_title(f'map {barrier_map.id}', fontsize=9)
    return figure
