# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The paper's search methods, exact to its published code."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from llm_astar_planner.search._kernels import paper as kernels
from llm_astar_planner.search._kernels.astar import FOUND, NEED_SPACE, RUNNING, STOPPED
from llm_astar_planner.search.arrays import Bools, Int64s
from llm_astar_planner.search.astar import ENDED
from llm_astar_planner.search.expansion_order import ExpansionRecorder
from llm_astar_planner.search.methods import HEURISTIC_NAMES, PAPER_NAMES
from llm_astar_planner.search.problem import SearchProblem
from llm_astar_planner.search.result import SearchResult

# The numbers of `kernels.EUCLIDEAN` and those after it.
HEURISTICS = {name: number for number, name in enumerate(HEURISTIC_NAMES)}
# Dynamic weighted A* starts at weight 2, which decays by 0.99 per pop (LLM-A* paper, table 1).
DYNAMIC_WEIGHT = 2.0
DYNAMIC_DECAY = 0.99
# Queue entries popped, or given new keys, between two looks at the deadline: a few milliseconds.
SLICE = 16384
_FIRST_HEAP = 1024
_NOT_WANTED = np.zeros((0, 0), dtype=np.bool_)


@dataclass(frozen=True)
class PaperMethod:
    """One of the paper's search methods: f = g + w h(goal), with h(target) more for targets.

    `weight` is w, None that of the problem, and is multiplied by `decay` at each pop, down to 1.
    The targets are the waypoints of the problem, the paper's list without its start; without any
    the goal is the only one. Ties go by (f, x, y), and stale queue entries are expanded too.
    """

    weight: float | None = 1.0
    decay: float = 1.0
    uses_waypoints: bool = False
    takes_late_waypoints: ClassVar[bool] = False

    @property
    def as_published(self) -> bool:
        """Whether waypoints are checked by the paper's rules."""
        return self.uses_waypoints

    def __call__(
        self, problem: SearchProblem, recorder: ExpansionRecorder | None = None
    ) -> SearchResult:
        """Search; a `recorder` notes in which order cells are expanded.

        Without `want_expanded` the result has no expanded cells, [0, 0].
        """
        blocked = problem.grid.blocked
        height, width = blocked.shape
        first, last = (x * height + y for x, y in (problem.start, problem.goal))
        weight = problem.weight if self.weight is None else self.weight
        targets = (problem.waypoints or [problem.goal]) if self.uses_waypoints else []
        # The system provides zeroed pages on first touch: a small search of a large map is cheap.
        seen, closed = (np.zeros(width * height, dtype=np.bool_) for _ in range(2))
        g, move_to = np.empty(width * height), np.empty(width * height, dtype=np.int8)
        counts = np.zeros(kernels.COUNTS, dtype=np.int64)
        search: Callable[..., int] = partial(
            kernels.paper_search, blocked, first, last,
            np.asarray(targets, dtype=np.float64).reshape(-1, 2), HEURISTICS[problem.heuristic],
            float(self.decay), bool(problem.grid.corner_cutting), problem.stop,
            SLICE if recorder is None else recorder.step,
            seen, closed, g, move_to, counts, np.array([max(1.0, weight), weight]),
        )  # fmt: skip
        expanded = closed.reshape(width, height).T
        deadline = max(problem.deadline, problem.first_path_deadline)
        code = run_slices(search, deadline, recorder, expanded, counts)
        done = int(counts[kernels.EXPANSIONS]), int(counts[kernels.STORAGE])
        found = ENDED[code], *done, expanded if problem.want_expanded else _NOT_WANTED
        if code != FOUND:
            return SearchResult(*found)
        path, diagonals = kernels.trace_back(move_to, first, last, height)
        return SearchResult(*found, path, len(path) - 1 - diagonals + diagonals * math.sqrt(2.0))


astar = PaperMethod()
weighted_astar = PaperMethod(weight=None)
dynamic_weighted_astar = PaperMethod(DYNAMIC_WEIGHT, DYNAMIC_DECAY)
# The target advances when a neighbour equals it; a target between lattice points is never
# reached. The length of the path has no bound.
llm_astar = PaperMethod(uses_waypoints=True)
PAPER_METHODS = dict(zip(PAPER_NAMES, (astar, weighted_astar, dynamic_weighted_astar, llm_astar)))


def run_slices(
    search: Callable[..., int],
    deadline: float,
    recorder: ExpansionRecorder | None,
    expanded: Bools,
    counts: Int64s,
) -> int:
    """Call a search with a heap (keys, nodes) until it ends or the deadline comes.

    Records the `expanded` cells [height, width]. Returns the kernel's code of how it ended.
    """
    keys, nodes = np.empty(_FIRST_HEAP), np.empty(_FIRST_HEAP, dtype=np.int64)
    while time.monotonic() < deadline:
        code = search(keys, nodes)
        expansions = int(counts[kernels.EXPANSIONS])
        if recorder is not None and (code != RUNNING or recorder.is_due(expansions)):
            recorder.look(expanded, expansions)
        if code == NEED_SPACE:
            keys, nodes = np.concatenate((keys, keys)), np.concatenate((nodes, nodes))
        elif code != RUNNING:
            return code
    return STOPPED
