# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Maps as images: what each cell shows, which part of a map is drawn, and at which size."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search.arrays import Bools, Float64s, Int64s, Uint8s
from llm_astar_planner.search.expansion_order import ExpansionOrder
from matplotlib.axes import Axes
from matplotlib.transforms import Affine2D

from llm_astar_lab.pictures import style

# What a cell shows. Where cells share a pixel, the one with the highest number is seen.
OPEN, UNKNOWN, EXPANDED, INFLATED, OBSTACLE = range(5)
COLOURS = (style.FREE, style.UNKNOWN, style.EXPANDED, style.INFLATED, style.OBSTACLE)
PALETTE = np.array([tuple(bytes.fromhex(colour[1:])) for colour in COLOURS], dtype=np.uint8)
NAMES = ('', 'unknown', 'expanded', 'inflated zone', 'obstacle')
# A part of a map with so many columns or rows is drawn alone if it is less than this part of the
# whole. It has a margin of this part of its longer side.
LARGE, WORTH_CROPPING, MARGIN = 150, 0.6, 0.15
# It is no slimmer strip than this, where there is more to show.
SLIMMEST = 0.5


class MapWindow(NamedTuple):
    """A part of a map: columns `left` to `right` and rows `bottom` to `top`, ends excluded."""

    left: int
    bottom: int
    right: int
    top: int

    @property
    def width(self) -> int:
        """Columns."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """Rows."""
        return self.top - self.bottom

    def cut(self, codes: Uint8s) -> Uint8s:
        """Return this part of an array [height, width]."""
        return codes[self.bottom : self.top, self.left : self.right]


def drawable_map(grid_map: GridMap, costmap: CostmapConfig | None) -> GridMap:
    """Return a map for drawing: lethal cells by the rules are occupied, other known ones free."""
    threshold = (costmap or CostmapConfig()).occupied_threshold
    cells = np.where(grid_map.cells >= threshold, OCCUPIED, np.minimum(grid_map.cells, FREE))
    return replace(grid_map, cells=cells.astype(np.int8))


def cell_codes(
    grid_map: GridMap, expanded: Bools | None = None, inflated: Bools | None = None
) -> Uint8s:
    """Return what each cell shows: uint8 [height, width].

    `expanded` and `inflated`, the cells that the robot's body closes, are bool [height, width];
    None, or an empty array of expanded cells, stands for no cells.
    """
    cells = grid_map.cells
    codes = np.where(cells < FREE, UNKNOWN, OPEN).astype(np.uint8)
    if expanded is not None and expanded.size:
        codes[expanded] = EXPANDED
    if inflated is not None:
        codes[inflated & (cells >= FREE)] = INFLATED
    codes[grid_map.blocked()] = OBSTACLE
    return codes


def expanded_cells(order: ExpansionOrder, shape: tuple[int, ...], expansions: int) -> Bools:
    """Return which cells of a map are expanded after so many expansions: bool [height, width]."""
    expanded = np.zeros(shape, dtype=np.bool_)
    expanded.flat[order.order[: order.cells_after(expansions)]] = True
    return expanded


def choose_window(codes: Uint8s, points: Float64s) -> MapWindow:
    """Return the part of a map worth drawing: around expanded cells and points [n, 2].

    It is the part that is known, where what happens takes most of that.
    """
    known = surroundings(np.argwhere(codes != UNKNOWN)[:, ::-1], codes, 1)
    busy = np.concatenate([np.argwhere(codes == EXPANDED)[:, ::-1], points])
    if not len(busy):
        return known
    part = surroundings(busy, codes, int(MARGIN * max(LARGE / 2, np.ptp(busy, axis=0).max())))
    part = no_strip(part, known)
    is_small = part.width * part.height < WORTH_CROPPING * known.width * known.height
    return part if is_small and max(known.width, known.height) > LARGE else known


def no_strip(part: MapWindow, known: MapWindow) -> MapWindow:
    """Return a part of what is known with both sides at least SLIMMEST of the other, if it can."""
    wide = max(0, int(SLIMMEST * part.height) - part.width) // 2
    high = max(0, int(SLIMMEST * part.width) - part.height) // 2
    return MapWindow(
        max(min(known.left, part.left), part.left - wide),
        max(min(known.bottom, part.bottom), part.bottom - high),
        min(max(known.right, part.right), part.right + wide),
        min(max(known.top, part.top), part.top + high),
    )


def surroundings(places: Float64s | Int64s, codes: Uint8s, margin: int) -> MapWindow:
    """Return the part of a map within `margin` cells of the box of `places` [n, 2]."""
    height, width = codes.shape
    if not len(places):
        return MapWindow(0, 0, width, height)
    left, bottom = np.floor(places.min(axis=0)).astype(int) - margin
    right, top = np.ceil(places.max(axis=0)).astype(int) + margin + 1
    return MapWindow(max(0, left), max(0, bottom), min(width, right), min(height, top))


def widen_expanded(codes: Uint8s, size: int) -> Uint8s:
    """Return codes whose expanded cells are `size` cells wide, so that single ones can be seen."""
    if size < 2:
        return codes
    wide = ndimage.maximum_filter(codes == EXPANDED, size=size)
    return np.where(wide & (codes < EXPANDED), np.uint8(EXPANDED), codes)


def resize(codes: Uint8s, width: int, height: int) -> Uint8s:
    """Return codes at another size; no obstacle is lost where cells share a pixel."""
    return resize_rows(resize_rows(codes, height).T, width).T


def resize_rows(codes: Uint8s, rows: int) -> Uint8s:
    """Return codes with another number of rows: of several the highest codes, or repeated."""
    count = len(codes)
    firsts = np.arange(rows) * count // rows
    if rows >= count:
        return codes[firsts]
    resized: Uint8s = np.maximum.reduceat(codes, firsts, axis=0)
    return resized


def cells_to_metres(grid_map: GridMap) -> Affine2D:
    """Return the transform from grid coordinates to metres of the map's frame."""
    origin = grid_map.origin
    turned = Affine2D().translate(0.5, 0.5).scale(grid_map.resolution).rotate(origin.yaw)
    return turned.translate(origin.x, origin.y)


def bounds_of(window: MapWindow, to_axes: Affine2D) -> Float64s:
    """Return the least and the largest coordinates [2, 2] of a part of a map on the axes."""
    xs, ys = (window.left - 0.5, window.right - 0.5), (window.bottom - 0.5, window.top - 0.5)
    corners = to_axes.transform([(x, y) for x in xs for y in ys])
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def draw_codes(axes: Axes, codes: Uint8s, window: MapWindow, to_axes: Affine2D) -> None:
    """Draw what the cells of a part of a map show, turned as the map is."""
    axes.imshow(
        PALETTE[codes], origin='lower', interpolation='nearest',
        extent=(window.left - 0.5, window.right - 0.5, window.bottom - 0.5, window.top - 0.5),
        transform=to_axes + axes.transData,
    )  # fmt: skip
