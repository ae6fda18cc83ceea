# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The paper's search methods, exact to its published code."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import paper as kernels
from llm_astar_planner.search._kernels.astar import FOUND, NEED_SPACE, RUNNING, STOPPED
from llm_astar_planner.search.any_angle import can_see, string_pull
from llm_astar_planner.search.astar import ENDED, exact_astar
from llm_astar_planner.search.expansion_order import ExpansionRecorder
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.jump import jump_search
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.methods import HEURISTIC_NAMES
from llm_astar_planner.search.problem import SearchProblem, search_method
from llm_astar_planner.search.result import Cell, SearchResult
from llm_astar_planner.search.stop import StopFlag, no_stop

# The numbers of `kernels.EUCLIDEAN` and those after it.
HEURISTICS = {name: number for number, name in enumerate(HEURISTIC_NAMES)}
# Dynamic weighted A* starts at weight 2, which decays by 0.99 per pop (LLM-A* paper, table 1).
DYNAMIC_WEIGHT = 2.0
DYNAMIC_DECAY = 0.99
# Queue entries popped, or given new keys, between two looks at the deadline: a few milliseconds.
SLICE = 16384
_FIRST_HEAP = 1024
_NOT_WANTED = np.zeros((0, 0), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class SearchOptions:
    """Options of the paper's methods.

    `heuristic` is a key of HEURISTICS; `weight` >= 1 applies to weighted A* alone.
    `corner_cutting` allows a diagonal step between or next to blocked cells, as the paper does.
    The search ends at `deadline` (monotonic seconds, looked at between slices) and when another
    thread sets `stop[0] = 1`. Without `want_expanded` the result has no expanded cells, [0, 0].
    A `recorder` notes in which order cells are expanded.
    """

    heuristic: str = 'euclidean'
    weight: float = 2.0
    corner_cutting: bool = True
    stop: StopFlag = field(default_factory=no_stop)
    deadline: float = math.inf
    want_expanded: bool = True
    recorder: ExpansionRecorder | None = None


@dataclass(frozen=True)
class PaperMethod:
    """One of the paper's search methods: f = g + w h(goal), with h(target) more for targets.

    `weight` is w, None that of the options, and is multiplied by `decay` at each pop, down to 1.
    """

    weight: float | None = 1.0
    decay: float = 1.0
    uses_targets: bool = False

    def __call__(
        self,
        blocked: NDArray[np.bool_],
        start: Cell,
        goal: Cell,
        targets: ArrayLike,
        options: SearchOptions,
    ) -> SearchResult:
        """Search `blocked` [height, width] from start to goal, free cells (x, y) on the grid.

        `targets` [n, 2] is the paper's target list without its start, in cells; methods that
        use no waypoints ignore it.
        """
        height, width = blocked.shape
        first, last = (x * height + y for x, y in (start, goal))
        weight = options.weight if self.weight is None else self.weight
        chosen: ArrayLike = targets if self.uses_targets else []
        # The system provides zeroed pages on first touch: a small search of a large map is cheap.
        seen, closed = (np.zeros(width * height, dtype=np.bool_) for _ in range(2))
        g, move_to = np.empty(width * height), np.empty(width * height, dtype=np.int8)
        counts = np.zeros(kernels.COUNTS, dtype=np.int64)
        search: Callable[..., int] = partial(
            kernels.paper_search,
            np.ascontiguousarray(blocked, dtype=np.bool_), first, last,
            np.asarray(chosen, dtype=np.float64).reshape(-1, 2), HEURISTICS[options.heuristic],
            float(self.decay), bool(options.corner_cutting), options.stop,
            SLICE if options.recorder is None else options.recorder.step,
            seen, closed, g, move_to, counts, np.array([max(1.0, weight), weight]),
        )  # fmt: skip
        expanded = closed.reshape(width, height).T
        code = run_slices(search, options, expanded, counts)
        expansions, storage = int(counts[kernels.EXPANSIONS]), int(counts[kernels.STORAGE])
        found = (
            ENDED[code], expansions, storage, expanded if options.want_expanded else _NOT_WANTED,
        )  # fmt: skip
        if code != FOUND:
            return SearchResult(*found)
        path, diagonals = kernels.trace_back(move_to, first, last, height)
        return SearchResult(*found, path, len(path) - 1 - diagonals + diagonals * math.sqrt(2.0))


# Stale queue entries are expanded too, ties go by (f, x, y).
astar = PaperMethod()
# The target advances when a neighbour equals it; a target between lattice points is never
# reached. The length of the path has no bound.
llm_astar = PaperMethod(uses_targets=True)
PAPER_METHODS = {
    'astar': astar,
    'weighted_astar': PaperMethod(weight=None),
    'dynamic_weighted_astar': PaperMethod(DYNAMIC_WEIGHT, DYNAMIC_DECAY),
    'llm_astar': llm_astar,
}


def search_as_published(method: PaperMethod, problem: SearchProblem) -> SearchResult:
    """Search by one of the paper's methods; without waypoints the goal is its only target."""
    grid = problem.grid
    options = SearchOptions(
        problem.heuristic, problem.weight, grid.corner_cutting, problem.stop,
        max(problem.deadline, problem.first_path_deadline), problem.want_expanded,
    )  # fmt: skip
    targets = problem.waypoints or [problem.goal]
    return method(grid.blocked, problem.start, problem.goal, targets, options)


astar_method, weighted_astar_method, dynamic_weighted_astar_method, llm_astar_method = (
    search_method(uses_waypoints=method.uses_targets, as_published=method.uses_targets)(
        partial(search_as_published, method)
    )
    for method in PAPER_METHODS.values()
)


def compile_kernels() -> None:
    """Compile all kernels, or load them from numba's cache, so that the first plan need not."""
    # The wall between start and goal makes the proof run every kernel.
    blocked = np.zeros((24, 24), dtype=np.bool_)
    blocked[4:, 12] = True
    start, goal, waypoints = (2, 20), (21, 20), [[2.0, 2.0]]
    llm_astar(blocked, start, goal, [*waypoints, goal], SearchOptions())
    for cost in (None, np.ones(blocked.shape)):
        grid = GridGraph(blocked, cost=cost)
        changing = Landmarks.build(grid)
        if changing is not None:
            list(changing.repair(changing.merge(GridGraph(blocked & False, cost=cost))))
        for landmarks in (Landmarks.build(grid), None):
            for bound in (None, 1.0):
                guided(grid, start, goal, waypoints, max_suboptimality=bound, landmarks=landmarks)
        guided(grid, start, goal, waypoints, work_factor=0.0)
        if cost is None:
            jump_search(grid, start, goal, stop=no_stop())
        result = exact_astar(grid, start, goal)
        can_see(grid, start, goal)
        string_pull(grid, result.path)


def run_slices(
    search: Callable[..., int],
    options: SearchOptions,
    expanded: NDArray[np.bool_],
    counts: NDArray[np.int64],
) -> int:
    """Call a search with a heap (keys, nodes) until it ends or the deadline comes.

    Records the `expanded` cells [height, width]. Returns the kernel's code of how it ended.
    """
    keys, nodes = np.empty(_FIRST_HEAP), np.empty(_FIRST_HEAP, dtype=np.int64)
    recorder = options.recorder
    while time.monotonic() < options.deadline:
        code = search(keys, nodes)
        expansions = int(counts[kernels.EXPANSIONS])
        if recorder is not None and (code != RUNNING or recorder.is_due(expansions)):
            recorder.look(expanded, expansions)
        if code == NEED_SPACE:
            keys, nodes = np.concatenate((keys, keys)), np.concatenate((nodes, nodes))
        elif code != RUNNING:
            return code
    return STOPPED
