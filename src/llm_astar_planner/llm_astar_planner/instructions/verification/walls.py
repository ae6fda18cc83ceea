"""The walls of a map as the verification measures them: the squares of its lethal cells."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.verification.geometry import (
    EDGE,
    NOTHING,
    Area,
    Polyline,
    Spans,
    joined,
    polyline,
)
from llm_astar_planner.lazy import ndimage

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
        for piece in self.pieces(path, reach):
            away = piece.distances()
            xs, ys = piece.squares[away <= away.min() + SPREAD + 1e-6].T
            squares = shapely.box(xs - 0.5, ys - 0.5, xs + 0.5, ys + 0.5)
            away = shapely.distance(squares, piece.shape)
            least = int(np.argmin(away))
            if away[least] * self._grid_map.resolution < metres:
                metres = float(away[least]) * self._grid_map.resolution
                line = shapely.shortest_line(piece.shape, squares[least])
                x, y = self._grid_map.grid_to_world(shapely.get_coordinates(line)[:1])[0]
                point = float(x), float(y)
        return (metres, point) if metres <= reach else (math.inf, path.point(0.0))

    def spans(self, path: Polyline, metres: float) -> NDArray[np.float64]:
        """Return where a path is at most `metres`, above 0, from the walls; spans as in Polyline.

        All that is so near to one square is convex, so a straight piece has one stretch in it,
        from the first to the last of what lies in two boxes and four discs.
        """
        radius = metres / self._grid_map.resolution
        found = [np.empty((0, 2))]
        for piece in self.pieces(path, metres):
            near = piece.distances() <= radius + math.sqrt(0.5)
            firsts, lasts = piece.stretches(piece.squares[near], radius)
            hit = firsts <= lasts
            places = np.column_stack((firsts[hit], lasts[hit])) * self._grid_map.resolution
            found.append(piece.place + places)
        return np.concatenate(found)

    def pieces(self, path: Polyline, reach: float) -> Iterator[StraightPiece]:
        """Cut a path into pieces; yield those with lethal cells within `reach` metres, or so."""
        corners = self._grid_map.world_to_grid(path.corners)
        around = reach / self._grid_map.resolution + 1.0
        for begin, end, place in pieces_of(corners, path.at):
            low, high = np.minimum(begin, end) - around, np.maximum(begin, end) + around
            x0, y0 = np.maximum(np.floor(low), 0.0).astype(np.intp)
            x1, y1 = np.maximum(np.ceil(high) + 1.0, 0.0).astype(np.intp)
            ys, xs = np.nonzero(self._grid_map.cells[y0:y1, x0:x1] >= self._threshold)
            if len(xs):
                yield StraightPiece(begin, end, place, np.column_stack((xs + x0, ys + y0)))

    def outline(self, metres: float) -> BaseGeometry:
        """Return everything within `metres` of the walls near the path as a polygon, to draw."""
        lethal = np.zeros(self._grid_map.cells.shape, dtype=np.bool_)
        for piece in self.pieces(self._path, metres):
            lethal[piece.squares[:, 1], piece.squares[:, 0]] = True
        x0, y0, x1, y1 = rectangles(lethal)
        cells = shapely.union_all(shapely.box(x0 - 0.5, y0 - 0.5, x1 - 0.5, y1 - 0.5))
        placed = shapely.transform(cells, self._grid_map.grid_to_world)
        return shapely.buffer(placed, metres, quad_segs=4)

    def zone(self, metres: float) -> WallZone:
        """Return everything within `metres`, above 0, of the walls."""
        return WallZone(NOTHING, np.empty((0, 3)), self, metres)

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


@dataclass(frozen=True, eq=False)
class StraightPiece:
    """A straight piece of a path, `begin` to `end` in cells, with lethal cells near it.

    `place` is where on the path it begins, metres; `squares` are the cells (x, y), [n, 2].
    """

    begin: NDArray[np.float64]
    end: NDArray[np.float64]
    place: float
    squares: NDArray[np.intp]

    @property
    def shape(self) -> BaseGeometry:
        """The piece as a shapely line, or a point."""
        if (self.begin == self.end).all():
            return shapely.Point(self.begin)
        return shapely.LineString([self.begin, self.end])

    def distances(self) -> NDArray[np.float64]:
        """Return the distances of the squares' centres, in cells: float64 [n]."""
        off = self.squares - self.begin
        step = self.end - self.begin
        length = float(step @ step)
        share = np.clip(off @ step / length, 0.0, 1.0) if length else np.zeros(len(off))
        off = off - share[:, None] * step
        return np.hypot(off[:, 0], off[:, 1])

    def stretches(
        self, squares: NDArray[np.intp], radius: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where the piece is at most `radius` cells from each of some squares.

        As first and last place on it, in cells, float64 [n] each; last before first if nowhere.
        """
        length = math.dist(self.begin, self.end)
        ahead = (self.end - self.begin) / length if length else np.zeros(2)
        off = squares - self.begin
        firsts, lasts = np.full(len(off), np.inf), np.full(len(off), -np.inf)
        grown = radius + 0.5
        parts = [in_box(off, ahead, grown, 0.5), in_box(off, ahead, 0.5, grown)]
        corners = ((0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5))
        parts += [in_disc(off + corner, ahead, radius) for corner in corners]
        for begin, end in parts:
            first, last = np.maximum(begin, 0.0), np.minimum(end, length)
            hit = first <= last
            firsts[hit] = np.minimum(firsts, first)[hit]
            lasts[hit] = np.maximum(lasts, last)[hit]
        return firsts, lasts


def in_box(
    off: NDArray[np.float64], ahead: NDArray[np.float64], half_x: float, half_y: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where a line from the origin lies in boxes around the points `off` [n, 2]."""
    firsts, lasts = np.full(len(off), -np.inf), np.full(len(off), np.inf)
    for axis, half in enumerate((half_x, half_y)):
        low, high = off[:, axis] - half, off[:, axis] + half
        if ahead[axis]:
            one, other = low / ahead[axis], high / ahead[axis]
            firsts = np.maximum(firsts, np.minimum(one, other))
            lasts = np.minimum(lasts, np.maximum(one, other))
        else:
            lasts = np.where((low <= 0.0) & (high >= 0.0), lasts, -np.inf)
    return firsts, lasts


def in_disc(
    off: NDArray[np.float64], ahead: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where a line from the origin lies in discs around the points `off` [n, 2]."""
    along = off @ ahead
    across = np.hypot(*(off - along[:, None] * ahead).T)
    half = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    lasts = along + half if ahead.any() else np.full(len(off), np.inf)
    return along - half, np.where(across <= radius, lasts, -np.inf)


@dataclass(frozen=True, eq=False)
class WallZone(Area):
    """All that is at most `metres` from the walls."""

    walls: Walls
    metres: float

    @property
    def wall_distance(self) -> float:
        """How near to a wall everything in it is."""
        return self.metres

    @property
    def has_size(self) -> bool:
        """Whether a path can lie in it."""
        return self.metres > 0.0

    @cached_property
    def outline(self) -> BaseGeometry:
        """The part near the path as a polygon, to draw."""
        return self.walls.outline(self.metres)

    def grown(self, by: float) -> WallZone:
        """Return all points within `by` metres more of the walls."""
        return self.walls.zone(self.metres + by)

    def shrunk(self, by: float) -> WallZone:
        """Return all points that are `by` metres nearer to the walls."""
        return self.walls.zone(self.metres - by)

    def spans(self, path: Polyline) -> Spans:
        """Return where a path lies in it."""
        return joined(self.walls.spans(path, self.metres))

    def contains_inside(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points [n, 2] lie in it and not on its edge."""
        return self._distances(points) < self.metres

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points [n, 2] lie in it, those within EDGE of its edge included."""
        return self._distances(points) <= self.metres + EDGE

    def _distances(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the metres from points [n, 2] to the walls, inf where that is over twice its."""
        reach = 2.0 * self.metres + EDGE
        xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return np.array([self.walls.nearest(polyline(point), reach)[0] for point in xy])

    def distance(self, shape: BaseGeometry) -> float:
        """Return the metres from a point or a line to it, inf without walls."""
        return max(0.0, self._nearest(shape)[0] - self.metres)

    def nearest_point(self, shape: BaseGeometry) -> tuple[float, float]:
        """Return the point (x, y) of a point or a line that is nearest to it."""
        return self._nearest(shape)[1]

    def _nearest(self, shape: BaseGeometry) -> tuple[float, tuple[float, float]]:
        """Look farther and farther for the wall that is nearest to a point or a line."""
        path, reach = polyline(shapely.get_coordinates(shape)), self.metres + 1.0
        found = self.walls.nearest(path, reach)
        while math.isinf(found[0]) and self.walls.exist:
            reach *= 2.0
            found = self.walls.nearest(path, reach)
        return found


def pieces_of(
    corners: NDArray[np.float64], at: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64], float]]:
    """Yield begin, end and place of straight pieces of a polyline [n, 2], none over PIECE long.

    `at` are the places of its corners.
    """
    if len(corners) == 1:
        yield corners[0], corners[0], 0.0
    for (begin, end), (first, last) in zip(pairwise(corners), pairwise(at)):
        count = max(1, math.ceil(math.dist(begin, end) / PIECE))
        shares = np.arange(count + 1) / count
        cuts = begin + (end - begin) * shares[:, None]
        for number, share in enumerate(shares[:-1]):
            yield cuts[number], cuts[number + 1], first + share * (last - first)


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
