"""Pictures of plans: obstacles, waypoints, expanded cells and path on one map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill

import matplotlib as mpl
import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.types import Plan
from llm_astar_planner.search.result import Cell
from llm_astar_planner.visualization.instructions import (
    INSTRUCTED_PATH,
    InstructedPath,
    add_instruction_legend,
    draw_instruction,
)
from llm_astar_planner.visualization.places import draw_places, write_names

# Colour and marker by waypoint status; the shapes differ too, for readers who see few colours.
STATUS_MARKERS = {
    'accepted': ('#2ca02c', '*'),
    'out_of_order': ('#ff9f0e', 'P'),
    'unreachable': ('#9467bd', 'X'),
    'occupied': ('#d62728', 'X'),
    'out_of_bounds': ('#7f7f7f', 'X'),
}
# Of a title in its font.
CHARACTERS_PER_INCH = 10
# Outlines of the robot drawn along one path.
MAX_OUTLINES = 100
EXPANDED, UNKNOWN, OBSTACLE, PATH = '#bcd7f0', '#e8e4da', '#222222', '#d62728'


@dataclass(frozen=True, eq=False)
class Picture:
    """What to draw, in grid coordinates: `path` [n, 2], `expanded` bool [height, width].

    `waypoints` are (x, y, status). `offset` is the map coordinate of cell (0, 0), for the axes.
    `places` are drawn with their names, `instructed` says what became of an instruction, and the
    `footprint` is drawn along the path.
    """

    grid_map: GridMap
    start: Cell
    goal: Cell
    path: NDArray[np.int32]
    expanded: NDArray[np.bool_]
    waypoints: Sequence[tuple[float, float, str]]
    title: str
    offset: Cell = (0, 0)
    places: Places = NO_PLACES
    instructed: InstructedPath | None = None
    footprint: Footprint | None = None

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points [n, 2] in metres of the map's frame in the coordinates of the axes."""
        return self.grid_map.world_to_grid(points) + self.offset


def picture_of(
    plan: Plan,
    grid_map: GridMap,
    start: Cell,
    goal: Cell,
    offset: Cell = (0, 0),
    *,
    route: Route | None = None,
) -> Picture:
    """Return the picture of a plan, with places and instruction if its route is given."""
    waypoints = [(point.x, point.y, point.status.value) for point in plan.checked_waypoints]
    if plan.code == 0:
        outcome = f'{plan.expansions} expansions, length {plan.length:.2f} cells'
        title = f'{describe_guidance(plan.method, plan.guided_by)}: {outcome}'
    else:
        title = f'{plan.method}: {plan.code.name}, {plan.message}'
    places = NO_PLACES if route is None else route.places
    path, instructed = plan.path, None
    if route is not None and plan.instruction is not None and len(path):
        # The path that leaves the planner is the one that the instruction is verified on.
        path = path if plan.any_angle is None else plan.any_angle.points
        instructed = InstructedPath(plan.instruction, route, grid_map.grid_to_world(path))
    return Picture(
        grid_map, start, goal, path, plan.expanded, waypoints, title, offset, places, instructed,
        plan.footprint,
    )  # fmt: skip


def drawable_map(grid_map: GridMap, costmap: CostmapConfig | None) -> GridMap:
    """Return a map for drawing: lethal cells by the rules are occupied, other known ones free."""
    threshold = (costmap or CostmapConfig()).occupied_threshold
    cells = np.where(grid_map.cells >= threshold, OCCUPIED, np.minimum(grid_map.cells, FREE))
    return replace(grid_map, cells=cells.astype(np.int8))


def describe_guidance(method: str, guided_by: str) -> str:
    """Name the method of a plan and the source whose waypoints it followed, for a title."""
    guide = 'no waypoints' if guided_by == 'none' else f'guided by {guided_by}'
    return f'{method}, {guide}'


def save_picture(picture: Picture, path: str | Path) -> None:
    """Draw into an image file, whose ending chooses the format; missing folders are created.

    Raises OSError where the file cannot be written, ValueError for an unknown ending.
    """
    aspect = picture.grid_map.width / picture.grid_map.height
    figure = Figure(figsize=(min(14.0, max(7.0, 5.2 * aspect)), 6.0), layout='constrained')
    axes = figure.add_subplot()
    draw(axes, picture)
    figure.legend(loc='outside lower center', ncols=6, frameon=False)
    if picture.instructed is not None:
        add_instruction_legend(figure, picture.instructed)
    ends = np.array([picture.start, picture.goal]) + picture.offset
    write_names(axes, picture.places, picture.project, ends)
    write_figure(figure, path)


def write_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file of exactly this name; raises as `save_picture` does."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Without a format matplotlib adds an ending to a name that has none.
    figure.savefig(path, dpi=120, format=path.suffix[1:] or 'png')


def draw(axes: Axes, picture: Picture) -> None:
    """Draw on axes in map coordinates, with cell centres at whole numbers."""
    draw_cells(axes, picture)
    draw_places(axes, picture.places, picture.project)
    if len(picture.path):
        x, y = (picture.path + picture.offset).T
        # Red is what violates an instruction.
        colour = PATH if picture.instructed is None else INSTRUCTED_PATH
        axes.plot(x, y, color=colour, linewidth=2, label='path')
    if picture.footprint is not None and len(picture.path) > 1:
        draw_footprints(axes, picture, picture.footprint)
    if picture.instructed is not None:
        draw_instruction(axes, picture.instructed, picture.project)
    labelled = set()
    for number, (x, y, status) in enumerate(picture.waypoints, start=1):
        label = None if status in labelled else f'waypoint, {status.replace("_", " ")}'
        labelled.add(status)
        mark_point(axes, picture, (x, y), STATUS_MARKERS[status], label, size=14)
        position = (x + picture.offset[0], y + picture.offset[1])
        axes.annotate(str(number), position, (7, 7), textcoords='offset points', zorder=5)
    mark_point(axes, picture, picture.start, ('#1f77b4', 's'), 'start', size=9)
    mark_point(axes, picture, picture.goal, ('#17becf', 'D'), 'goal', size=9)
    inches = axes.figure.bbox.width / axes.figure.dpi
    axes.set_title(wrap_title(picture.title, inches), parse_math=False)


def draw_footprints(axes: Axes, picture: Picture, footprint: Footprint) -> None:
    """Draw the robot's outline along the path, about its own size apart."""
    resolution = picture.grid_map.resolution
    path = picture.path + np.array(picture.offset)
    steps = np.diff(path, axis=0, append=2 * path[-1:] - path[-2:-1])
    apart = max(1.0, 1.5 * footprint.circumscribed_radius / resolution, len(path) / MAX_OUTLINES)
    outlines = []
    for index in np.arange(0.0, len(path), apart).astype(int):
        cos, sin = steps[index] / max(np.hypot(*steps[index]), 1.0)
        turned = footprint.array / resolution @ np.array([[cos, sin], [-sin, cos]])
        outlines.append(turned + path[index])
    axes.add_collection(
        PolyCollection(outlines, facecolors='none', edgecolors=PATH, linewidths=0.6)
    )


def wrap_title(title: str, inches: float) -> str:
    """Break a title that is wider than `inches`, first after its colon."""
    width = int(CHARACTERS_PER_INCH * inches)
    parts = [title] if len(title) <= width else title.split(': ', 1)
    return '\n'.join(fill(part, width) for part in parts)


def draw_cells(axes: Axes, picture: Picture) -> None:
    """Draw obstacles, unknown cells and expanded cells."""
    grid_map = picture.grid_map
    image = np.ones((grid_map.height, grid_map.width, 3))
    image[grid_map.cells < 0] = mpl.colors.to_rgb(UNKNOWN)
    image[picture.expanded] = mpl.colors.to_rgb(EXPANDED)
    image[grid_map.blocked()] = mpl.colors.to_rgb(OBSTACLE)
    x, y = picture.offset[0] - 0.5, picture.offset[1] - 0.5
    extent = (x, x + grid_map.width, y, y + grid_map.height)
    axes.imshow(image, origin='lower', extent=extent, interpolation='nearest')
    for colour, label in ((OBSTACLE, 'obstacle'), (EXPANDED, 'expanded')):
        axes.plot([], [], 's', color=colour, label=label)


def mark_point(
    axes: Axes,
    picture: Picture,
    point: tuple[float, float],
    style: tuple[str, str],
    label: str | None,
    *,
    size: int,
) -> None:
    """Mark a point; `style` is colour and marker."""
    colour, marker = style
    axes.plot(
        point[0] + picture.offset[0],
        point[1] + picture.offset[1],
        marker,
        color=colour,
        markersize=size,
        markeredgecolor='black',
        label=label,
        zorder=4,
    )
