"""The search methods by name; the paper's, with plain arguments in and a SearchResult out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import paper as kernels
from llm_astar_planner.search.guided import warm_up
from llm_astar_planner.search.result import Cell, SearchResult, SearchStatus

HEURISTICS = {
    'euclidean': kernels.EUCLIDEAN,
    'octile': kernels.OCTILE,
    'chebyshev': kernels.CHEBYSHEV,
    'manhattan': kernels.MANHATTAN,
}
# Dynamic weighted A* starts at weight 2 and decays by 0.99 a pop (LLM-A* paper, table 1).
DYNAMIC_WEIGHT = 2.0
DYNAMIC_DECAY = 0.99

_STATUS = {
    kernels.FOUND: SearchStatus.FOUND,
    kernels.EXHAUSTED: SearchStatus.EXHAUSTED,
    kernels.STOPPED: SearchStatus.STOPPED,
}


def no_stop() -> NDArray[np.uint8]:
    """Return a stop flag that nobody raises; set its one element to 1 to stop a search."""
    return np.zeros(1, dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class SearchOptions:
    """How to search, for every method.

    `heuristic` is a key of HEURISTICS, `weight` >= 1 is weighted A*'s. `corner_cutting` allows a
    diagonal step between or beside blocked cells, as the paper does. Another thread stops the
    search by setting `stop[0] = 1`.
    """

    heuristic: str = 'euclidean'
    weight: float = 2.0
    corner_cutting: bool = True
    stop: NDArray[np.uint8] = field(default_factory=no_stop)


class Method(Protocol):
    """A search method."""

    def __call__(
        self,
        blocked: NDArray[np.bool_],
        start: Cell,
        goal: Cell,
        targets: ArrayLike,
        options: SearchOptions,
    ) -> SearchResult:
        """Search `blocked` [height, width] from start to goal, free cells (x, y) on the grid.

        `targets` [n, 2] is the target list after its start, in cells; methods that know no
        waypoints leave it aside.
        """


def astar(
    blocked: NDArray[np.bool_], start: Cell, goal: Cell, targets: ArrayLike, options: SearchOptions
) -> SearchResult:
    """Search by A*, exact to the paper's: stale entries expand too, ties go by (f, x, y)."""
    del targets
    return _search(blocked, start, goal, [], options, weight=1.0)


def weighted_astar(
    blocked: NDArray[np.bool_], start: Cell, goal: Cell, targets: ArrayLike, options: SearchOptions
) -> SearchResult:
    """Weighted A* with the static weight of the options: f = g + w h(goal)."""
    del targets
    return _search(blocked, start, goal, [], options, weight=options.weight)


def dynamic_weighted_astar(
    blocked: NDArray[np.bool_], start: Cell, goal: Cell, targets: ArrayLike, options: SearchOptions
) -> SearchResult:
    """Dynamic weighted A*, exact to the paper's row: w = max(1, 2 * 0.99^k) at the k-th pop."""
    del targets
    return _search(blocked, start, goal, [], options, weight=DYNAMIC_WEIGHT, decay=DYNAMIC_DECAY)


def llm_astar(
    blocked: NDArray[np.bool_], start: Cell, goal: Cell, targets: ArrayLike, options: SearchOptions
) -> SearchResult:
    """LLM-A*, exact to the paper's published code: f = g + (h(goal) + h(target)).

    The target moves on when a neighbour equals it; one that is no lattice point is never met.
    Its length has no bound.
    """
    return _search(blocked, start, goal, targets, options, weight=1.0)


PAPER_METHODS: dict[str, Method] = {
    'astar': astar,
    'weighted_astar': weighted_astar,
    'dynamic_weighted_astar': dynamic_weighted_astar,
    'llm_astar': llm_astar,
}
# The searches of our own, whose paths carry a bound: see docs/guided-search.md.
EXACT = 'exact_astar'
GUIDED = 'guided'
METHODS = (GUIDED, EXACT, *PAPER_METHODS)
# The methods that make use of waypoints; the others never ask for them.
WAYPOINT_METHODS = frozenset({GUIDED, 'llm_astar'})


def compile_kernels() -> None:
    """Compile, or load from numba's cache, so that the first plan does not wait for it."""
    blocked = np.zeros((3, 3), dtype=bool)
    llm_astar(blocked, (0, 0), (2, 2), [[1, 1], [2, 2]], SearchOptions())
    warm_up()


def path_length(path: NDArray[np.int32]) -> float:
    """Return the Euclidean length of a path of cells [n, 2], in cells."""
    steps = np.diff(path, axis=0)
    return float(np.sum(np.hypot(steps[:, 0], steps[:, 1])))


def _search(
    blocked: NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    targets: ArrayLike,
    options: SearchOptions,
    *,
    weight: float,
    decay: float = 1.0,
) -> SearchResult:
    start_cell, goal_cell = np.array(start, dtype=np.int64), np.array(goal, dtype=np.int64)
    height, width = blocked.shape
    # Zeros that the system hands out as they are touched: a small search of a large map is cheap.
    seen, closed = (np.zeros(width * height, dtype=np.bool_) for _ in range(2))
    code, expansions, storage, move_to = kernels.paper_search(
        np.ascontiguousarray(blocked, dtype=np.bool_),
        start_cell,
        goal_cell,
        np.asarray(targets, dtype=np.float64).reshape(-1, 2),
        HEURISTICS[options.heuristic],
        float(weight),
        float(decay),
        bool(options.corner_cutting),
        options.stop,
        seen,
        closed,
    )
    expanded = closed.reshape(width, height).T
    status = _STATUS[code]
    if status is not SearchStatus.FOUND:
        return SearchResult(status, expansions, storage, expanded)
    path = kernels.trace_back(move_to, start_cell, goal_cell, height)
    return SearchResult(status, expansions, storage, expanded, path, path_length(path))
