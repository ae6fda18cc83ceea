# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Exact searches on a grid: A*, and jump points where costs are uniform.

A* has the octile or landmark estimate, ties to larger g, and a queue of buckets. For jump points
see Harabor and Grastien, "Improving jump point search", ICAPS 2014, for grids without corner
cutting: of the many equally short paths only those that make their diagonal moves first are
searched, and only the cells beside which an obstacle has just ended are queued. The cells between
are skipped by looking for set bits in words of 64 cells.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError

from llm_astar_planner.search._kernels import astar as kernels
from llm_astar_planner.search._kernels import jump as jump_kernels
from llm_astar_planner.search.arrays import Bools, Int32s
from llm_astar_planner.search.grid_graph import GridGraph, traced
from llm_astar_planner.search.landmarks import NO_DISTANCES, NONE_ACTIVE, Landmarks
from llm_astar_planner.search.problem import SearchProblem, search_method
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus

# Expansions between two looks at the stop flag and the clock: about half a millisecond.
EXPANSION_SLICE = 16384
# How a search ended, by what its kernel returns; the other codes say how to go on.
ENDED = {
    kernels.FOUND: SearchStatus.FOUND,
    kernels.EXHAUSTED: SearchStatus.EXHAUSTED,
    kernels.STOPPED: SearchStatus.STOPPED,
}


class PathTooLongError(LlmAstarError, ArithmeticError):
    """A path whose cost is too large for the 32-bit records of the search."""


class SlicedSearch:
    """A search that runs in slices on a borrowed workspace; give that back at its end.

    `best` is the cost in units of the best path known, NO_PATH without one. `work` is what has
    been done in the unit of a quota.
    """

    def __init__(self, grid: GridGraph, start: Cell, goal: Cell) -> None:
        """Take the query; nothing is searched yet. Raises ValueError for a cell off the grid."""
        self.grid, self._cells = grid, grid.cells
        self.start, self.goal = grid.index(start), grid.index(goal)
        self.best = kernels.NO_PATH
        self.work = self.expansions = self.storage = 0
        self.status: SearchStatus | None = None
        self.workspace = grid.borrow()
        self.generation = self.workspace.generation

    def advance(self, quota: int) -> None:
        """Search for up to `quota` units of work; set `status` if that ends the search.

        Raises OverflowError where the cost of a path does not fit the records.
        """
        raise NotImplementedError

    def note(self, ended: int) -> None:
        """Note how a call of the kernel ended; give it more space. Raises OverflowError."""
        if ended == kernels.NEED_SPACE:
            self.workspace.grow_pool()
        elif ended == kernels.OVERFLOW:
            raise OverflowError
        self.status = ENDED.get(ended)

    def path(self) -> tuple[Int32s, float, int]:
        """Return the path that the records hold, its length in cells and its cost in units."""
        path, (diagonals, units) = traced(
            kernels.trace, self._cells, self.start, self.goal, self.workspace.records
        )
        return path, len(path) - 1 - diagonals + diagonals * math.sqrt(2.0), units

    def add_expanded(self, expanded: Bools) -> None:
        """Set `expanded` [height, width] where this search has expanded a cell."""
        kernels.add_expanded(self.workspace.records, self.generation, expanded)


class PlainSearch(SlicedSearch):
    """An exact A*.

    `bound` is a lower bound on the cost of every path in units; it is `best` at the end. A quota
    counts expansions.
    """

    # The place of `best` in the control array of the kernel.
    BEST_SLOT = kernels.A_BEST

    def __init__(
        self,
        grid: GridGraph,
        start: Cell,
        goal: Cell,
        landmarks: Landmarks | None = None,
        *,
        every_move: bool = False,
    ) -> None:
        """Take the query; nothing is searched yet. Raises ValueError for a cell off the grid."""
        super().__init__(grid, start, goal)
        self.bound = grid.octile(start, goal)
        self.distances, self.active = NO_DISTANCES, NONE_ACTIVE
        if landmarks is not None:
            self.distances = landmarks.distances
            self.active, self.bound = landmarks.active(self.start, self.goal, self.bound)
        # A free goal that no move leaves cannot be entered either.
        free = grid.without_rules if grid.has_rules else grid
        enclosed = self.start != self.goal and not free.moves[self.goal]
        is_blocked = grid.blocked[start[1], start[0]] or grid.blocked[goal[1], goal[0]]
        if enclosed or is_blocked or self.bound == kernels.NO_PATH:
            self.status = SearchStatus.EXHAUSTED
        self._successors = 0
        if every_move or grid.cell_surcharge.size or grid.has_rules:
            # Which moves are pointless is known where each can be made back.
            self._successors = kernels.EVERY_MOVE if grid.has_rules else kernels.FORWARD
        self._control = self.workspace.control
        self._control[:] = 0
        self._control[self.BEST_SLOT] = kernels.NO_PATH

    def advance(self, quota: int) -> None:
        """Expand up to `quota` cells; see `SlicedSearch.advance`."""
        workspace, control = self.workspace, self._control
        ended = kernels.astar(
            self._cells, self.start, self.goal, self._successors, self.distances, self.active,
            self.generation, workspace.records, workspace.pool, workspace.heads, control,
            quota,
        )  # fmt: skip
        _, base, bucket, self.best, self.expansions, self.storage, *_ = control.tolist()
        self.work = self.expansions
        self.bound = max(self.bound, min(base + (bucket << kernels.BUCKET_BITS), self.best))
        if ended == kernels.FOUND:
            self.bound = self.best
        self.note(ended)

    def learn(self, best: int, bound: int = 0) -> None:
        """Take over what another search knows: a path of cost `best`, a lower bound; in units.

        Only paths that cost less than `best` are looked for from now on.
        """
        self.best = min(self.best, best)
        self._control[self.BEST_SLOT] = self.best
        self.bound = max(self.bound, bound)


def problem_of(
    blocked: GridGraph | Bools, start: Cell, goal: Cell, options: dict[str, Any]
) -> SearchProblem:
    """Return a problem with `options` as its other fields, on a grid or an array of blocked cells.

    Of an array a `GridGraph` is made with the rest of the options.
    """
    given = {name: options[name] for name in options if name in SearchProblem.__dataclass_fields__}
    if not isinstance(blocked, GridGraph):
        others = {name: value for name, value in options.items() if name not in given}
        blocked = GridGraph(blocked, **others)
    return SearchProblem(blocked, start, goal, **given)


def exact_astar(
    blocked: GridGraph | Bools,
    start: Cell,
    goal: Cell,
    *,
    every_move: bool = False,
    **options: Any,  # noqa: ANN401 - fields of a SearchProblem
) -> BoundedResult:
    """Find a cheapest path with A*; on uniform costs exact to 5e-8 of the length.

    `blocked` is a prepared grid, or bool [height, width], which is prepared first. `options` are
    fields of the `SearchProblem`, such as `stop`, `deadline` and `landmarks`, and those of a
    `GridGraph` to be prepared. `every_move` also tries the moves that uniform costs make
    pointless, as a textbook A* does: about as many expansions, more states stored. Raises
    ValueError for a cell off the grid and PathTooLongError beyond 30 million cells.
    """
    return solve(problem_of(blocked, start, goal, options), every_move=every_move)


def solve(problem: SearchProblem, *, every_move: bool = False) -> BoundedResult:
    """Solve a problem by A*, in coarser units where a path is too long for the fine ones."""
    grid, start, goal = problem.grid, problem.start, problem.goal
    try:
        search = PlainSearch(grid, start, goal, problem.landmarks, every_move=every_move)
        return complete(search, problem)
    except OverflowError:
        if grid.coarse() is grid:
            message = f'the cost of a path from {start} to {goal} does not fit'
            raise PathTooLongError(message) from None
    coarse = replace(problem, grid=grid.coarse(), landmarks=None)
    return solve(coarse, every_move=every_move)


@search_method()
def exact_method(problem: SearchProblem) -> BoundedResult:
    """Search by A*, without landmarks."""
    return solve(replace(problem, landmarks=None))


def complete(search: PlainSearch, problem: SearchProblem) -> BoundedResult:
    """Run a search to its end, or until it is stopped, and close it; return what it proves.

    Raises OverflowError.
    """
    without_path = max(problem.deadline, problem.first_path_deadline)
    try:
        while search.status is None and not problem.stop[0]:
            has_path = search.best < kernels.NO_PATH
            if time.monotonic() >= (problem.deadline if has_path else without_path):
                break
            search.advance(EXPANSION_SLICE)
        return make_result(search, want_expanded=problem.want_expanded)
    finally:
        search.grid.give_back(search.workspace)


def make_result(search: PlainSearch, *, want_expanded: bool) -> BoundedResult:
    """Describe how a search ended: the path, the counts and what they prove."""
    grid, status = search.grid, search.status or SearchStatus.STOPPED
    expanded = np.zeros(grid.blocked.shape if want_expanded else (0, 0), dtype=np.bool_)
    if want_expanded:
        search.add_expanded(expanded)
    counts = search.expansions, search.storage
    if search.best == kernels.NO_PATH:
        return BoundedResult(status, *counts, expanded)
    path, length, units = search.path()
    proven = grid.proven(path, units, search.bound)
    return BoundedResult(status, *counts, expanded, path, length, *proven, counts[0], proven[0])


class JumpSearch(PlainSearch):
    """An exact jump point search that runs in slices.

    For grids of uniform costs without corner cutting. `expansions` counts the jump points taken
    from the queue.
    """

    BEST_SLOT = jump_kernels.J_BEST

    def __init__(
        self, grid: GridGraph, start: Cell, goal: Cell, landmarks: Landmarks | None = None
    ) -> None:
        """Take the query. Raises ValueError for a cell off the grid or another kind of grid."""
        if grid.cell_surcharge.size or grid.corner_cutting:
            raise ValueError('a jump point search needs uniform costs and no corner cutting')
        super().__init__(grid, start, goal, landmarks)
        self._heads = np.empty(jump_kernels.BUCKETS, dtype=np.int32)
        self._found = 0

    def advance(self, quota: int) -> None:
        """Scan at least `quota` times; see `PlainSearch.advance`."""
        workspace, control = self.workspace, self._control
        ended = jump_kernels.jump_search(
            self._cells, self.grid.packed.words,
            self.start, self.goal, self.distances, self.active, self.generation,
            workspace.records, workspace.pool, self._heads, control, quota,
        )  # fmt: skip
        _, origin, bucket, self.best, self.expansions, *others = control.tolist()
        self.storage, self._found, self.work, *_ = others
        self.bound = max(self.bound, min(origin + (bucket << jump_kernels.BUCKET_BITS), self.best))
        if ended in (kernels.FOUND, kernels.EXHAUSTED):
            ended = kernels.FOUND if self.best < kernels.NO_PATH else kernels.EXHAUSTED
            self.bound = self.best
        self.note(ended)

    def path(self) -> tuple[Int32s, float, int]:
        """Return the path found, as single moves, its length in cells and its cost in units."""
        grid = self.grid
        path, (diagonals,) = traced(
            jump_kernels.trace, grid.width, self._found, self.workspace.pool
        )
        straights = len(path) - 1 - diagonals
        units = straights * grid.straight + diagonals * grid.diagonal
        return path, straights + diagonals * math.sqrt(2.0), units


def jump_search(grid: GridGraph, start: Cell, goal: Cell, **options: Any) -> BoundedResult:  # noqa: ANN401 - fields of a SearchProblem
    """Find a shortest path on a grid of uniform costs without corner cutting.

    `options` are fields of a `SearchProblem`, such as `stop`, `deadline` and `landmarks`; where it
    is stopped, the result has the best path found so far, if any.
    `expansions` counts the jump points taken from the queue. Raises ValueError for a cell off the
    grid, graded costs or corner cutting, and OverflowError if the cost of a path does not fit
    its 32 bits (beyond 900 thousand cells).
    """
    problem = SearchProblem(grid, start, goal, want_expanded=False, **options)
    return complete(JumpSearch(grid, start, goal, problem.landmarks), problem)
