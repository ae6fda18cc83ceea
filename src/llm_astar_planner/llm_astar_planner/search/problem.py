# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a search method gets and what it may say about itself: the protocol of all methods."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, cast

from llm_astar_planner.search.arrays import Bools, Float64s, StopFlag, no_stop
from llm_astar_planner.search.result import Cell, SearchResult

if TYPE_CHECKING:
    from llm_astar_planner.search.grid_graph import GridGraph
    from llm_astar_planner.search.landmarks import Landmarks


@dataclass(eq=False)
class SearchProblem:
    """A path to be searched from start to goal, both free cells (x, y) that are connected.

    - `grid`: the cells with their costs and rules; other searches use it too, so it must not be
      changed. `blocked` are its blocked cells.
    - `waypoints`: points (x, y) in grid coordinates to be guided by, in order; none for methods
      that use none. They are on the map, on no obstacle, and connected to the start.
    - `stop`, `deadline`: the search should end soon after `stop[0]` is 1, and at `deadline`
      (seconds of `time.monotonic()`).
      A search that has no path yet goes on until `first_path_deadline`, if that is later.
    - `want_expanded`: whether the result needs the picture of expanded cells.
    - `max_suboptimality`: the path may cost so many times the cheapest, 1 or more; None: any.
    - `heuristic`, `weight`: those of the paper's methods. `landmarks`: distances that are known,
      None for none.
    - `arrivals`: float [n, 2] waypoints that have come in since the start, the newest last; other
      threads append to it.
    """

    grid: GridGraph
    start: Cell
    goal: Cell
    waypoints: Sequence[tuple[float, float]] = ()
    stop: StopFlag = field(default_factory=no_stop)
    deadline: float = math.inf
    want_expanded: bool = True
    max_suboptimality: float | None = None
    heuristic: str = 'euclidean'
    weight: float = 1.0
    landmarks: Landmarks | None = None
    arrivals: deque[Float64s] = field(default_factory=deque)
    first_path_deadline: float = -math.inf

    @property
    def blocked(self) -> Bools:
        """The blocked cells, bool [height, width], read-only."""
        view = self.grid.blocked.view()
        view.flags.writeable = False
        return view


class SearchMethod(Protocol):
    """A search method: a function of a problem, and what the planner has to know of it.

    It returns its result, or it is a generator that yields each better result and returns the
    last. The planner validates every path. `uses_waypoints`: a source is asked for some.
    `takes_late_waypoints`: it looks at `arrivals`, so it may begin before the source has
    answered. `as_published`: its waypoints are the paper's target list without the start, checked
    by the paper's rules.
    """

    uses_waypoints: bool
    takes_late_waypoints: bool
    as_published: bool

    def __call__(
        self, problem: SearchProblem
    ) -> SearchResult | Generator[SearchResult, None, SearchResult]:
        """Search."""


def search_method(
    *, uses_waypoints: bool = False, takes_late_waypoints: bool = False, as_published: bool = False
) -> Callable[[Callable[[SearchProblem], Any]], SearchMethod]:
    """Make a function of a SearchProblem a SearchMethod with these properties.

    Of a plug-in only `uses_waypoints` counts: its waypoints never come late.
    """

    def mark(function: Callable[[SearchProblem], Any]) -> SearchMethod:
        vars(function).update(
            uses_waypoints=uses_waypoints, takes_late_waypoints=takes_late_waypoints,
            as_published=as_published,
        )  # fmt: skip
        return cast('SearchMethod', function)

    return mark
