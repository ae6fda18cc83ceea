# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Occupancy grids prepared for fast repeated search.

A grid is prepared once per map (one byte of legal moves per cell) and then searched many times.
Each query borrows a workspace whose records carry the number of the query that wrote them, so
a query clears nothing and does no work for cells that it never reaches. Grids and workspaces may
be used from many threads at once.
"""

from __future__ import annotations

import copy
import math
import weakref
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import astar as kernels
from llm_astar_planner.search._kernels import jump as jump_kernels
from llm_astar_planner.search.arrays import (
    Bools,
    DoubleBuffer,
    Float64s,
    Int8s,
    Int32s,
    Int64s,
    Uint8s,
    Uint16s,
)
from llm_astar_planner.search.result import Cell

# Units of length, (straight, diagonal): 3363 / 2378 is sqrt(2) to 5e-8. The coarse pair is for
# paths so long that the fine one would not fit 32 bits (over 900 thousand cells).
FINE_UNITS = (2378, 3363)
COARSE_UNITS = (70, 99)
# Nav2's SmacPlanner2D multiplies the length of a move by 1 + multiplier * cost / 252.
COST_MULTIPLIER = 2.0
# A surcharge of 1, which doubles the cost of a move, as `GridGraph.cell_surcharge` stores it.
SURCHARGE_ONE = 256
# Idle workspaces kept, in bytes; two are always kept, which is what one guided search takes.
IDLE_BYTES = 64 * 1024 * 1024
MAX_GENERATION = 2 ** (31 - kernels.TAG_BITS) - 1
# The moves in the order of their bits in `GridGraph.moves`, (x, y).
STEPS = tuple(zip(kernels.STEP_X.tolist(), kernels.STEP_Y.tolist()))


class Workspace:
    """What one running query writes: a record per cell, a pool of queue entries, bucket heads."""

    def __init__(self, cells: int, ring: int) -> None:
        """Make a workspace for `cells` cells and a ring of `ring` buckets."""
        self.records = np.zeros(2 * cells, dtype=np.int32)
        self.pool = np.empty(min(max(cells // 8, 256), 65536), dtype=np.int64)
        # The key of each entry of the pool, for searches that are not led by f alone.
        self.keys = np.empty(self.pool.size, dtype=np.int64)
        self.heads = np.zeros(ring, dtype=np.int32)
        size = max(kernels.A_SIZE, jump_kernels.J_SIZE)
        self.control = np.zeros(size, dtype=np.int64)
        self.generation = 0

    def grow_pool(self) -> None:
        """Double the pool of queue entries and keep its content."""
        self.pool = np.concatenate((self.pool, np.empty_like(self.pool)))
        self.keys = np.concatenate((self.keys, np.empty_like(self.keys)))


@dataclass(frozen=True, eq=False)
class PackedGrid:
    """Where a map is blocked and where scans stop, as bits along rows and columns.

    Immutable; about a byte a cell. `blocked_cells` and `jump_points` count; a jump point counts
    once for each of the four directions in which a scan stops there.
    """

    words: Int64s
    blocked_cells: int
    jump_points: int

    @classmethod
    def build(cls, blocked: Bools) -> PackedGrid:
        """Pack bool [height, width]: a millisecond per million cells."""
        height, width = blocked.shape
        groups = (height + 2) * ((width + 65) // 64) + (width + 2) * ((height + 65) // 64)
        # A map whose cells are all blocked, with a group more at either end, is updated.
        words = np.full(jump_kernels.PLANES * (groups + 2), -1, dtype=np.int64)
        return cls(words, blocked.size, 0).updated(blocked, whole(blocked.shape))

    def updated(self, blocked: Bools, windows: Int64s) -> PackedGrid:
        """Return the packed form of `blocked`, which differs in `windows` only.

        `windows` is int [n, 4]: top, bottom, left, right in cells, half open.
        """
        words, count, jump_points = self.words.copy(), self.blocked_cells, self.jump_points
        height, width = blocked.shape
        columns = jump_kernels.PLANES * (1 + (height + 2) * ((width + 65) // 64))
        for top, bottom, left, right in windows.tolist():
            if top < bottom and left < right:
                more, jumps = jump_kernels.pack_window(
                    blocked, words, jump_kernels.PLANES, (top, bottom, left, right)
                )
                count, jump_points = count + more, jump_points + jumps
                across = (left, right, top, bottom)
                _, jumps = jump_kernels.pack_window(blocked.T, words, columns, across)
                jump_points += jumps
        return PackedGrid(words, count, jump_points)


class GridGraph:
    """An 8-connected grid prepared for search.

    `blocked` is bool [height, width]. A diagonal move needs both adjacent cardinal cells free
    unless `corner_cutting`. `cost`, if given, is [height, width], 0 (none) to 100 as in an
    occupancy grid; values below 0, unknown, count as `unknown_cost`. A move of length d costs
    d * (1 + cost_multiplier * c), where c is the mean of cost / 100 at its two ends. Nav2's
    SmacPlanner2D takes the cost of the entered cell alone; with the mean a path costs the same
    in both directions. Raises ValueError on a wrong shape or multiplier.
    """

    def __init__(
        self,
        blocked: ArrayLike,
        *,
        corner_cutting: bool = False,
        cost: ArrayLike | None = None,
        cost_multiplier: float = COST_MULTIPLIER,
        unknown_cost: int = 0,
    ) -> None:
        """Prepare the moves of every cell: O(cells), once per map."""
        grid = np.ascontiguousarray(blocked, dtype=np.bool_)
        if grid.ndim != 2 or grid.size == 0:
            raise ValueError(f'blocked: shape {grid.shape} is not [height, width]')
        self.blocked: Bools = grid
        self.height, self.width = grid.shape
        self.corner_cutting = corner_cutting
        # The surcharge of each cell, uint16 [cells], in 1/256; empty without graded costs.
        self.cell_surcharge: Uint16s = np.zeros(0, dtype=np.uint16)
        self.cost = None if cost is None else np.asarray(cost)
        self.cost_multiplier = cost_multiplier
        self.unknown_cost = unknown_cost
        if cost is not None:
            self.cell_surcharge = cell_surcharges(cost, grid.shape, cost_multiplier, unknown_cost)
        self.moves = np.empty(grid.size, dtype=np.uint8)
        kernels.build_moves(grid, corner_cutting, whole(grid.shape), self.moves)
        self.set_units(*FINE_UNITS)
        self.ring = self._ring()
        self._spare: list[Workspace] = []
        self._coarse: GridGraph | None = None
        # Whether rules of the road forbid moves, and the graph without them, None for this one.
        self.has_rules, self._free = False, cast('GridGraph | None', None)
        # The graph that this one was updated from, and the windows in which they differ.
        self._before: tuple[weakref.ref[GridGraph], Int64s] | None = None

    def updated(
        self,
        blocked: Bools,
        cost: Int8s | None,
        windows: Int64s,
        buffer: DoubleBuffer | None = None,
    ) -> GridGraph:
        """Return the graph of a map of the same size that differs from this one in windows.

        `windows` is int64 [n, 4], (top, bottom, left, right) half open: `blocked`, `cost` and the
        moves, which depend on neighbours, are as before in all other cells. `blocked` and `cost`
        are [height, width]; without `cost`, as without it in the constructor, costs are uniform.
        `buffer` is that of a series of maps. This graph stays valid. Both share their idle
        workspaces where these fit both.
        """
        grid, buffer, shape = copy.copy(self), buffer or DoubleBuffer(), (self.height, self.width)
        grid.blocked, grid.cost = blocked, cost
        grid._before = weakref.ref(self), windows
        grid.moves = buffer.copy('moves', self.moves, windows, shape)
        kernels.build_moves(blocked, self.corner_cutting, windows, grid.moves)
        if cost is None:
            grid.cell_surcharge = np.zeros(0, dtype=np.uint16)
        elif self.cell_surcharge.size == 0:
            rules = self.cost_multiplier, self.unknown_cost
            grid.cell_surcharge = cell_surcharges(cost, blocked.shape, *rules)
        else:
            grid.cell_surcharge = buffer.copy(
                'cell_surcharge', self.cell_surcharge, windows, shape
            )
            table = surcharge_table(self.cost_multiplier, self.unknown_cost)
            kernels.fill_surcharges(cost, table, windows, grid.cell_surcharge)
        grid.set_units(self.straight, self.diagonal)
        grid.ring = grid._ring()
        if grid.ring != self.ring:
            grid._spare = []
        grid._coarse = None
        if 'packed' in vars(self):
            grid.packed = self.packed.updated(blocked, windows)
        return grid

    def changes_since(self, before: GridGraph | None) -> Int64s | None:
        """Return the windows in which this graph differs from that it was updated from.

        None if `before` is not that graph.
        """
        if before is None or self._before is None or self._before[0]() is not before:
            return None
        return self._before[1]

    def with_rules(self, forbidden: Uint8s) -> GridGraph:
        """Return the graph without the moves that rules of the road forbid.

        `forbidden` is uint8 [height, width], bits as in `moves`, or empty for no rules.
        """
        if not forbidden.size:
            return self
        grid = copy.copy(self)
        grid.has_rules, grid._free, grid._coarse = True, self, None
        grid.moves = self.moves & ~forbidden.reshape(-1)
        grid.set_units(self.straight, self.diagonal)
        return grid

    @property
    def without_rules(self) -> GridGraph:
        """The graph in which each move can be made back too; no path costs less than here."""
        return self._free or self

    def reach(self, cell: Cell) -> Bools:
        """Return the cells that moves lead to from a cell (x, y): bool [height, width]."""
        reached: Bools = kernels.reach(self.moves, self.width, self.index(cell))
        return reached.reshape(self.blocked.shape)

    def set_units(self, straight: int, diagonal: int) -> None:
        """Set the units of length, and what searches take that depends on them."""
        self.straight, self.diagonal = straight, diagonal
        # The cells as the compiled loops take them.
        self.cells = kernels.Cells(self.moves, self.cell_surcharge, self.width, straight, diagonal)
        # How many times its units the exact cost of a path may be: 1 on uniform costs. Prices are
        # rounded down to 1/256, and the price of a move to a unit.
        self.rounding = 1.0
        if self.cell_surcharge.size:
            diagonals = diagonal / (straight * math.sqrt(2.0))
            self.rounding = (1.0 + 1.0 / SURCHARGE_ONE) * (1.0 + 1.0 / (straight - 1)) * diagonals

    def _ring(self) -> int:
        """Return the number of buckets that a search's queue needs, a power of two."""
        # The same for all maps with graded costs, so that they can share workspaces.
        highest = SURCHARGE_ONE
        if self.cell_surcharge.size:
            highest += round(self.cost_multiplier * SURCHARGE_ONE)
        # A move raises f by at most its own cost and the rise of the estimate, its cost as well.
        reach = 2 * self.diagonal * highest // SURCHARGE_ONE
        return 1 << ((reach >> kernels.BUCKET_BITS) + 2).bit_length()

    @cached_property
    def packed(self) -> PackedGrid:
        """The map as bits for `jump_search`, packed at the first use."""
        return PackedGrid.build(self.blocked)

    def index(self, cell: Cell) -> int:
        """Return the number of a cell. Raises ValueError if it is off the grid."""
        x, y = cell
        if 0 <= x < self.width and 0 <= y < self.height:
            return int(y) * self.width + int(x)
        raise ValueError(f'cell ({x}, {y}) is off a grid of {self.width} x {self.height}')

    def proven(
        self, path: Int32s, units: float, bound: float, cost: float | None = None
    ) -> tuple[float, float, float]:
        """Return a path's cost and its lower bound, in cells, and their ratio, at least 1.

        `units` is the cost of the path in units and `bound` what no path costs less than. With
        graded costs the `cost` is computed exactly if it is not known, and the bound holds for
        exact costs, too, since units are rounded down; only their diagonal moves are longer, by
        5e-8, than exact ones.
        """
        bound = min(bound, units)
        if not self.cell_surcharge.size:
            ratio = max(1.0, units / bound) if bound > 0 else 1.0
            return units / self.straight, bound / self.straight, ratio
        cost = path_cost(self, path) if cost is None else cost
        lower_bound = min(cost, bound / self.diagonal * math.sqrt(2.0))
        return cost, lower_bound, cost / lower_bound if lower_bound > 0.0 else 1.0

    def octile(self, cell: Cell, other: Cell) -> int:
        """Return the octile distance between two cells in units: the least a path can cost."""
        deltas = abs(cell[0] - other[0]), abs(cell[1] - other[1])
        return self.straight * max(deltas) + (self.diagonal - self.straight) * min(deltas)

    def borrow(self) -> Workspace:
        """Take a workspace, of a query number that no record carries; see `give_back`."""
        try:
            workspace = self._spare.pop()
        except IndexError:
            workspace = Workspace(self.moves.size, self.ring)
        if workspace.generation == MAX_GENERATION:  # once in 500 thousand queries
            workspace.records[:] = 0
            workspace.generation = 0
        workspace.generation += 1
        return workspace

    def give_back(self, workspace: Workspace) -> None:
        """Return a workspace that no kernel uses any more."""
        if len(self._spare) < max(2, IDLE_BYTES // workspace.records.nbytes):
            self._spare.append(workspace)

    def coarse(self) -> GridGraph:
        """Return the same grid in coarser units, for paths too long for the fine ones."""
        if self._coarse is None:
            grid = copy.copy(self)
            grid.set_units(*COARSE_UNITS)
            grid._spare = []
            grid._coarse = grid
            self._coarse = grid
        return self._coarse


def traced(trace: Any, *found: Any) -> tuple[Int32s, tuple[int, ...]]:  # noqa: ANN401
    """Return a path, int32 [n, 2], that the kernel `trace` writes, and what else it counts.

    A kernel writes to the end of an array as many cells as fit; it returns how many there are.
    """
    path = np.empty((8192, 2), dtype=np.int32)
    counts = trace(*found, path)
    if counts[0] > len(path):
        path = np.empty((counts[0], 2), dtype=np.int32)
        trace(*found, path)
    return path[-counts[0] :].copy(), counts[1:]


def path_length(path: Int32s) -> float:
    """Return the length in cells of a path [n, 2] of single moves, NaN for an empty one."""
    moves = np.abs(np.diff(path, axis=0)).sum(axis=1)
    diagonals = int((moves == 2).sum())
    return len(path) - 1 - diagonals + diagonals * math.sqrt(2.0) if len(path) else math.nan


def path_cost(grid: GridGraph, path: Int32s) -> float:
    """Return the cost of a path [n, 2] of single moves in cells, not rounded but as a float."""
    if grid.cost is None:
        return path_length(path)
    shares = shares_of(grid.cost[path[:, 1], path[:, 0]], grid.unknown_cost)
    costs = 1.0 + (shares[:-1] + shares[1:]) * (grid.cost_multiplier / 2.0)
    steps = path[1:] != path[:-1]
    diagonals = costs[steps[:, 0] & steps[:, 1]]
    return float(costs.sum() + (math.sqrt(2.0) - 1.0) * diagonals.sum())


def cell_surcharges(
    cost: ArrayLike, shape: tuple[int, ...], cost_multiplier: float, unknown_cost: int
) -> Uint16s:
    """Turn costs 0 to 100 into surcharges, uint16 [cells], in 1/256 of the length of a move.

    Costs below 0 count as `unknown_cost`. Raises ValueError for costs of another `shape` than the
    grid's or a multiplier out of range.
    """
    values = np.asarray(cost)
    if values.shape != shape:
        raise ValueError(f'cost: shape {values.shape} is not that of the grid, {shape}')
    if not 0.0 <= cost_multiplier <= 255.0:
        raise ValueError(f'cost_multiplier: {cost_multiplier} is not in 0 to 255')

    if values.dtype != np.int8:
        return surcharges_of(values, cost_multiplier, unknown_cost).reshape(-1)
    surcharges = np.empty(values.size, dtype=np.uint16)
    table = surcharge_table(cost_multiplier, unknown_cost)
    kernels.fill_surcharges(values, table, whole(shape), surcharges)
    return surcharges


def surcharge_table(cost_multiplier: float, unknown_cost: int) -> Uint16s:
    """Return the surcharge of each occupancy, uint16 [256], by its byte.

    Occupancy has only 256 values: a table of them saves several float arrays on large maps.
    """
    occupancies = np.arange(256, dtype=np.uint8).view(np.int8)
    return surcharges_of(occupancies, cost_multiplier, unknown_cost)


def surcharges_of(costs: NDArray[Any], cost_multiplier: float, unknown_cost: int) -> Uint16s:
    """Turn costs 0 to 100 into surcharges, of the same shape, in 1/256 of a move's length."""
    shares = shares_of(costs, unknown_cost)
    # Rounded down: what is proven with these prices holds for the exact ones.
    return np.floor(shares * cost_multiplier * SURCHARGE_ONE).astype(np.uint16)


def shares_of(costs: NDArray[Any], unknown_cost: int) -> Float64s:
    """Turn costs 0 to 100 into 0 to 1; those below 0 count as `unknown_cost`."""
    known = np.where(costs < 0, unknown_cost, costs.astype(np.float64))
    # Of a number and NaN, which counts as 0, fmax returns the number.
    return np.asarray(np.minimum(np.fmax(known, 0.0), 100.0) / 100.0)


def whole(shape: tuple[int, ...]) -> Int64s:
    """Return one window over all cells of a grid: int64 [1, 4]."""
    return np.array([[0, shape[0], 0, shape[1]]], dtype=np.int64)
