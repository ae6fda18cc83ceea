"""One leg of a plan: ask for waypoints, judge them, search from one cell to another."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning import waypoint_filter as targets
from llm_astar_planner.planning.types import NOT_ASKED, PlanRequest
from llm_astar_planner.planning.waypoint_filter import CheckedWaypoint
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.guided import AnytimeSolution, GuidedResult, GuidedSearch
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.paper import (
    EXACT,
    GUIDED,
    PAPER_METHODS,
    WAYPOINT_METHODS,
    SearchOptions,
)
from llm_astar_planner.search.result import BoundedResult, SearchResult, SearchStatus
from llm_astar_planner.search.stop import STOP_CANCELLED, deadline_guard
from llm_astar_planner.waypoints.async_query import WaypointQueryTask, query_source
from llm_astar_planner.waypoints.source import Waypoint, WaypointQuery, WaypointReply

# The part of a request's time that a source may take; the rest is the search's.
SOURCE_SHARE = 0.8
# A search that does not wait for its source gives it so many seconds all the same: little to a
# robot, and time for the embedded model or a cached reply, which lead from the beginning then.
HEAD_START = 0.03
Watcher = Callable[[AnytimeSolution], None]


@dataclass
class Leg:
    """The way from the start of a request to its goal, both free and joined; via is not looked at.

    Made with what the search works on and how long it may go on: until `deadline` (monotonic) or
    until `stop` is raised. `search` fills in the rest.
    """

    costmap: Costmap
    request: PlanRequest
    deadline: float
    stop: NDArray[np.uint8]
    landmarks: Landmarks | None = None
    reply: WaypointReply = NOT_ASKED
    judged: tuple[CheckedWaypoint, ...] = ()
    led: bool = True  # whether the search took up what waypoints there were
    seconds_source: float = 0.0
    seconds_search: float = 0.0

    @property
    def used(self) -> list[CheckedWaypoint]:
        """The waypoints that led the search."""
        if not self.led:
            return []
        if self.request.method == GUIDED:
            return [point for point in self.judged if point.status in targets.GUIDING]
        return [point for point in self.judged if not point.status.drops]

    def search(self, watcher: Watcher | None = None) -> SearchResult:
        """Ask and search. `watcher` gets each better path of `guided`, unchecked, as it comes.

        Raises PathTooLongError.
        """
        if self.request.method == GUIDED:
            return self._search_guided(watcher)
        self._ask()
        begin = time.monotonic()
        with deadline_guard(self.stop, self.deadline) as stop:
            exact = self.request.method == EXACT
            result = self._search_exact(stop) if exact else self._search_as_published(stop)
        self.seconds_search = time.monotonic() - begin
        return result

    def _query(self) -> WaypointQuery | None:
        """Return the question for the source, None where there is none to ask."""
        request = self.request
        needless = request.method not in WAYPOINT_METHODS or request.start == request.goal
        if request.source is None or needless:
            return None
        time_left = self.deadline - time.monotonic()
        return WaypointQuery(
            self.costmap,
            request.start,
            request.goal,
            min(request.source_time_limit, SOURCE_SHARE * time_left),
            request.sample,
            request.instruction,
        )

    def _ask(self) -> None:
        """Ask the source for waypoints and judge them."""
        query = self._query()
        if query is not None and self.request.source is not None:
            self.reply, self.seconds_source = query_source(self.request.source, query, self.stop)
            self.judged = self._judge(self.reply)

    def _judge(self, reply: WaypointReply) -> tuple[CheckedWaypoint, ...]:
        costmap, start = self.costmap, self.request.start
        if self.request.method == GUIDED:
            return targets.judge(reply.waypoints, costmap.blocked, costmap.components, start, 0)
        return targets.judge(reply.waypoints, costmap.rejected_cells, costmap.components, start)

    def _search_exact(self, stop: NDArray[np.uint8]) -> SearchResult:
        request = self.request
        return exact_astar(
            self.costmap.grid_graph,
            request.start,
            request.goal,
            stop=stop,
            want_expanded=request.want_expanded,
        )

    def _search_as_published(self, stop: NDArray[np.uint8]) -> SearchResult:
        """Search by one of the paper's methods."""
        request = self.request
        goals = targets.target_list(self.judged, request.start, request.goal)[1:]
        corner_cutting = self.costmap.config.corner_cutting
        options = SearchOptions(request.heuristic, request.weight, corner_cutting, stop)
        method = PAPER_METHODS[request.method]
        return method(self.costmap.blocked, request.start, request.goal, goals, options)

    def _search_guided(self, watcher: Watcher | None) -> GuidedResult:
        """Search by `guided`, asking for waypoints before or while."""
        request = self.request
        query = self._query() if request.search_while_waiting else None
        if query is None:
            self._ask()
        with deadline_guard(self.stop, self.deadline) as stop:
            search = GuidedSearch(
                self.costmap.grid_graph,
                request.start,
                request.goal,
                max_suboptimality=request.max_suboptimality,
                landmarks=self.landmarks,
                stop=stop,
            )
            asking = self._guide(search, query)
            begin = time.monotonic()
            for better in search.solutions(want_expanded=request.want_expanded):
                if watcher is not None:
                    watcher(better)
                if self.stop[0]:
                    stop[0] = STOP_CANCELLED  # who cancels on seeing a path means it at once
        self.seconds_search = time.monotonic() - begin
        result = search.result()
        if asking is not None and request.source is not None:
            self.reply, self.seconds_source = asking.close(request.source.name)
            self.judged = self._judge(self.reply)
        self.led = result.guided_expansions > 0
        return result

    def _guide(
        self, search: GuidedSearch, query: WaypointQuery | None
    ) -> WaypointQueryTask | None:
        """Lead the search by the waypoints there are, or by those that answer the query."""
        source = self.request.source
        if query is None or source is None:
            search.guide(_points(self.judged))
            return None
        asking = WaypointQueryTask(
            source, query, lambda reply: search.guide(_points(self._judge(reply)))
        )
        asking.wait(min(HEAD_START, query.time_limit), self.stop)
        return asking


def joined(results: Sequence[SearchResult]) -> SearchResult:
    """Return the searches of successive legs, each with a path, as one.

    Work, length, cost and lower bound add up: the least way through the via cells is the sum of
    the least ways between them, so the suboptimality_bound of the sums is proven of the whole.
    """
    return reduce(_join, results)


def _join(first: SearchResult, second: SearchResult) -> SearchResult:
    stopped = SearchStatus.STOPPED in (first.status, second.status)
    whole = replace(
        first,
        status=SearchStatus.STOPPED if stopped else SearchStatus.FOUND,
        expansions=first.expansions + second.expansions,
        storage=first.storage + second.storage,
        expanded=first.expanded | second.expanded,
        path=np.concatenate((first.path, second.path[1:])),
        length=first.length + second.length,
    )
    if not (isinstance(whole, BoundedResult) and isinstance(second, BoundedResult)):
        return whole
    cost, lower_bound = whole.cost + second.cost, whole.lower_bound + second.lower_bound
    return replace(
        whole,
        cost=cost,
        lower_bound=lower_bound,
        suboptimality_bound=max(1.0, cost / lower_bound) if lower_bound else 1.0,
        first_expansions=whole.first_expansions + second.first_expansions,
        first_cost=whole.first_cost + second.first_cost,
    )


def _points(judged: tuple[CheckedWaypoint, ...]) -> list[Waypoint]:
    """Return the waypoints that may lead `guided`: those a path can be at."""
    return [(point.x, point.y) for point in judged if point.status in targets.GUIDING]
