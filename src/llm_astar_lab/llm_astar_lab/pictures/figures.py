# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Pictures of plans: obstacles, waypoints, expanded cells and path on one map."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle
from pathlib import Path
from textwrap import fill

import numpy as np
from llm_astar_msgs_adapter.files import naming
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.types import Plan, describe_expansions
from llm_astar_planner.search.methods import WAYPOINT_METHODS
from llm_astar_planner.search.result import Cell
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import Affine2D, offset_copy
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar
from numpy.typing import ArrayLike, NDArray

from llm_astar_lab.pictures import raster, style
from llm_astar_lab.pictures.instructed import InstructedPath, instructed_path
from llm_astar_lab.pictures.instructions import add_instruction_legend, draw_instruction
from llm_astar_lab.pictures.places import Labels, draw_places, write_names
from llm_astar_lab.pictures.style import Mark

# Inches and dots: 1280 pixels, of which a README shows 880, with text that is read there.
WIDTH, MIN_WIDTH, MAX_MAP_HEIGHT, DPI = 8.0, 5.0, 7.0, 160
# What surrounds the map: title, labels of the axes, legend.
FRAME_WIDTH, FRAME_HEIGHT = 0.9, 1.55
# An expanded cell is drawn at least so many pixels wide.
MIN_PIXELS = 5.0
# Of a title in its font.
CHARACTERS_PER_INCH = 11
SIZE = 10.0
# Of methods, for titles.
METHOD_NAMES = {
    'astar': 'A*', 'exact_astar': 'exact A*', 'weighted_astar': 'weighted A*',
    'dynamic_weighted_astar': 'dynamic weighted A*', 'llm_astar': 'LLM-A*',
}  # fmt: skip
# Outlines of the robot drawn along one path.
MAX_OUTLINES = 100
# The order of a legend; what is not here comes first.
LEGEND = ('path', 'footprint', 'expanded', 'inflated zone', 'obstacle', 'unknown')
# Maps that are so many times as wide as high are drawn below each other.
WIDE = 2.6
MAX_PANEL_HEIGHT = 4.4
# In grid coordinates.
Point = tuple[float, float]
CASING = [Stroke(linewidth=4.4, foreground=style.PATH_OUTLINE), Normal()]


@dataclass(frozen=True, eq=False)
class Picture:
    """What to draw, in grid coordinates: `path` [n, 2], `expanded` bool [height, width].

    `waypoints` are (x, y, status). `offset` is the map coordinate of cell (0, 0), for the axes of
    a map whose cells are one metre; those of other maps are in metres. `places` are drawn with
    their names, `instructed` says what became of an instruction, the `footprint` is drawn along
    the path, and `inflated`, bool [height, width], is what the robot's body closes. `shown` is
    the part of the map that is drawn, None to choose it; `has_scale_bar` is for maps in metres.
    `ways` are those to choose from. `causes` are the places, points in metres, of what closes
    the way.
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
    inflated: NDArray[np.bool_] | None = None
    via: Sequence[Cell] = ()
    shown: raster.MapWindow | None = None
    has_scale_bar: bool = True
    ways: Sequence[NDArray[np.int32]] = ()
    causes: Sequence[Sequence[Sequence[float]]] = ()

    @property
    def in_metres(self) -> bool:
        """Whether the axes are in metres: on the maps of robots."""
        return self.grid_map.resolution != 1.0

    def on_axes(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return points [n, 2] in grid coordinates in the coordinates of the axes."""
        cells = np.asarray(points, dtype=float).reshape(-1, 2)
        return self.grid_map.grid_to_world(cells) if self.in_metres else cells + self.offset

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points [n, 2] in metres of the map's frame in the coordinates of the axes."""
        return points if self.in_metres else self.on_axes(self.grid_map.world_to_grid(points))

    @cached_property
    def to_axes(self) -> Affine2D:
        """The transform from grid coordinates to the coordinates of the axes."""
        in_cells = Affine2D().translate(*self.offset)
        return raster.cells_to_metres(self.grid_map) if self.in_metres else in_cells

    @cached_property
    def codes(self) -> NDArray[np.uint8]:
        """What each cell shows; see `raster`."""
        return raster.cell_codes(self.grid_map, self.expanded, self.inflated)

    @cached_property
    def window(self) -> raster.MapWindow:
        """The part of the map that is drawn: all that is known of it, or where something is."""
        if self.shown is not None:
            return self.shown
        guides = [(x, y) for x, y, _ in self.waypoints]
        ends = self.on_map([self.start, self.goal, *self.via, *guides])
        points = np.array(ends, dtype=float)
        if self.instructed is not None or len(self.places) or not len(points):
            height, width = self.codes.shape
            points = np.array([(0, 0), (width - 1, height - 1)], dtype=float)
        return raster.choose_window(self.codes, np.concatenate([points, self.path]))

    def on_map(self, points: Iterable[Point]) -> list[Point]:
        """Return those of some points in grid coordinates that are on the map."""
        right, top = self.grid_map.width - 0.5, self.grid_map.height - 0.5
        return [(x, y) for x, y in points if -0.5 <= x <= right and -0.5 <= y <= top]


def picture_of(
    plan: Plan, costmap: Costmap, offset: Cell = (0, 0), route: Route | None = None
) -> Picture:
    """Return the picture of a plan on its costmap, with what the robot's body closes.

    Places and instruction are drawn if the plan's route is given.
    """
    grid_map = raster.drawable_map(costmap.grid_map, costmap.config)
    waypoints = [(point.x, point.y, point.status.value) for point in plan.checked_waypoints]
    is_guided = plan.guided_by != 'none'
    guidance = describe_guidance(plan.method, plan.guided_by) if is_guided else describe_plan(plan)
    outcome = describe_outcome(plan, grid_map.resolution)
    places = NO_PLACES if route is None else route.places
    path = plan.path if plan.any_angle is None else plan.any_angle.points
    instructed = None if route is None else instructed_path(plan, route)
    inflated = costmap.blocked & ~grid_map.blocked()
    return Picture(
        grid_map, plan.start, plan.goal, path, plan.expanded, waypoints, f'{guidance}: {outcome}',
        offset, places, instructed, plan.footprint, inflated, plan.via,
        ways=[way.path for way in plan.alternatives],
        causes=[] if plan.why is None else [points for _, points in plan.why.places()],
    )  # fmt: skip


def picture_of_one(plan: Plan, costmap: Costmap, offset: Cell, name: str) -> Picture:
    """Return the picture of one of several plans on a map, under its name and what came out."""
    outcome = describe_length(plan, costmap.grid_map.resolution)
    title = f'{name}\n{outcome}, {describe_expansions(plan.expansions)}'
    return replace(picture_of(plan, costmap, offset), title=title)


def describe_guidance(method: str, guided_by: str) -> str:
    """Name the method of a plan and the source whose waypoints it followed, for a title."""
    guide = 'no waypoints' if guided_by == 'none' else f'waypoints by {guided_by}'
    return f'{METHOD_NAMES.get(method, method)}, {guide}'


def describe_plan(plan: Plan) -> str:
    """Name the method of a plan and its source, in few words, for the title of one of several."""
    if plan.guided_by != 'none':
        return describe_guidance(plan.method, plan.source)
    name = METHOD_NAMES.get(plan.method, plan.method)
    no_waypoints = 'waypoints not used' if plan.checked_waypoints else 'no waypoints'
    return f'{name}, {no_waypoints}' if plan.method in WAYPOINT_METHODS else name


def describe_length(plan: Plan, resolution: float) -> str:
    """Return the length of a plan's path, in metres on the maps of robots."""
    length = plan.length if plan.any_angle is None else plan.any_angle.length
    return f'{length:.2f} cells' if resolution == 1.0 else f'{length * resolution:.2f} m'


def describe_outcome(plan: Plan, resolution: float) -> str:
    """Return length and expansions of a plan, for a title, or why there is no path."""
    if plan.code:
        return f'no path: {plan.message} [{plan.code.name} {int(plan.code)}]'
    text = f'{describe_length(plan, resolution)}, {describe_expansions(plan.expansions)}'
    if math.isfinite(plan.suboptimality_bound):
        is_short = math.isclose(plan.cost, plan.length, rel_tol=1e-6)
        best = 'shortest' if is_short else 'cheapest'
        text += f', proven within {plan.suboptimality_bound:.4f} of the {best}'
    return text


def save_picture(picture: Picture, path: str | Path) -> None:
    """Draw into an image file, whose ending chooses the format; missing folders are created.

    Raises OSError where the file cannot be written, ValueError for an unknown ending.
    """
    figure = Figure(figsize=figure_size(picture.window), layout='constrained')
    draw_panels(figure, [figure.add_subplot()], [picture])
    write_figure(figure, path)


def figure_size(window: raster.MapWindow) -> tuple[float, float]:
    """Return the size in inches of the picture of a part of a map."""
    aspect = window.height / window.width
    height = min((WIDTH - FRAME_WIDTH) * aspect, MAX_MAP_HEIGHT)
    return max(MIN_WIDTH, min(WIDTH, height / aspect + FRAME_WIDTH)), height + FRAME_HEIGHT


def write_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file of exactly this name; raises as `save_picture` does."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Without a format matplotlib adds an ending to a name that has none.
    with naming(path):
        figure.savefig(
            path, dpi=DPI, format=path.suffix[1:] or 'png', bbox_inches='tight', pad_inches=0.08
        )


def draw_panels(figure: Figure, panels: Sequence[Axes], pictures: Sequence[Picture]) -> None:
    """Draw a picture on each panel of a figure, explain what is drawn, and write the labels."""
    for axes, picture in zip(panels, pictures):
        draw(axes, picture)
    add_legend(figure, panels)
    for picture in pictures:
        if picture.instructed is not None:
            add_instruction_legend(figure, picture.instructed)
    for axes, picture in zip(panels, pictures):
        write_labels(axes, picture)


def draw(axes: Axes, picture: Picture) -> None:
    """Draw on axes in map coordinates, in metres or with cell centres at whole numbers."""
    draw_cells(axes, picture)
    draw_places(axes, picture.places, picture.project)
    # Wider than the path, which is drawn over the best of them.
    for number, (way, colour) in enumerate(zip(picture.ways, cycle(style.WAYS)), start=1):
        label, (x, y) = f'way {number}', picture.on_axes(way).T
        axes.plot(x, y, linewidth=9, alpha=0.5, color=colour, label=label)
    for points in picture.causes:
        x, y = picture.project(np.array(points)).T
        axes.plot(x, y, 'X:', color=style.PATH, markersize=11, zorder=4.9, label='closes the way')
    if len(picture.path):
        x, y = picture.on_axes(picture.path).T
        axes.plot(x, y, color=style.PATH, linewidth=2.4, path_effects=CASING, label='path')
    if picture.footprint is not None and len(picture.path) > 1:
        draw_footprints(axes, picture, picture.footprint)
    if picture.instructed is not None:
        draw_instruction(axes, picture.instructed, picture.project)
    for mark, points in marks_of(picture):
        x, y = picture.on_axes(points).T
        axes.plot(
            x, y, mark.marker, color=mark.colour, label=mark.name, zorder=4.8, clip_on=False,
            markersize=14 if mark.marker == '*' else 9, markeredgecolor=style.MARK_EDGE,
        )  # fmt: skip
    place = axes.get_subplotspec()
    columns = 1 if place is None else place.get_gridspec().ncols
    inches = axes.figure.bbox.width / axes.figure.dpi / columns
    axes.set_title(wrap_title(picture.title, inches), parse_math=False, fontsize=SIZE)


def marks_of(picture: Picture) -> list[tuple[Mark, list[Point]]]:
    """Return what is marked on a picture: each mark with its points in grid coordinates."""
    ends = {style.START: [picture.start], style.GOAL: [picture.goal], style.VIA: picture.via}
    marks: dict[Mark, Sequence[Point]] = {**ends}
    for status, mark in style.WAYPOINTS.items():
        marks[mark] = [(x, y) for x, y, found in picture.waypoints if found == status]
    return [(mark, points) for mark, every in marks.items() if (points := picture.on_map(every))]


def write_labels(axes: Axes, picture: Picture) -> None:
    """Write the numbers of waypoints and via points and the names of places, clear of the marks.

    Call it last: the axes must have their final limits and size.
    """
    labels = Labels(axes, picture.on_axes(picture.path))
    marks = [picture.on_axes(points) for _, points in marks_of(picture)]
    labels.take(np.concatenate([np.empty((0, 2)), *marks]))
    numbered = {str(number): point[:2] for number, point in enumerate(picture.waypoints, start=1)}
    numbered |= {f'via {number}': cell for number, cell in enumerate(picture.via, start=1)}
    numbered |= {f'way {n}': apart(way, picture.ways) for n, way in enumerate(picture.ways, 1)}
    for text, point in numbered.items():
        if picture.on_map([point]):
            labels.add_number(text, *picture.on_axes([point])[0])
    write_names(labels, picture.places, picture.project)


def apart(way: NDArray[np.int32], ways: Sequence[NDArray[np.int32]]) -> Point:
    """Return the cell of a way [n, 2] that is farthest from the others, its middle without any."""
    # A tenth of a second, which most pictures do not take.
    from scipy.spatial import KDTree  # noqa: PLC0415

    others = [other for other in ways if other is not way] or [way[[0, -1]]]
    distances, _ = KDTree(np.concatenate(others)).query(way)
    return tuple(way[distances.argmax()].tolist())


def draw_footprints(axes: Axes, picture: Picture, footprint: Footprint) -> None:
    """Draw the robot's outline along the path, about its own size apart."""
    resolution = picture.grid_map.resolution
    path = picture.path
    steps = np.diff(path, axis=0, append=2 * path[-1:] - path[-2:-1])
    apart = max(1.0, 1.5 * footprint.circumscribed_radius / resolution, len(path) / MAX_OUTLINES)
    outlines = []
    for index in np.arange(0.0, len(path), apart).astype(int):
        cos, sin = steps[index] / max(np.hypot(*steps[index]), 1.0)
        turned = footprint.array / resolution @ np.array([[cos, sin], [-sin, cos]])
        outlines.append(picture.on_axes(turned + path[index]))
    drawn = PolyCollection(
        outlines, facecolors='none', edgecolors=style.FOOTPRINT, linewidths=0.9, zorder=2.9,
        label='footprint',
    )  # fmt: skip
    axes.add_collection(drawn)


def wrap_title(title: str, inches: float) -> str:
    """Break a title that is wider than `inches`, first after its colon."""
    width = int(CHARACTERS_PER_INCH * inches)
    lines = title.split('\n')
    parts = title.split(': ', 1) if len(lines) == 1 and len(title) > width else lines
    return '\n'.join(fill(part, width) for part in parts)


def draw_cells(axes: Axes, picture: Picture) -> None:
    """Draw the cells of the part of the map that is worth drawing, with its axes."""
    window = picture.window
    codes = window.cut(picture.codes)
    box = axes.get_window_extent()
    pixels = box.width / axes.figure.dpi * DPI / window.width
    codes = raster.widen_expanded(codes, math.ceil(MIN_PIXELS / pixels))
    if pixels < 1.0:
        size = (max(1, int(side * pixels)) for side in (window.width, window.height))
        codes = raster.resize(codes, *size)
    raster.draw_codes(axes, codes, window, picture.to_axes)
    (left, bottom), (right, top) = raster.bounds_of(window, picture.to_axes)
    unit = 'm' if picture.in_metres else 'cells'
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect='equal')
    axes.set(xlabel=f'x ({unit})', ylabel=f'y ({unit})')
    for code in np.unique(codes):
        if name := raster.NAMES[code]:
            colour = raster.COLOURS[code]
            axes.plot([], [], 's', color=colour, mec=style.SOFT, mew=0.5, ms=10, label=name)
    axes.locator_params(integer=not picture.in_metres, steps=[1, 2, 5, 10])
    if picture.in_metres and picture.has_scale_bar:
        add_scale_bar(axes, right - left)


def add_scale_bar(axes: Axes, width: float) -> None:
    """Draw a scale bar below axes that are `width` metres wide."""
    power = 10.0 ** math.floor(math.log10(width / 4))
    metres = next(step * power for step in (5.0, 2.0, 1.0) if step * power <= width / 4)
    below = offset_copy(axes.transAxes, axes.get_figure(root=True), y=-19.0, units='points')
    bar = AnchoredSizeBar(
        axes.transData, metres, f'{metres:g} m', 'upper right', pad=0, borderpad=0, sep=2,
        frameon=False, size_vertical=width / 250, label_top=True, color=style.INK,
        bbox_to_anchor=(1.0, 0.0), bbox_transform=below,
    )  # fmt: skip
    axes.add_artist(bar)


def add_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """Explain what is drawn on the panels of a figure, below them."""
    handles: dict[str, Artist] = {}
    for axes in panels:
        for handle, name in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(name, handle)
    names = sorted(handles, key=lambda name: LEGEND.index(name) if name in LEGEND else -1)
    rows = max(1, math.ceil(len(names) / int(figure.get_figwidth() / 1.25)))
    figure.legend(
        [handles[name] for name in names], names, loc='outside lower center', frameon=False,
        ncols=max(1, math.ceil(len(names) / rows)), fontsize=SIZE - 1, handlelength=1.4,
        columnspacing=1.4,
    )  # fmt: skip


def panels_for(
    figure: Figure, pictures: Sequence[Picture], around: tuple[float, float]
) -> list[Axes]:
    """Divide a figure into panels for pictures of one part of a map, and give it their height.

    `around` is the room for titles and axes at each panel and for the legend, in inches.
    """
    window = pictures[0].window
    aspect = window.height / window.width
    rows = len(pictures) if aspect * WIDE < 1.0 else 1
    columns = len(pictures) // rows
    height = min(aspect * WIDTH / columns, MAX_PANEL_HEIGHT)
    figure.set_size_inches(WIDTH, rows * (height + around[0]) + around[1])
    return list(figure.subplots(rows, columns, squeeze=False).ravel())


def on_one_window(pictures: Sequence[Picture]) -> list[Picture]:
    """Return pictures of one map that all show the same part of it; the last has the scale."""
    left, bottom, right, top = zip(*(picture.window for picture in pictures))
    window = raster.MapWindow(min(left), min(bottom), max(right), max(top))
    last = pictures[-1]
    return [replace(picture, shown=window, has_scale_bar=picture is last) for picture in pictures]


def comparison_figure(pictures: Sequence[Picture]) -> Figure:
    """Draw plans on one map, at least one, beside each other or below each other."""
    pictures = on_one_window(pictures)
    figure = Figure(layout='constrained')
    draw_panels(figure, panels_for(figure, pictures, (0.95, 0.5)), pictures)
    return figure
