"""Grids made ready for fast search, and the exact A* on them.

A grid is prepared once a map (a byte of legal moves a cell) and queried often: a query borrows a
workspace, whose records carry the number of the query that wrote them, so that no query costs
work for cells it never sees. Grids and workspaces may be used from many threads at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import astar as kernels
from llm_astar_planner.search.result import Cell, SearchResult, SearchStatus

# Units of length: 3363 / 2378 is sqrt(2) to 6e-8; the second pair is for paths so long that the
# first would not fit 32 bits (over 900 thousand cells).
FINE_UNITS = (2378, 3363)
COARSE_UNITS = (70, 99)
# Nav2's SmacPlanner2D multiplies the length of a move by 1 + multiplier * cost / 252.
COST_MULTIPLIER = 2.0
_PRICE_ONE = 256
_NEVER = np.zeros(1, dtype=np.uint8)
_NO_PRICE = np.zeros(0, dtype=np.uint16)
_NO_EXPANDED = np.zeros((0, 0), dtype=np.bool_)
_NO_PATH = np.zeros((0, 2), dtype=np.int32)
_MAX_GENERATION = 2 ** (31 - kernels.TAG_BITS) - 1


class PathTooLongError(ArithmeticError):
    """A path so long, or so dear, that its cost does not fit the records of the search."""


@dataclass(frozen=True, eq=False)
class BoundedResult(SearchResult):
    """A search result with what is proven about it.

    `cost` is the path's price in cells: its length where the grid has no graded costs.
    `lower_bound` is proven to be at most the optimal cost, `suboptimality_bound` = cost /
    lower_bound is proven to be at least cost / optimum (inf without a path). `first_expansions`
    and `first_cost` tell of the first path found. `expanded` is empty [0, 0] unless it was asked
    for.
    """

    cost: float = math.inf
    lower_bound: float = 0.0
    suboptimality_bound: float = math.inf
    first_expansions: int = 0
    first_cost: float = math.inf


class Workspace:
    """What one running query writes: a record a cell, a pool of queue entries, bucket heads."""

    def __init__(self, cells: int, ring: int) -> None:
        """Make a workspace for `cells` cells and a ring of `ring` buckets."""
        self.records = np.zeros(2 * cells, dtype=np.int32)
        self.pool = np.empty(min(max(cells // 8, 256), 65536), dtype=np.int64)
        self.heads = np.zeros(ring, dtype=np.int32)
        self.control = np.zeros(kernels.A_SIZE, dtype=np.int64)
        self.path = np.empty((512, 2), dtype=np.int32)
        self.generation = 0

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        arrays = (self.records, self.pool, self.heads, self.control, self.path)
        return sum(array.nbytes for array in arrays)

    def next_generation(self) -> int:
        """Return a query number no record carries; clears the records once in 500 thousand."""
        if self.generation == _MAX_GENERATION:
            self.records[:] = 0
            self.generation = 0
        self.generation += 1
        return self.generation

    def trace(self, width: int, start: int, goal: int) -> NDArray[np.int32]:
        """Return the path the records hold between two cells: int32 [n, 2]."""
        while True:
            count, _ = kernels.trace(width, start, goal, self.records, self.path)
            if count <= len(self.path):
                return self.path[-count:].copy()
            self.path = np.empty((2 * count, 2), dtype=np.int32)

    def grow_pool(self) -> None:
        """Double the pool of queue entries, keeping what it holds."""
        pool = np.empty(2 * self.pool.size, dtype=np.int64)
        pool[: self.pool.size] = self.pool
        self.pool = pool


class GridGraph:
    """A grid ready for search.

    `blocked` is bool [height, width]. A diagonal move needs both adjacent cardinal cells free
    unless `corner_cutting`. `cost`, if given, is [height, width], 0 (none) to 100 as in an
    occupancy grid, anything below 0 counts as 0: a move of length d costs
    d * (1 + cost_multiplier * c), c being the mean of cost / 100 at its two ends. That is the
    weighting of Nav2's SmacPlanner2D, which takes the entered cell's cost alone; the mean makes
    a path cost the same both ways. Raises ValueError on a wrong shape or multiplier.
    """

    def __init__(
        self,
        blocked: ArrayLike,
        *,
        corner_cutting: bool = False,
        cost: ArrayLike | None = None,
        cost_multiplier: float = COST_MULTIPLIER,
    ) -> None:
        """Prepare the moves of every cell: O(cells), once a map."""
        grid = np.ascontiguousarray(blocked, dtype=np.bool_)
        if grid.ndim != 2 or grid.size == 0:
            raise ValueError(f'blocked: shape {grid.shape} is not [height, width]')
        self.blocked: NDArray[np.bool_] = grid
        self.height, self.width = grid.shape
        self.corner_cutting = corner_cutting
        self.price = _NO_PRICE if cost is None else _prices(cost, grid.shape, cost_multiplier)
        self.straight, self.diagonal = FINE_UNITS
        self.moves = np.empty(grid.size, dtype=np.uint8)
        kernels.build_moves(grid, corner_cutting, self.moves)
        dearest = _PRICE_ONE + (int(self.price.max()) if self.price.size else 0)
        # A move raises f by at most its own cost and what the estimate rises, one diagonal.
        reach = self.diagonal * dearest // _PRICE_ONE + self.diagonal
        self.ring = 1 << ((reach >> kernels.BUCKET_BITS) + 2).bit_length()
        self._spare: list[Workspace] = []
        self._coarse: GridGraph | None = None

    @property
    def nbytes(self) -> int:
        """Bytes held by the grid and its idle workspaces; not `blocked`, which may be shared."""
        coarse = 0 if self._coarse is None else sum(one.nbytes for one in self._coarse._spare)
        idle = sum(workspace.nbytes for workspace in list(self._spare))
        return self.moves.nbytes + self.price.nbytes + idle + coarse

    def index(self, cell: Cell) -> int:
        """Return the number of a cell. Raises ValueError where it is off the grid."""
        x, y = cell
        if 0 <= x < self.width and 0 <= y < self.height:
            return int(y) * self.width + int(x)
        raise ValueError(f'cell ({x}, {y}) is off a grid of {self.width} x {self.height}')

    @contextmanager
    def workspace(self) -> Iterator[Workspace]:
        """Lend a workspace for one query, a new one where all are out."""
        workspace = self.borrow()
        try:
            yield workspace
        finally:
            self.give_back(workspace)

    def borrow(self) -> Workspace:
        """Take a workspace; hand it back with `give_back`."""
        try:
            return self._spare.pop()
        except IndexError:
            return Workspace(self.moves.size, self.ring)

    def give_back(self, workspace: Workspace) -> None:
        """Return a workspace that no kernel uses any more."""
        self._spare.append(workspace)

    def coarse(self) -> GridGraph:
        """Return the same grid in coarser units, for paths too long for the fine ones."""
        if self._coarse is None:
            grid = object.__new__(GridGraph)
            grid.__dict__.update(self.__dict__)
            grid.straight, grid.diagonal = COARSE_UNITS
            grid._spare = []
            grid._coarse = grid
            self._coarse = grid
        return self._coarse


def as_grid(grid: GridGraph | ArrayLike, *, corner_cutting: bool = False) -> GridGraph:
    """Return a prepared grid: the one given, or one made of a bool array of blocked cells."""
    if isinstance(grid, GridGraph):
        return grid
    return GridGraph(grid, corner_cutting=corner_cutting)


def path_length(path: NDArray[np.int32]) -> float:
    """Return the length in cells of a path [n, 2] of single moves."""
    moves = np.abs(np.diff(path, axis=0)).sum(axis=1)
    diagonals = int((moves == 2).sum())
    return len(path) - 1 - diagonals + diagonals * math.sqrt(2.0) if len(path) else math.nan


def path_units(grid: GridGraph, path: NDArray[np.int32]) -> int:
    """Return the price of a path [n, 2] of single moves, in the grid's units."""
    diagonal = np.abs(np.diff(path, axis=0)).sum(axis=1) == 2
    lengths = np.where(diagonal, grid.diagonal, grid.straight).astype(np.int64)
    if grid.price.size:
        prices = grid.price[path[:, 1].astype(np.int64) * grid.width + path[:, 0]].astype(np.int64)
        lengths += lengths * (prices[:-1] + prices[1:]) >> 9
    return int(lengths.sum())


def exact_astar(
    blocked: GridGraph | NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    *,
    corner_cutting: bool = False,
    stop: NDArray[np.uint8] | None = None,
    want_expanded: bool = True,
    every_move: bool = False,
) -> BoundedResult:
    """Find a cheapest path with A* (octile, ties to larger g, no stale pops).

    `blocked` is a prepared grid, or bool [height, width], which is prepared first. `stop`, one
    byte, ends the search when another thread sets it: STOPPED, with the path found so far if
    any. `every_move` also tries the moves that uniform costs make pointless, as a textbook A*
    does: as many expansions, more states stored. Exact to 6e-8 of the length. Raises ValueError
    for a cell off the grid and PathTooLongError beyond 30 million cells.
    """
    grid = as_grid(blocked, corner_cutting=corner_cutting)
    with grid.workspace() as workspace:
        result = _run_exact(
            grid,
            workspace,
            start,
            goal,
            stop=stop,
            want_expanded=want_expanded,
            every_move=every_move,
        )
    if result is not None:
        return result
    if grid.coarse() is grid:
        raise PathTooLongError(f'the cost of a path from {start} to {goal} does not fit')
    return exact_astar(
        grid.coarse(),
        start,
        goal,
        stop=stop,
        want_expanded=want_expanded,
        every_move=every_move,
    )


def shortest_path(
    grid: GridGraph, start: Cell, goal: Cell, *, stop: NDArray[np.uint8] | None = None
) -> tuple[NDArray[np.int32], float]:
    """Return a cheapest path, int32 [n, 2], and its cost in cells; empty and inf if none.

    `exact_astar` without the accounts: for callers to whom a microsecond matters. Raises as it
    does, and InterruptedError where `stop` was raised.
    """
    first, last = grid.index(start), grid.index(goal)
    if first == last and grid.blocked[start[1], start[0]]:
        return _NO_PATH, math.inf
    workspace = grid.borrow()
    status, count, _, units = _solve(grid, workspace, first, last, stop=stop)
    if status == kernels.FOUND:
        if count <= len(workspace.path):
            path = workspace.path[-count:].copy()
        else:
            path = workspace.trace(grid.width, first, last)
        grid.give_back(workspace)
        return path, units / grid.straight
    grid.give_back(workspace)
    if status == kernels.OVERFLOW:
        result = exact_astar(grid, start, goal, stop=stop, want_expanded=False)
        return result.path, result.cost
    if status == kernels.STOPPED:
        raise InterruptedError('the search was stopped')
    return _NO_PATH, math.inf


def _solve(
    grid: GridGraph,
    workspace: Workspace,
    first: int,
    last: int,
    *,
    stop: NDArray[np.uint8] | None = None,
    every_move: bool = False,
) -> tuple[int, int, int, int]:
    """Run A* to its end: how it ended, the path's cells, diagonal moves and cost in units."""
    generation = workspace.next_generation()
    workspace.control[kernels.A_STARTED] = 0
    flag = _NEVER if stop is None else stop
    every_move = every_move or grid.price.size > 0
    while True:
        ended: tuple[int, int, int, int] = kernels.solve(
            grid.moves,
            grid.price,
            grid.width,
            grid.straight,
            grid.diagonal,
            first,
            last,
            every_move,
            generation,
            workspace.records,
            workspace.pool,
            workspace.heads,
            workspace.control,
            flag,
            workspace.path,
        )
        if ended[0] != kernels.NEED_SPACE:
            return ended
        workspace.grow_pool()


def _run_exact(
    grid: GridGraph,
    workspace: Workspace,
    start: Cell,
    goal: Cell,
    *,
    stop: NDArray[np.uint8] | None,
    want_expanded: bool,
    every_move: bool,
) -> BoundedResult | None:
    first, last = grid.index(start), grid.index(goal)
    if grid.blocked[start[1], start[0]] or grid.blocked[goal[1], goal[0]]:
        return BoundedResult(SearchStatus.EXHAUSTED, 0, 0, np.zeros_like(grid.blocked))
    status, count, diagonals, units = _solve(
        grid, workspace, first, last, stop=stop, every_move=every_move
    )
    control = workspace.control
    if status == kernels.OVERFLOW:
        return None
    expanded: NDArray[np.bool_] = _NO_EXPANDED
    if want_expanded:
        expanded = np.zeros(grid.blocked.shape, dtype=np.bool_)
        kernels.add_expanded(workspace.records, workspace.generation, expanded)
    expansions, storage = int(control[kernels.A_OPERATION]), int(control[kernels.A_STORAGE])
    floor = int(control[kernels.A_BUCKET]) << kernels.BUCKET_BITS
    if count == 0:
        return BoundedResult(_STATUS[status], expansions, storage, expanded)
    bound = units if status == kernels.FOUND else min(units, floor)
    return BoundedResult(
        _STATUS[status],
        expansions,
        storage,
        expanded,
        (
            workspace.path[-count:].copy()
            if count <= len(workspace.path)
            else workspace.trace(grid.width, first, last)
        ),
        count - 1 - diagonals + diagonals * math.sqrt(2.0),
        cost=units / grid.straight,
        lower_bound=bound / grid.straight,
        suboptimality_bound=units / bound if bound else 1.0,
        first_expansions=expansions,
        first_cost=units / grid.straight,
    )


_STATUS = {
    kernels.FOUND: SearchStatus.FOUND,
    kernels.EXHAUSTED: SearchStatus.EXHAUSTED,
    kernels.STOPPED: SearchStatus.STOPPED,
}


def _prices(cost: ArrayLike, shape: tuple[int, ...], cost_multiplier: float) -> NDArray[np.uint16]:
    """Turn costs 0 to 100 into surcharges a cell, in 1/256 of a move's length."""
    values = np.asarray(cost)
    if values.shape != shape:
        raise ValueError(f'cost: shape {values.shape} is not that of the grid, {shape}')
    if not 0.0 <= cost_multiplier <= 255.0:
        raise ValueError(f'cost_multiplier: {cost_multiplier} is not in 0 to 255')
    if values.dtype != np.int8:
        return _surcharges(values, cost_multiplier).reshape(-1)
    # Occupancy has few values: looking them up spares large maps several arrays of floats.
    every_value = np.arange(256, dtype=np.uint8).view(np.int8)
    table = _surcharges(every_value, cost_multiplier)
    return table[values.view(np.uint8)].reshape(-1)


def _surcharges(cost: NDArray[Any], cost_multiplier: float) -> NDArray[np.uint16]:
    shares = np.clip(np.nan_to_num(cost.astype(np.float64)), 0.0, 100.0) / 100.0
    return np.rint(shares * cost_multiplier * _PRICE_ONE).astype(np.uint16)
