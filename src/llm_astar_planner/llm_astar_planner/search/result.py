# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What every search returns."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int32s

# The column and the row of a cell, (x, y).
Cell = tuple[int, int]


class SearchStatus(Enum):
    """How a search ended."""

    FOUND = 'found'
    EXHAUSTED = 'exhausted'  # everything reachable was expanded: there is no path
    STOPPED = 'stopped'  # the stop flag was raised: a deadline or a cancel


def empty_path() -> Int32s:
    """Return a path without cells: int32 [0, 2]."""
    return np.empty((0, 2), dtype=np.int32)


@dataclass(eq=False)
class SearchResult:
    """The outcome of one search on a grid.

    `path` is int32 [n, 2], cells (x, y) from start to goal, empty unless found. `expansions`
    counts the expanded states (the paper calls it operation), `storage` the states that ever
    got a g (the paper's storage). `length` is in cells, NaN without a path. `expanded` is bool
    [height, width].
    """

    status: SearchStatus
    expansions: int
    storage: int
    expanded: Bools
    path: Int32s = field(default_factory=empty_path)
    length: float = float('nan')


@dataclass(eq=False)
class BoundedResult(SearchResult):
    """A search result with what is proven about its path.

    `cost` is the path's cost in cells: its length where the grid has no graded costs.
    `lower_bound` is proven to be at most the optimal cost, and `suboptimality_bound` = cost /
    lower_bound to be at least cost / optimum (inf without a path). `first_expansions` and
    `first_cost` describe the first path found. `expanded` is empty, [0, 0], unless it was
    requested.
    """

    cost: float = math.inf
    lower_bound: float = 0.0
    suboptimality_bound: float = math.inf
    first_expansions: int = 0
    first_cost: float = math.inf
