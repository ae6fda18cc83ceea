# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Which cells of a grid a geometry covers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.costmap import _kernels as kernels
from llm_astar_planner.search.arrays import Bools, Int64s

# Parts of a boundary that lie this near to the border of a cell, in cells, run along it.
ON_BORDER = 1e-7
MAX_BORDER = 2000
# The moves to the eight neighbours, (x, y).
STEPS = np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y])


class Window(NamedTuple):
    """A part of a map, in cells, half open."""

    top: int
    bottom: int
    left: int
    right: int

    def slices(self, top: int = 0, left: int = 0) -> tuple[slice, slice]:
        """Return its rows and columns, counted from a cell."""
        rows = slice(self.top - top, self.bottom - top)
        return rows, slice(self.left - left, self.right - left)


class Cover(NamedTuple):
    """Cells that a geometry covers, bool [height, width].

    `whole`: all of their square lies in it. `centres`: their centre does. `touched`: part of
    their square does; a path between cells that are not touched has no part in the geometry.
    """

    whole: Bools
    centres: Bools
    touched: Bools

    def outside(self) -> Cover:
        """Return the cells that everything else covers."""
        return Cover(~self.touched, ~self.centres, ~self.whole)


def cover(geometry: BaseGeometry, grid_map: GridMap) -> Cover:
    """Return the cells that a polygon or several, in metres of the map's frame, covers."""
    height, width = grid_map.cells.shape
    return cover_window(geometry, grid_map, Window(0, height, 0, width))


def cover_window(geometry: BaseGeometry, grid_map: GridMap, window: Window) -> Cover:
    """Return what `cover` does, of the cells of a window alone, in O(cells in it)."""
    shape = window.bottom - window.top, window.right - window.left
    inside, border = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    # The parts of a collection may be multipolygons themselves.
    rings = shapely.get_rings(shapely.get_parts(shapely.get_parts(geometry)))
    if len(rings) and inside.size:
        points = grid_map.world_to_grid(shapely.get_coordinates(rings)) - (window.left, window.top)
        ends = np.cumsum(shapely.get_num_coordinates(rings))
        kernels.cover(points, ends, ON_BORDER, inside, border)
    return Cover(inside & ~border, inside, inside | border)


def window_of(geometry: BaseGeometry, grid_map: GridMap) -> Window:
    """Return the smallest window of the map that holds all that a geometry covers of it."""
    height, width = grid_map.cells.shape
    if geometry.is_empty:
        return Window(0, 0, 0, 0)
    points = grid_map.world_to_grid(shapely.get_coordinates(geometry))
    left, top = np.clip(np.floor(points.min(axis=0) + 0.5), 0, (width, height)).tolist()
    right, bottom = np.clip(np.floor(points.max(axis=0) + 1.5), 0, (width, height)).tolist()
    return Window(int(top), int(bottom), int(left), int(right))


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
    border: Bools, usable: Bools, geometry: BaseGeometry, grid_map: GridMap
) -> Int64s:
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
    return np.asarray(moves[inside > ON_BORDER * grid_map.resolution])
