# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plans one segment: queries waypoints, checks them, and searches from one cell to another.

Of checked waypoints the paper's target list T is built. It asks that T holds start and goal and
that no target lies in an obstacle (sec. 3.2). Its published code also drops points within two
cells of the map's edge.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.types import (
    NOT_ASKED,
    CheckedWaypoint,
    PlanningFailure,
    PlanRequest,
    ResultCode,
    WaypointStatus,
    describe_expansions,
)
from llm_astar_planner.search.arrays import Bools, Float64s, Int32s, Uint8s
from llm_astar_planner.search.guided import GuidedResult
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.methods import SEARCH_METHODS, PluginMethod, uses_waypoints
from llm_astar_planner.search.problem import SearchMethod, SearchProblem
from llm_astar_planner.search.result import BoundedResult, Cell, SearchResult, SearchStatus
from llm_astar_planner.search.tiles import Tiles
from llm_astar_planner.waypoints.async_query import (
    QueryTask,
    helps_on,
    name_of,
    query_source,
    start_query,
)
from llm_astar_planner.waypoints.source import (
    SAVES_NOTHING,
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

if TYPE_CHECKING:
    from llm_astar_planner.search.product import ProductProblem

# The part of a request's time that a source may take; the rest is for the search.
SOURCE_SHARE = 0.8
# Seconds that a search which does not wait for its source waits all the same: little for a robot,
# and enough for the learned model or a cached reply.
HEAD_START = 0.03
# The published filter keeps 1 < x < width - 2, and likewise y.
PAPER_EDGE = 2
# The paper's methods drop a waypoint only if no robot can be there.
KEPT_BY_PAPER = frozenset(WaypointStatus) - {WaypointStatus.OUT_OF_BOUNDS, WaypointStatus.OCCUPIED}
# How a source replied that has not failed: in time, with whatever it found.
NO_FAILURE = frozenset({
    SourceStatus.OK, SourceStatus.NONE, SourceStatus.NO_WAYPOINTS, SourceStatus.LATE
})  # fmt: skip
# The result of a segment before its search has ended.
NOT_SEARCHED = SearchResult(SearchStatus.STOPPED, 0, 0, np.zeros((0, 0), dtype=np.bool_))


@dataclass(eq=False)
class SegmentPlanner:
    """Plans from the start of a request to its goal, both free and connected.

    Until `deadline` (monotonic seconds), or until `stop[0]` is raised; `via` of the request is
    ignored. `search` fills in `result` (NOT_SEARCHED before its end), `reply`,
    `checked_waypoints`, of which a path can be at `accepted` many and the search uses the
    `guiding_waypoints`, and the seconds of both; `search_product` instead `result`, `product`,
    `changes` and `seconds_search`. `is_asked` says that the source was asked, `by_heading` that
    another search replaced its path.
    """

    costmap: Costmap
    request: PlanRequest
    deadline: float
    stop: Uint8s
    landmarks: Landmarks | None = None
    result: SearchResult = NOT_SEARCHED
    product: ProductProblem | None = None
    changes: Sequence[int] = ()
    reply: WaypointReply = NOT_ASKED
    checked_waypoints: tuple[CheckedWaypoint, ...] = ()
    guiding_waypoints: Sequence[CheckedWaypoint] = ()
    accepted: int = 0
    is_asked: bool = False
    by_heading: bool = False
    seconds_source: float = 0.0
    seconds_search: float = 0.0

    def __post_init__(self) -> None:
        """Find the method. Raises PluginError where its plug-in cannot be loaded."""
        method = SEARCH_METHODS.loaded.get(self.request.method)
        self.method: SearchMethod = method or SEARCH_METHODS.load(self.request.method)

    def search(self) -> Iterator[SearchResult]:
        """Query and search; yield each better path of a method that finds several, not validated.

        Raises PathTooLongError, and PluginError where a plug-in's method fails.
        """
        request, waypoints = self.request, list[Waypoint]()
        arrivals: deque[Float64s] = deque()
        task = None
        source = request.source if self.method.uses_waypoints else None
        if source is not None and request.start != request.goal and helps_on(source, self.costmap):
            task = self.query(source, waypoints, arrivals)
        problem = SearchProblem(
            self.costmap.grid_graph, request.start, request.goal, waypoints, self.stop,
            self.deadline, request.want_expanded, request.max_suboptimality, request.heuristic,
            request.weight, self.landmarks, arrivals,
            time.monotonic() + request.first_path_time_limit,
        )  # fmt: skip
        begin = time.monotonic()
        answer = self.method(problem)
        result = answer if isinstance(answer, SearchResult) else (yield from answer)
        self.seconds_search = time.monotonic() - begin
        self.result = result
        if task is not None:
            self.reply, self.seconds_source = task.close()
        if isinstance(result, GuidedResult) and not result.guided_expansions:
            self.guiding_waypoints = ()

    def search_product(self, problem: ProductProblem) -> None:
        """Search for the cheapest path that automata accept, with prices.

        Raises ProductTooLargeError where it does not fit in memory.
        """
        # Kernels that plans without an instruction do not take.
        from llm_astar_planner.search.product import product_search  # noqa: PLC0415

        begin = time.monotonic()
        self.product = problem
        self.result = result = product_search(
            self.costmap.grid_graph, self.request.start, self.request.goal, problem,
            landmarks=self.landmarks, stop=self.stop, deadline=self.deadline,
            want_expanded=self.request.want_expanded,
        )  # fmt: skip
        changed = np.diff(result.trace, axis=0).any(axis=1)
        self.changes = (np.flatnonzero(changed) + 1).tolist()
        self.seconds_search = time.monotonic() - begin

    def failure(
        self, expansions: int, start: str = 'the start', goal: str = 'the goal'
    ) -> PlanningFailure:
        """Return why there is no path after so many expansions; `start` and `goal` are names."""
        code, message = ResultCode.NO_VALID_PATH, 'every reachable cell was searched'
        if isinstance(self.method, PluginMethod):
            # The cells are connected, so there is a path: what a plug-in claims is only its own.
            message = f'{self.request.method} found no path'
        is_over = self.stop[0] or time.monotonic() >= self.deadline
        if isinstance(self.method, PluginMethod) and not is_over:
            if self.result.status is SearchStatus.STOPPED:
                code, message = ResultCode.UNKNOWN, f'{self.request.method} stopped by itself'
        elif self.result.status is SearchStatus.STOPPED:
            done = describe_expansions(expansions)
            code, message = ResultCode.TIMEOUT, f'cancelled after {done}'
            if not self.stop[0]:
                message = f'out of time after {done} ({self.describe_limit()})'
        start += f' {self.costmap.describe_cell(self.request.start)}'
        goal += f' {self.costmap.describe_cell(self.request.goal)}'
        return PlanningFailure(code, f'{message}, from {start} to {goal}')

    def describe_limit(self) -> str:
        """Say which time limit a search without a path has, and how it is called."""
        name, seconds = 'max_planning_time', self.request.time_limit
        if self.request.first_path_time_limit > seconds:
            name, seconds = 'first_path_time_limit', self.request.first_path_time_limit
        return f'the limit is {seconds:g} s, {name}'

    def take(self, found: BoundedResult, seconds: float) -> None:
        """Take the path of a search by heading, which took so many seconds, instead of its own.

        What it proves counts where the method proves anything.
        """
        own = self.result
        expansions, storage = own.expansions + found.expansions, own.storage + found.storage
        picture = own.expanded | found.expanded
        self.result = SearchResult(
            found.status, expansions, storage, picture, found.path, found.length
        )
        if isinstance(own, BoundedResult):
            self.result = replace(found, **vars(self.result), first_expansions=expansions)
        self.seconds_search += seconds
        self.by_heading, self.guiding_waypoints = True, ()

    def stretches(self) -> list[Int32s]:
        """Return the parts of the path found, int32 [n, 2], that may be shortened at any angle.

        Their ends are shared. A path with visits keeps these as ends; one that pays prices, or
        keeps a rule that a shorter way may break, stays as it is: no parts.
        """
        path, problem = self.result.path, self.product
        if problem is None or self.by_heading:
            return [path]
        if problem.price is not None or not all(rule.only_gains for rule in problem.automata):
            return []
        cuts = [0, *self.changes]
        ends = [*cuts[1:], len(path) - 1]
        return [path[cut : end + 1] for cut, end in zip(cuts, ends) if end > cut]

    def query(
        self, source: WaypointSource, waypoints: list[Waypoint], arrivals: deque[Float64s]
    ) -> QueryTask | None:
        """Query the source: its waypoints go to `waypoints`, or to `arrivals` while it searches.

        Returns the query in the latter case.
        """
        self.is_asked, request = True, self.request
        time_left = self.deadline - time.monotonic()
        limit = min(request.source_time_limit, SOURCE_SHARE * time_left)
        query = WaypointQuery(self.costmap, request.start, request.goal, limit, request.sample)
        if not (self.method.takes_late_waypoints and request.search_while_waiting):
            self.reply, self.seconds_source = query_source(source, query, self.stop)
            waypoints += self.check(self.reply)
            return None

        def on_reply(reply: WaypointReply) -> None:
            arrived = self.check(reply)
            if arrived:
                arrivals.append(np.array(arrived, dtype=np.float64))

        task = start_query(source, query, on_reply)
        task.wait(min(HEAD_START, limit), self.stop)
        return task

    def check(self, reply: WaypointReply) -> list[Waypoint]:
        """Check a reply's waypoints by the rules of the method; return those that it gets."""
        costmap, (start, goal) = self.costmap, (self.request.start, self.request.goal)
        is_published = self.method.as_published
        occupied = costmap.rejected_cells if is_published else costmap.blocked
        edge = PAPER_EDGE if is_published else 0
        checked = check_waypoints(reply.waypoints, occupied, costmap.components, start, edge)
        accepted = [point for point in checked if point.status is WaypointStatus.ACCEPTED]
        self.checked_waypoints, self.accepted = checked, len(accepted)
        self.guiding_waypoints = accepted
        if not is_published:
            return guiding_points(checked)
        self.guiding_waypoints = [point for point in checked if point.status in KEPT_BY_PAPER]
        return target_list(checked, start, goal)[1:]


def concatenate_results(segments: Sequence[SegmentPlanner]) -> SearchResult:
    """Return the searches of successive segments, each with a path, as one.

    Work, length, cost and lower bound add up: the cheapest path through the via points is made of
    the cheapest paths between them, so the bound of the sums is proven for the whole.
    """
    first, *others = results = [segment.result for segment in segments]
    stopped = any(result.status is SearchStatus.STOPPED for result in results)
    whole = replace(
        first,
        status=SearchStatus.STOPPED if stopped else SearchStatus.FOUND,
        expansions=sum(result.expansions for result in results),
        storage=sum(result.storage for result in results),
        expanded=reduce(np.logical_or, (result.expanded for result in results)),
        path=np.concatenate((first.path, *(result.path[1:] for result in others))),
        length=sum(result.length for result in results),
    )
    bounded = [result for result in results if isinstance(result, BoundedResult)]
    if not isinstance(whole, BoundedResult) or len(bounded) < len(results):
        return whole
    cost = sum(result.cost for result in bounded)
    lower_bound = sum(result.lower_bound for result in bounded)
    return replace(
        whole,
        cost=cost,
        lower_bound=lower_bound,
        suboptimality_bound=max(1.0, cost / lower_bound) if lower_bound else 1.0,
        first_expansions=sum(result.first_expansions for result in bounded),
        first_cost=sum(result.first_cost for result in bounded),
    )


def not_asked(request: PlanRequest, costmap: Costmap) -> WaypointReply:
    """Return the reply of a source that was not asked, which says why if there is one."""
    reason = ''
    if not uses_waypoints(request.method):
        reason = f'{request.method} uses no waypoints'
    elif request.via:
        reason = 'the via points take their place'
    elif request.start == request.goal:
        reason = 'the start is the goal'
    elif request.instruction is not None:
        reason = 'the instruction decides the route'
    elif request.source is not None and not helps_on(request.source, costmap):
        reason = SAVES_NOTHING
    return replace(NOT_ASKED, detail=reason)


def success_message(first: SegmentPlanner, result: SearchResult | None) -> str:
    """Say in one sentence what was found."""
    if result is None:
        return ''
    message = length_text(first.costmap, result.length)
    message += f', {describe_expansions(result.expansions)}'
    if isinstance(result, BoundedResult):
        is_priced = not math.isclose(result.cost, result.length, rel_tol=1e-6)
        least = 'cheapest' if is_priced else 'shortest'
        message += f', proven within {result.suboptimality_bound:.4f} of the {least}'
    if first.checked_waypoints:
        accepted = first.accepted
        message += f', {accepted} of {len(first.checked_waypoints)} waypoints accepted'
        # The search beside them was done before it came to them.
        message += ', none needed' if accepted and not first.guiding_waypoints else ''
    if first.by_heading:
        message += ', searched by heading for the footprint'
    if result.status is SearchStatus.STOPPED:
        message += '; stopped before more could be proven'
    reply, source = first.reply, first.request.source
    if reply.status not in NO_FAILURE and source is not None:
        message += f'; no waypoints from {name_of(source)}: {reply.detail} [{reply.status.value}]'
    elif reply.detail:
        message += f'; {reply.detail}'
    return message


def length_text(costmap: Costmap, length: float) -> str:
    """Return a length in cells as text, with its metres where cells have a size of their own."""
    text, metres = f'{length:.2f} cells', costmap.grid_map.resolution
    return text if metres == 1.0 else f'{metres * length:.2f} m ({text})'


def check_waypoints(
    waypoints: Sequence[Waypoint],
    occupied: Bools,
    components: Tiles | Int32s,
    start: Cell,
    edge: int = PAPER_EDGE,
) -> tuple[CheckedWaypoint, ...]:
    """Check each waypoint: inside the map, not in an obstacle, connected to the start.

    `occupied` is `Costmap.rejected_cells` for the paper's methods and `Costmap.blocked` for ours;
    `components` [height, width] numbers the connected free cells. A point within `edge` cells of
    the map's edge is out of bounds. A point between cell centres is in no cell, as in the
    published code, so it is never occupied.
    """
    height, width = occupied.shape
    component = components[start[1], start[0]]

    def status(x: float, y: float) -> WaypointStatus:
        if not (edge <= x <= width - 1 - edge and edge <= y <= height - 1 - edge):
            return WaypointStatus.OUT_OF_BOUNDS
        if x == int(x) and y == int(y) and occupied[int(y), int(x)]:
            return WaypointStatus.OCCUPIED
        if components[round(y), round(x)] not in (component, 0):
            return WaypointStatus.UNREACHABLE
        return WaypointStatus.ACCEPTED

    return tuple(CheckedWaypoint(x, y, status(x, y)) for x, y in waypoints)


def guiding_points(waypoints: Sequence[CheckedWaypoint]) -> list[Waypoint]:
    """Return the waypoints that the guided search uses: those a path can be at."""
    return [(point.x, point.y) for point in waypoints if point.status is WaypointStatus.ACCEPTED]


def target_list(waypoints: Sequence[CheckedWaypoint], start: Cell, goal: Cell) -> list[Waypoint]:
    """Build the paper's T: the waypoints not dropped, with start and goal added if missing."""
    targets: list[Waypoint] = [
        (point.x, point.y) for point in waypoints if point.status in KEPT_BY_PAPER
    ]
    if not targets or targets[0] != start:
        targets.insert(0, start)
    if targets[-1] != goal:
        targets.append(goal)
    return targets


def snap(value: float, tolerance: float = 1e-6) -> float:
    """Return the whole number within `tolerance` of a grid coordinate, else the coordinate.

    Coordinates that were converted to metres and back are off by rounding errors.
    """
    if not math.isfinite(value):
        return value
    nearest = float(round(value))
    return nearest if abs(value - nearest) <= tolerance else value
