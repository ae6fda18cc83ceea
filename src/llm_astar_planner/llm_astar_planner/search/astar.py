"""Exact A* on a grid: octile estimate, ties to larger g, a queue of buckets."""

from __future__ import annotations

import math

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as kernels
from llm_astar_planner.search.grid_graph import GridGraph, Workspace, as_grid
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus, empty_path
from llm_astar_planner.search.stop import StopFlag, no_stop

_STATUS = {
    kernels.FOUND: SearchStatus.FOUND,
    kernels.EXHAUSTED: SearchStatus.EXHAUSTED,
    kernels.STOPPED: SearchStatus.STOPPED,
}


class PathTooLongError(LlmAstarError, ArithmeticError):
    """A path whose cost is too large for the 32-bit records of the search."""


def exact_astar(
    blocked: GridGraph | NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    *,
    corner_cutting: bool = False,
    stop: StopFlag | None = None,
    want_expanded: bool = True,
    every_move: bool = False,
) -> BoundedResult:
    """Find a cheapest path with A*; exact to 6e-8 of the length.

    `blocked` is a prepared grid, or bool [height, width], which is prepared first. Another
    thread ends the search by raising `stop`; the status is then STOPPED, with the best path
    found so far, if any. `every_move` also tries the moves that uniform costs make pointless,
    as a textbook A* does: about as many expansions, more states stored. Raises ValueError for a
    cell off the grid and PathTooLongError beyond 30 million cells.
    """
    grid = as_grid(blocked, corner_cutting=corner_cutting)
    first, last = grid.index(start), grid.index(goal)
    if grid.blocked[start[1], start[0]] or grid.blocked[goal[1], goal[0]]:
        return BoundedResult(SearchStatus.EXHAUSTED, 0, 0, np.zeros_like(grid.blocked))
    with grid.workspace() as workspace:
        ended = run_kernel(grid, workspace, first, last, stop=stop, every_move=every_move)
        if ended[0] != kernels.OVERFLOW:
            return make_result(grid, workspace, first, last, ended, want_expanded=want_expanded)
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
    grid: GridGraph, start: Cell, goal: Cell, *, stop: StopFlag | None = None
) -> tuple[NDArray[np.int32], float]:
    """Return a cheapest path, int32 [n, 2], and its cost in cells; empty and inf if none.

    The same search as `exact_astar` without its bookkeeping. Raises what `exact_astar` does,
    and InterruptedError if `stop` was raised.
    """
    first, last = grid.index(start), grid.index(goal)
    if first == last and grid.blocked[start[1], start[0]]:
        return empty_path(), math.inf
    workspace = grid.borrow()
    try:
        status, count, _, units = run_kernel(grid, workspace, first, last, stop=stop)
        if status == kernels.FOUND:
            path = take_path(workspace, count, grid.width, first, last)
            return path, units / grid.straight
    finally:
        grid.give_back(workspace)
    if status == kernels.OVERFLOW:
        result = exact_astar(grid, start, goal, stop=stop, want_expanded=False)
        return result.path, result.cost
    if status == kernels.STOPPED:
        raise InterruptedError('the search was stopped')
    return empty_path(), math.inf


def run_kernel(
    grid: GridGraph,
    workspace: Workspace,
    first: int,
    last: int,
    *,
    stop: StopFlag | None = None,
    every_move: bool = False,
) -> tuple[int, int, int, int]:
    """Run the compiled A* between two cell numbers, with as large a workspace as it needs.

    Returns how it ended (a kernel code), and the path's cells, diagonal moves and cost in units.
    """
    generation = workspace.next_generation()
    workspace.control[kernels.A_STARTED] = 0
    flag = no_stop() if stop is None else stop
    every_move = every_move or grid.cell_surcharge.size > 0
    while True:
        ended: tuple[int, int, int, int] = kernels.solve(
            grid.moves, grid.cell_surcharge, grid.width, grid.straight, grid.diagonal,
            first, last, every_move, generation,
            workspace.records, workspace.pool, workspace.heads, workspace.control,
            flag, workspace.path,
        )  # fmt: skip
        if ended[0] != kernels.NEED_SPACE:
            return ended
        workspace.grow_pool()


def take_path(
    workspace: Workspace, count: int, width: int, first: int, last: int
) -> NDArray[np.int32]:
    """Return the path of `count` cells that `run_kernel` found: int32 [count, 2]."""
    if count <= len(workspace.path):
        return workspace.path[-count:].copy()
    return workspace.trace(width, first, last)


def make_result(
    grid: GridGraph,
    workspace: Workspace,
    first: int,
    last: int,
    ended: tuple[int, int, int, int],
    *,
    want_expanded: bool,
) -> BoundedResult:
    """Describe how `run_kernel` ended: the path, the counts and what they prove."""
    status, count, diagonals, units = ended
    control = workspace.control
    expanded: NDArray[np.bool_] = np.zeros((0, 0), dtype=np.bool_)
    if want_expanded:
        expanded = np.zeros(grid.blocked.shape, dtype=np.bool_)
        kernels.add_expanded(workspace.records, workspace.generation, expanded)
    expansions, storage = int(control[kernels.A_EXPANSIONS]), int(control[kernels.A_STORAGE])
    if count == 0:
        return BoundedResult(_STATUS[status], expansions, storage, expanded)
    floor = int(control[kernels.A_BUCKET]) << kernels.BUCKET_BITS
    bound = units if status == kernels.FOUND else min(units, floor)
    return BoundedResult(
        _STATUS[status],
        expansions,
        storage,
        expanded,
        take_path(workspace, count, grid.width, first, last),
        count - 1 - diagonals + diagonals * math.sqrt(2.0),
        cost=units / grid.straight,
        lower_bound=bound / grid.straight,
        suboptimality_bound=units / bound if bound else 1.0,
        first_expansions=expansions,
        first_cost=units / grid.straight,
    )
