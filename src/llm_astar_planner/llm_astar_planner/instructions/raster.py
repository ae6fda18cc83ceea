"""Which cells of a grid a geometry covers, for enforcement."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

# Parts of a boundary that lie this near to the border of a cell, in cells, run along it.
ON_BORDER = 1e-7
MAX_BORDER = 2000
# The moves to the eight neighbours, (x, y).
STEPS = np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y])


class Cover(NamedTuple):
    """Cells that a geometry covers, bool [height, width].

    `whole`: all of their square lies in it. `centres`: their centre does. `touched`: part of
    their square does; a path between cells that are not touched has no part in the geometry.
    """

    whole: NDArray[np.bool_]
    centres: NDArray[np.bool_]
    touched: NDArray[np.bool_]

    def outside(self) -> Cover:
        """Return the cells that everything else covers."""
        return Cover(~self.touched, ~self.centres, ~self.whole)


def cover(geometry: BaseGeometry, grid_map: GridMap) -> Cover:
    """Return the cells that a polygon or several, in metres of the map's frame, covers."""
    shape = grid_map.cells.shape
    inside = np.zeros(shape, dtype=np.bool_)
    border = np.zeros(shape, dtype=np.bool_)
    for ring in rings(geometry):
        points = grid_map.world_to_grid(ring)
        inside ^= fill(points, shape)
        mark_border(points, border)
    return Cover(inside & ~border, inside, inside | border)


def open_border(covered: Cover, geometry: BaseGeometry, grid_map: GridMap) -> Cover:
    """Return a cover that touches no more cells than needed to keep every move off the geometry.

    On a coarse grid, cells that the border passes through would close ways beside the geometry.
    Of the moves between cells whose centres lie outside, those that cross the geometry lose one
    end, first the cell with the most such moves. A border of over MAX_BORDER cells stays whole,
    since a cell more matters little on so fine a grid.
    """
    border = covered.touched & ~covered.centres
    if not 0 < np.count_nonzero(border) <= MAX_BORDER:
        return covered
    crossing = crossing_moves(border, ~covered.centres, geometry, grid_map)
    closed = covered.centres.copy()
    while len(crossing):
        cells, counts = np.unique(crossing.reshape(-1, 2), axis=0, return_counts=True)
        x, y = cells[counts.argmax()]
        closed[y, x] = True
        crossing = crossing[~(crossing == (x, y)).all(axis=2).any(axis=1)]
    return covered._replace(touched=closed)


def crossing_moves(
    border: NDArray[np.bool_], usable: NDArray[np.bool_], geometry: BaseGeometry, grid_map: GridMap
) -> NDArray[np.int64]:
    """Return the moves from cells of the border that cross a geometry: cells (x, y) [n, 2, 2].

    Both ends of a move are `usable`.
    """
    y, x = np.nonzero(border)
    begins = np.repeat(np.stack([x, y], axis=1), len(STEPS), axis=0)
    ends = begins + np.tile(STEPS, (len(x), 1))
    on_map = ((ends >= 0) & (ends < (grid_map.width, grid_map.height))).all(axis=1)
    begins, ends = begins[on_map], ends[on_map]
    open_ends = usable[ends[:, 1], ends[:, 0]]
    moves = np.stack([begins[open_ends], ends[open_ends]], axis=1)
    lines = shapely.linestrings(grid_map.grid_to_world(moves.reshape(-1, 2)).reshape(-1, 2, 2))
    shapely.prepare(geometry)
    moves, lines = (part[shapely.intersects(geometry, lines)] for part in (moves, lines))
    inside = shapely.length(shapely.intersection(lines, geometry))
    crossing: NDArray[np.int64] = moves[inside > ON_BORDER * grid_map.resolution]
    return crossing


def rings(geometry: BaseGeometry) -> Iterator[NDArray[np.float64]]:
    """Yield the rings of all polygons: the points [n, 2], closed, first equal to last."""
    for part in shapely.get_parts(geometry):
        if part.geom_type == 'Polygon' and not part.is_empty:
            yield shapely.get_coordinates(part.exterior)
            for hole in part.interiors:
                yield shapely.get_coordinates(hole)
        elif part.geom_type in ('MultiPolygon', 'GeometryCollection'):
            yield from rings(part)


def fill(points: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return the cells whose centres lie within a ring of grid coordinates, by even-odd rule."""
    height, width = shape
    toggles = np.zeros((height, width + 1), dtype=np.int32)
    for (x0, y0), (x1, y1) in pairwise(points):
        low, high = sorted((y0, y1))
        # Rows with low <= y < high: each crossing of a row is counted once, at shared corners too.
        first, last = max(math.ceil(low), 0), min(math.ceil(high), height)
        if first >= last:
            continue
        rows = np.arange(first, last)
        crossings = x0 + (rows - y0) * ((x1 - x0) / (y1 - y0))
        columns = np.clip(np.ceil(crossings), 0, width).astype(np.int64)
        np.add.at(toggles, (rows, columns), 1)
    odd: NDArray[np.bool_] = (np.cumsum(toggles, axis=1)[:, :width] & 1).astype(np.bool_)
    return odd


def mark_border(points: NDArray[np.float64], border: NDArray[np.bool_]) -> None:
    """Mark the cells whose inside the ring passes through; a side along a border marks none."""
    height, width = border.shape
    for (x0, y0), (x1, y1) in pairwise(points):
        cuts = np.unique([0.0, *grid_cuts(x0, x1, width), *grid_cuts(y0, y1, height), 1.0])
        middles = (cuts[:-1] + cuts[1:]) / 2.0
        x, y = x0 + middles * (x1 - x0), y0 + middles * (y1 - y0)
        off = off_border(x) & off_border(y)
        columns, rows = np.floor(x + 0.5).astype(np.int64), np.floor(y + 0.5).astype(np.int64)
        on_map = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height) & off
        border[rows[on_map], columns[on_map]] = True


def grid_cuts(begin: float, end: float, size: int) -> NDArray[np.float64]:
    """Return where (0 to 1) a side from `begin` to `end` meets the borders of `size` cells."""
    if begin == end:
        return np.empty(0)
    low, high = sorted((begin, end))
    first, last = max(math.ceil(low + 0.5), 0), min(math.floor(high + 0.5), size)
    cuts = (np.arange(first, last + 1) - 0.5 - begin) / (end - begin)
    return np.asarray(cuts[(cuts > 0.0) & (cuts < 1.0)], dtype=np.float64)


def off_border(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which coordinates lie off the borders between cells."""
    distance = np.abs(values - np.floor(values) - 0.5)
    off: NDArray[np.bool_] = distance > ON_BORDER
    return off
