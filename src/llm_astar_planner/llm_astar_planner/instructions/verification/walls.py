"""The walls of a map as the verification measures them: the squares of its lethal cells."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.specification import VISIT_DEPTH
from llm_astar_planner.instructions.verification.area import Area, polygon_area
from llm_astar_planner.instructions.verification.polyline import Polyline

# Cells. A path is looked at in pieces of this length, so that few cells are near each.
PIECE = 48.0
# A square is at most half its diagonal nearer than its centre, and at least half its side.
SPREAD = math.sqrt(0.5) - 0.5


class Walls:
    """The lethal cells of a costmap's own map, inflation left out, as squares near a path."""

    def __init__(self, costmap: Costmap, path: Polyline) -> None:
        """Take the costmap and the path."""
        self._grid_map = costmap.grid_map
        self._threshold = costmap.config.occupied_threshold
        self._path = path

    def nearest(self, path: Polyline, reach: float) -> tuple[float, tuple[float, float]]:
        """Return the least metres from a path to the walls, and the point of the path there.

        (inf, the path's first point) where no wall is within `reach` metres.
        """
        metres, point = math.inf, path.point(0.0)
        for piece, xs, ys in self.pieces(path, reach):
            squares = shapely.box(xs - 0.5, ys - 0.5, xs + 0.5, ys + 0.5)
            away = shapely.distance(squares, piece)
            least = int(np.argmin(away))
            if away[least] * self._grid_map.resolution < metres:
                metres = float(away[least]) * self._grid_map.resolution
                line = shapely.shortest_line(piece, squares[least])
                x, y = self._grid_map.grid_to_world(shapely.get_coordinates(line)[:1])[0]
                point = float(x), float(y)
        return (metres, point) if metres <= reach else (math.inf, path.point(0.0))

    def pieces(
        self, path: Polyline, reach: float, *, all_near: bool = False
    ) -> Iterator[tuple[BaseGeometry, NDArray[np.intp], NDArray[np.intp]]]:
        """Cut a path into pieces; yield each with the lethal cells (xs, ys) that may be nearest.

        In cells. With `all_near` all cells within `reach` metres, and perhaps some more, come
        with it. Pieces without such cells are left out.
        """
        corners = self._grid_map.world_to_grid(path.corners)
        around = reach / self._grid_map.resolution + 1.0
        for begin, end in pieces_of(corners):
            xs, ys = self._cells_between(
                np.minimum(begin, end) - around, np.maximum(begin, end) + around
            )
            if not len(xs):
                continue
            piece = shapely.linestrings([begin, end]) if (begin != end).any() else None
            piece = shapely.Point(begin) if piece is None else piece
            if not all_near:
                away = distances_to_segment(xs, ys, begin, end)
                near = away <= away.min() + SPREAD + 1e-6
                xs, ys = xs[near], ys[near]
            yield piece, xs, ys

    def _cells_between(
        self, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the lethal cells in a window of the map."""
        x0, y0 = np.maximum(np.floor(low), 0.0).astype(np.intp)
        x1, y1 = np.maximum(np.ceil(high) + 1.0, 0.0).astype(np.intp)
        ys, xs = np.nonzero(self._grid_map.cells[y0:y1, x0:x1] >= self._threshold)
        return xs + x0, ys + y0

    def zone(self, metres: float) -> Area:
        """Return everything within `metres` of the walls; its polygon is right near the path."""
        lethal = np.zeros(self._grid_map.cells.shape, dtype=np.bool_)
        for _, xs, ys in self.pieces(self._path, metres + VISIT_DEPTH, all_near=True):
            lethal[ys, xs] = True
        x0, y0, x1, y1 = rectangles(lethal)
        cells = shapely.union_all(shapely.box(x0 - 0.5, y0 - 0.5, x1 - 0.5, y1 - 0.5))
        placed = shapely.transform(cells, self._grid_map.grid_to_world)
        return polygon_area(shapely.buffer(placed, metres, quad_segs=16), metres)

    @property
    def exist(self) -> bool:
        """Whether the map has any."""
        return bool((self._grid_map.cells >= self._threshold).any())

    @cached_property
    def centre_distances(self) -> NDArray[np.float64]:
        """Return the metres from the cells' centres to a nearest wall: float64 [height, width].

        Of the square whose centre is nearest, so up to a fifth of a cell too large, never too
        small; inf without walls.
        """
        lethal = self._grid_map.cells >= self._threshold
        if not lethal.any():
            return np.full(lethal.shape, np.inf)
        rows, columns = ndimage.distance_transform_edt(
            ~lethal, return_distances=False, return_indices=True
        )
        height, width = lethal.shape
        off_y = np.maximum(np.abs(rows - np.arange(height)[:, None]) - 0.5, 0.0)
        off_x = np.maximum(np.abs(columns - np.arange(width)) - 0.5, 0.0)
        distances: NDArray[np.float64] = np.hypot(off_x, off_y) * self._grid_map.resolution
        return distances


def pieces_of(
    corners: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the begin and end of straight pieces of a polyline [n, 2], none over PIECE long."""
    if len(corners) == 1:
        yield corners[0], corners[0]
    for begin, end in pairwise(corners):
        count = max(1, math.ceil(math.dist(begin, end) / PIECE))
        cuts = begin + (end - begin) * (np.arange(count + 1) / count)[:, None]
        yield from pairwise(cuts)


def distances_to_segment(
    xs: NDArray[np.intp],
    ys: NDArray[np.intp],
    begin: NDArray[np.float64],
    end: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the distances of points to a straight segment: float64 [n]."""
    off = np.column_stack((xs, ys)) - begin
    step = end - begin
    length = float(step @ step)
    share = np.clip(off @ step / length, 0.0, 1.0) if length else np.zeros(len(xs))
    off -= share[:, None] * step
    distances: NDArray[np.float64] = np.hypot(off[:, 0], off[:, 1])
    return distances


def rectangles(cells: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Cover cells [height, width] with rectangles: x0, y0, x1, y1, the last two exclusive, [4, n].

    A rectangle is a run of cells in a row, together with equal runs in the rows that follow.
    """
    change = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    ys, begins = np.nonzero(change == 1)
    ends = np.nonzero(change == -1)[1]
    order = np.lexsort((ys, ends, begins))
    ys, begins, ends = ys[order], begins[order], ends[order]
    same = (np.diff(begins) == 0) & (np.diff(ends) == 0) & (np.diff(ys) == 1)
    first = np.concatenate(([True], ~same)) if len(ys) else np.zeros(0, dtype=np.bool_)
    last = np.concatenate((~same, [True])) if len(ys) else first
    return np.stack((begins[first], ys[first], ends[first], ys[last] + 1))
