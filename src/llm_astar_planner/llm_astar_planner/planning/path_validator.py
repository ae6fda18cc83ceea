"""The last check before a path leaves. It shares no code with the searches or the inflation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.search.result import Cell

# Less than the costmap's own rounding, so that no cell which is free there is blocked here.
ROUNDING = 5e-7


class BlockedCells(Protocol):
    """Which cells are blocked: bool [height, width], or an object that is indexed like it."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Height and width."""

    def __getitem__(
        self, places: tuple[NDArray[np.int32], NDArray[np.int32]]
    ) -> NDArray[np.bool_]:
        """Tell which of the cells at `rows, columns` are blocked."""


class PathMetrics(NamedTuple):
    """Figures of a path that a robot's owner asks for, besides its length.

    `clearance`: metres from its cells to the nearest lethal cell, inf without one;
    `unknown_length`: metres through unknown cells; `turns`: changes of direction.
    """

    clearance: float
    unknown_length: float
    turns: int


class CollisionChecker:
    """Independent collision checker for final paths: `checker[rows, columns]` is blocked cells.

    It reads occupancy from the map's cells and looks distances up in a k-d tree of the lethal
    ones, which is built once, when first needed.
    """

    def __init__(self, grid_map: GridMap, config: CostmapConfig) -> None:
        """Take a map and the rules of its costmap."""
        self._cells = grid_map.cells
        self._config = config
        self._resolution = grid_map.resolution
        self._radius = config.robot_radius / grid_map.resolution
        self.shape: tuple[int, ...] = grid_map.cells.shape

    def measure(self, path: NDArray[np.int32]) -> PathMetrics:
        """Measure a path of single moves [n, 2], n > 0."""
        clearance = float(self.distances(path).min()) * self._resolution
        steps = np.diff(path, axis=0)
        turns = int((steps[1:] != steps[:-1]).any(axis=1).sum())
        # Half of a move is in each of its two cells.
        unknown = (self._cells[path[:, 1], path[:, 0]] < FREE).astype(np.float64)
        length = float(np.hypot(*steps.T) @ ((unknown[1:] + unknown[:-1]) / 2.0))
        return PathMetrics(clearance, length * self._resolution, turns)

    def prepare(self) -> None:
        """Build the tree now instead of when it is first needed."""
        _ = self._tree

    def __getitem__(
        self, places: tuple[NDArray[np.int32], NDArray[np.int32]]
    ) -> NDArray[np.bool_]:
        """Tell which of the cells at `rows, columns`, int [n] each, are blocked: bool [n]."""
        rows, columns = places
        occupancy = self._cells[rows, columns]
        blocked: NDArray[np.bool_] = occupancy >= self._config.occupied_threshold
        if not self._config.allow_unknown:
            blocked |= occupancy < FREE
        if self._radius > 0.0:
            squared = np.rint(np.square(self.distances(np.column_stack((columns, rows)))))
            blocked |= squared <= self._radius**2 + ROUNDING
        return blocked

    def distances(self, cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the distance of cells (x, y) [n, 2] to the nearest lethal one: float64 [n].

        In cells, from centre to centre; inf on a map without lethal cells.
        """
        if self._tree is None or len(cells) == 0:
            return np.full(len(cells), np.inf)
        distances, _ = self._tree.query(cells)
        distances[self._cells[cells[:, 1], cells[:, 0]] >= self._config.occupied_threshold] = 0.0
        return np.asarray(distances, dtype=np.float64)

    @cached_property
    def _tree(self) -> cKDTree | None:
        """The lethal cells with a neighbour that is not lethal: the nearest is one of them."""
        border = self._cells >= self._config.occupied_threshold
        inner = border.copy()
        inner[1:] &= border[:-1]
        inner[:-1] &= border[1:]
        inner[:, 1:] &= border[:, :-1]
        inner[:, :-1] &= border[:, 1:]
        rows, columns = np.nonzero(border & ~inner)
        if len(rows) == 0:
            return None
        points = np.column_stack((columns, rows))
        return cKDTree(points, balanced_tree=False, compact_nodes=False)


def path_problem(  # noqa: PLR0911 - one return per rule
    path: NDArray[np.int32],
    blocked: BlockedCells,
    start: Cell,
    goal: Cell,
    *,
    corner_cutting: bool,
) -> str | None:
    """Say what is wrong with a path of cells [n, 2], or None.

    It must run from start to goal, on the map, over free cells, by steps to one of the eight
    neighbours, and past no blocked corner unless `corner_cutting`.
    """
    if len(path) == 0:
        return 'it is empty'
    if tuple(path[0]) != start or tuple(path[-1]) != goal:
        return f'it runs from {cell_text(path[0])} to {cell_text(path[-1])}'
    height, width = blocked.shape
    outside = (path < 0).any(axis=1) | (path[:, 0] >= width) | (path[:, 1] >= height)
    if outside.any():
        return f'it leaves the map at {cell_text(path[outside.argmax()])}'
    on_obstacle = blocked[path[:, 1], path[:, 0]]
    if on_obstacle.any():
        return f'it hits an obstacle at {cell_text(path[on_obstacle.argmax()])}'
    steps = np.diff(path, axis=0)
    jump = np.abs(steps).max(axis=1, initial=0) != 1
    if jump.any():
        return f'it jumps after {cell_text(path[jump.argmax()])}'
    if not corner_cutting:
        before, after = path[:-1], path[1:]
        corner = blocked[before[:, 1], after[:, 0]] | blocked[after[:, 1], before[:, 0]]
        if corner.any():
            return f'it cuts a corner after {cell_text(path[corner.argmax()])}'
    return None


def via_problem(path: NDArray[np.int32], via: Sequence[Cell]) -> str | None:
    """Say which via point a path [n, 2] does not pass in their order, or None."""
    place = 0
    for number, cell in enumerate(via, start=1):
        there = (path[place:] == cell).all(axis=1)
        if not there.any():
            return f'it does not pass via {number} {cell} in its turn'
        place += int(there.argmax())
    return None


def shift_problem(name: str, requested: Cell, used: Cell, limit: float) -> str | None:
    """Say that an endpoint was moved by more than `limit` cells, or None."""
    distance = math.dist(requested, used)
    if distance <= limit * (1.0 + 1e-6):
        return None
    return (
        f'its {name} {used} is {distance:.2f} cells off {requested}, over the {limit:.2f} allowed'
    )


def segments_problem(
    points: NDArray[np.int32], blocked: BlockedCells, *, corner_cutting: bool
) -> str | None:
    """Say what is wrong with straight segments between cells [n, 2] at any angle, or None.

    Every cell that a segment passes through must be free. Where it passes exactly over a corner
    of cells, both cells at the corner's sides must be free too, unless `corner_cutting`.
    """
    for begin, end in zip(points[:-1].tolist(), points[1:].tolist()):
        cells, corners = crossed_cells(np.array(begin, float), np.array(end, float))
        hit = blocked[cells[:, 1], cells[:, 0]]
        if hit.any():
            where = cell_text(cells[hit.argmax()])
            return f'the segment from {tuple(begin)} hits an obstacle at {where}'
        if not corner_cutting and len(corners):
            sides = np.concatenate([corners[:, [0, 3]], corners[:, [2, 1]]])
            if blocked[sides[:, 1], sides[:, 0]].any():
                return f'the segment from {tuple(begin)} cuts a corner'
    return None


def crossed_cells(
    begin: NDArray[np.float64], end: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the cells [n, 2] a segment passes through, and the corners it passes exactly over.

    A corner is given as (x, y, x, y), the cells before and after it. Between two cell borders
    that the segment crosses lies one cell; two borders crossed at once are a corner. (The search
    has its own line of sight; this one is written apart from it on purpose.)
    """
    step = end - begin
    crossings = [np.array([0.0, 1.0])]
    for axis in (0, 1):
        low, high = sorted((begin[axis], end[axis]))
        if step[axis]:
            crossings.append((np.arange(low + 0.5, high) - begin[axis]) / step[axis])
    times = np.sort(np.concatenate(crossings))
    double = np.diff(times) < 1e-9
    middles = ((times[:-1] + times[1:]) / 2)[~double]
    cells = np.rint(begin + middles[:, None] * step).astype(np.int32)
    corners = begin + times[:-1][double][:, None] * step
    before = np.rint(corners - 0.5 * np.sign(step)).astype(np.int32)
    after = np.rint(corners + 0.5 * np.sign(step)).astype(np.int32)
    return cells, np.hstack([before, after])


def invalid_poses(
    cells: NDArray[np.int32], blocked: NDArray[np.bool_], first: int = 0
) -> list[int]:
    """Return the indices of a path's poses, from `first` on, that a robot cannot reach.

    `cells` is [n, 2], the cell (x, y) of each pose; poses may be any distance apart. A pose is
    invalid if it is off the map or on `blocked` [height, width], or if the straight segment that
    leads to it is. The path may come from any planner.
    """
    height, width = blocked.shape
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    invalid: NDArray[np.bool_] = np.logical_not(inside)
    invalid[inside] = blocked[cells[inside, 1], cells[inside, 0]]
    far = np.abs(np.diff(cells, axis=0)).max(axis=1, initial=0) > 1
    for index in np.flatnonzero(far[first:]) + first:
        if not (invalid[index] or invalid[index + 1]):
            segment = cells[index : index + 2]
            problem = segments_problem(segment, blocked, corner_cutting=True)
            invalid[index + 1] = problem is not None
    invalid[:first] = False
    return [int(index) for index in np.flatnonzero(invalid)]


def nearest_pose(points: NDArray[np.float64], x: float, y: float) -> int:
    """Return the index of the point [n, 2] of a path that is nearest to (x, y), n > 0."""
    return int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))


def cell_text(cell: NDArray[np.int32]) -> str:
    """Return a cell [2] as a message shows it."""
    return f'({cell[0]}, {cell[1]})'
