# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plans paths on one costmap: endpoints, segments, the check, and the plan made of them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning import path_validator as validator
from llm_astar_planner.planning.endpoints import (
    blocked_message,
    goal_failure,
    moved_goal,
    moved_start,
    moved_via,
)
from llm_astar_planner.planning.segment import (
    NOT_SEARCHED,
    SegmentPlanner,
    concatenate_results,
    not_asked,
    success_message,
)
from llm_astar_planner.planning.types import (
    EXPLAINED,
    NOT_ASKED,
    PLANNED_ON,
    Endpoints,
    Plan,
    PlanningFailure,
    PlanRequest,
    ResultCode,
    check_request,
)
from llm_astar_planner.plugins import PluginError
from llm_astar_planner.search.arrays import Float64s, Int32s, StopFlag, no_stop
from llm_astar_planner.search.astar import PathTooLongError
from llm_astar_planner.search.grid_graph import SURCHARGE_ONE
from llm_astar_planner.search.landmarks import LandmarkManager
from llm_astar_planner.search.methods import EXACT, GUIDED, METHODS
from llm_astar_planner.search.result import BoundedResult, SearchResult, SearchStatus
from llm_astar_planner.waypoints.async_query import name_of

if TYPE_CHECKING:
    from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
    from llm_astar_msgs_adapter.maps.map_server import MapLike
    from typing_extensions import Self

    from llm_astar_planner.search.any_angle import AnyAnglePath
    from llm_astar_planner.search.grid_graph import GridGraph

# The part of the time for the search where a path at any angle is asked for: it takes time too.
SEARCH_SHARE = 0.9
# What each segment between via points may take: seconds, but at most this part of the time left.
LEAST_SHARE_S, LEAST_SHARE = 1.0, 0.1
# Bytes that the segments' pictures of expanded cells may take together.
MAX_PICTURES = 2**29
# The part of the time that is kept for a second search, where a footprint is given.
FIT_SHARE = 0.4
# Metres from a kink to where its arc begins, at most, as they are tried one after the other; and
# how many times longer or more expensive a path with rounded kinks may be.
TANGENTS, MOST_SMOOTHED = (1.0, 0.5, 0.25, 0.1), 1.02
NOT_SHORTENED = 'the path at any angle is left out: the footprint would meet an obstacle'
# The kinds of plans that this process has compiled.
COMPILED: set[tuple[object, ...]] = set()


class PathPlanner:
    """Plans a path through via points; `Planner` adds what else a request may ask for.

    Immutable, so safe to share between threads.
    """

    def __init__(
        self,
        grid_map: MapLike,
        config: CostmapConfig | None = None,
        barrier_map: BarrierMap | None = None,
        landmarks: LandmarkManager | None = None,
        previous: PathPlanner | None = None,
    ) -> None:
        """Take a map: a GridMap, map_server's yaml file, a PIL image, or an array of occupancy.

        `barrier_map`, if the grid was made from one, makes LLM-A* exact on it. `landmarks` keeps
        them from map to map. Of `previous`, the planner for the map before, what the two maps
        share is taken over; it stays as it is.
        """
        if not isinstance(grid_map, GridMap):
            # Nodes have one, and need no library of images for it.
            from llm_astar_msgs_adapter.maps.map_server import to_grid_map  # noqa: PLC0415

            grid_map = to_grid_map(grid_map)
        before: Costmap | None = None if previous is None else previous.costmap
        self.costmap: Costmap = Costmap(grid_map, config, barrier_map, before)
        self.grid_map = grid_map
        self.config = self.costmap.config
        self.checker = validator.CollisionChecker(grid_map, self.config)
        self.landmarks = landmarks or LandmarkManager()

    @classmethod
    def for_barrier_map(cls, barrier_map: BarrierMap) -> Self:
        """Make a planner by the paper's rules: corners may be cut, its filter is exact."""
        return cls(barrier_map.to_grid(), CostmapConfig(corner_cutting=True), barrier_map)

    def prepare(self, *, wait: bool = True) -> Self:
        """Do now what each new map needs, instead of at the first plan.

        Landmarks are measured in the background; until they are there, plans do without. `wait`
        waits for them.
        """
        self.costmap.prepare()
        self.landmarks.update(self.costmap.grid_graph)
        if wait:
            self.landmarks.wait()
        return self

    def plan(self, request: PlanRequest, stop: StopFlag | None = None) -> Plan:
        """Answer a request. Never raises for what a request, a source or a map may hold.

        Another thread cancels by setting `stop[0] = 1`: the answer is then the best path so far,
        or TIMEOUT.
        """
        *_, plan = self.plans(request, stop, anytime=False)
        # So that a notebook can draw it. Those of `plans`, which nodes keep, hold no map.
        places = None if request.instruction is None else request.instruction.places
        PLANNED_ON[plan] = self.costmap, places
        return plan

    def plans(
        self, request: PlanRequest, stop: StopFlag | None = None, *, anytime: bool = True
    ) -> Iterator[Plan]:
        """Return the plans of a request: each better one, then the answer.

        Each is validated, and made when it is asked for; the time of the request begins with the
        first. Only `guided` and plug-ins that are generators find several, and only without via
        points and instruction. `anytime` False yields the answer alone. Otherwise as `plan`.
        """
        stop = no_stop() if stop is None else stop
        asks_more = request.viapoints or request.alternatives
        asks_more = asks_more or request.instruction is not None or request.last_path is not None
        is_graded = self.costmap.grid_graph.cell_surcharge.size > 0
        has_landmarks = self.landmarks.current is not None
        kind = kind_of_plan(self.config, request, is_graded, has_landmarks)
        if asks_more or kind not in COMPILED:
            return self.more_plans(request, stop, anytime=anytime)
        return self.direct_plans(request, stop, anytime=anytime, explains=True)

    def more_plans(self, request: PlanRequest, stop: StopFlag, *, anytime: bool) -> Iterator[Plan]:
        """Return the plans of a request that asks for more than a path: here, of a path alone."""
        return self.direct_plans(request, stop, anytime=anytime, explains=True)

    def explained(self, request: PlanRequest, plan: Plan, stop: StopFlag, deadline: float) -> Plan:
        """Return a plan that says why if it has no path, or leads as near as possible if it may.

        The latter until the `deadline`, in monotonic seconds.
        """
        if plan.code not in EXPLAINED or stop[0]:
            return plan
        # Only after a failure: other plans do not need it.
        from llm_astar_planner.planning.why import explained  # noqa: PLC0415

        return explained(self.costmap, request, plan, partial(self.plan, stop=stop), deadline)

    def direct_plan(self, request: PlanRequest, stop: StopFlag) -> Plan:
        """Answer a request without an instruction."""
        *_, plan = self.direct_plans(request, stop, anytime=False)
        return plan

    def direct_plans(
        self, request: PlanRequest, stop: StopFlag, *, anytime: bool, explains: bool = False
    ) -> Iterator[Plan]:
        """Yield each better plan of a request without an instruction; `explains` a failure."""
        begin = time.monotonic()
        deadline = begin + request.time_limit
        share = SEARCH_SHARE if request.any_angle else 1.0
        fit_deadline = search_deadline = begin + share * request.time_limit
        endpoints = Endpoints(request.start, request.goal, request.via)
        segments: list[SegmentPlanner] = []
        try:
            # 1. Can the request be served, and between which cells?
            check_request(request)
            endpoints = resolve_endpoints(self.costmap, request)
            if request.footprint is not None:
                search_deadline -= FIT_SHARE * request.time_limit
                # Kernels and shapely, which plans without a footprint do not take.
                from llm_astar_planner.planning.footprint_search import collides, fit_footprint  # noqa: PLC0415
            # 2. Search the segments between the via points, with the source's waypoints.
            for segment in self.segments(request, endpoints, search_deadline, stop):
                segments.append(segment)
                for solution in segment.search():
                    if not anytime or request.via:
                        continue
                    if request.footprint and collides(self.costmap, request, solution.path):
                        continue
                    # 3. A better path, while the search goes on.
                    if self.problem(request, endpoints, solution.path) is None:
                        yield self.build_plan(request, endpoints, segments, solution)
                ended, path = segment.result.status, segment.result.path
                is_found = len(path) > 0 and ended is not SearchStatus.EXHAUSTED
                if not (is_found or ended is SearchStatus.FOUND):
                    raise no_path(request, segments)
            if request.footprint is not None:
                fit_deadline = max(fit_deadline, begin + request.first_path_time_limit)
                endpoints = fit_footprint(self.costmap, request, endpoints, segments, fit_deadline)
            # 4. Only a path that passes the independent check leaves.
            result = concatenate_results(segments) if request.via else segment.result
            problem = self.problem(request, endpoints, result.path)
            if problem is not None:
                message = f'the path found was withheld: {problem}'
                raise PlanningFailure(ResultCode.UNKNOWN, message)
            plan = self.build_plan(request, endpoints, segments, result, deadline=deadline)
        except (PlanningFailure, PathTooLongError, PluginError) as failure:
            plan = self.build_plan(request, endpoints, segments, failure=failure)
            if explains:
                plan = self.explained(request, plan, stop, deadline)
        yield plan

    def segments(
        self, request: PlanRequest, endpoints: Endpoints, deadline: float, stop: StopFlag
    ) -> Iterator[SegmentPlanner]:
        """Yield a planner for each segment between start, via points and goal, in order.

        Of the time left a segment gets its share, half of it in equal parts and half by straight
        length, and never less than a moment. With via points no source is asked: they are the
        waypoints. Of very many segments on a large map there are no pictures of expanded cells.
        """
        cells = [endpoints.start, *endpoints.via, endpoints.goal]
        lengths = list(map(math.dist, cells[:-1], cells[1:]))
        average = 1.0 + sum(lengths) / len(lengths)
        shares_left = sum(lengths) + len(lengths) * average
        source = None if request.via else request.source
        is_whole = cells == [request.start, request.goal]
        drawn = request.want_expanded and len(lengths) * self.grid_map.cells.size <= MAX_PICTURES
        graph = self.costmap.grid_graph
        for start, goal, length in zip(cells[:-1], cells[1:], lengths):
            now = time.monotonic()
            share = (deadline - now) * (average + length) / shares_left
            shares_left -= average + length
            # One of many segments must not fail because its thread had to wait for a moment.
            time_left = max(share, min(LEAST_SHARE_S, LEAST_SHARE * (deadline - now)))
            part = request
            if not is_whole:
                part = replace(
                    request, start=start, goal=goal, via=(), source=source, want_expanded=drawn
                )
            # Lent out, the landmarks stay as they are while the segment is searched.
            lent = self.landmarks.lend(graph) if request.method == GUIDED else nullcontext()
            with lent as landmarks:
                yield SegmentPlanner(self.costmap, part, now + time_left, stop, landmarks)

    def problem(self, request: PlanRequest, endpoints: Endpoints, path: Int32s) -> str | None:
        """Say why a path does not answer the request, or None: the last check."""
        start, goal = endpoints.start, endpoints.goal
        names = ['start', 'goal', *['via point'] * len(request.via)]
        asked = request.start, request.goal, *request.via
        for name, requested, used in zip(names, asked, (start, goal, *endpoints.via)):
            if used != requested:
                tolerance = request.start_tolerance if name == 'start' else request.tolerance
                limit = tolerance / self.grid_map.resolution
                problem = validator.shift_problem(name, requested, used, limit)
                if problem is not None:
                    return problem
        problem = self.checker.path_problem(path, start, goal)
        if problem is None and request.via:
            problem = validator.via_problem(path, endpoints.via)
        if problem is None and request.footprint is not None:
            problem = validator.footprint_problem(path, self.costmap, request)
        return problem

    def build_plan(
        self,
        request: PlanRequest,
        endpoints: Endpoints,
        segments: Sequence[SegmentPlanner],
        result: SearchResult | None = None,
        *,
        failure: Exception | None = None,
        deadline: float = math.inf,
    ) -> Plan:
        """Build every plan: from a valid result, a better path on the way, or a failure.

        What cannot be computed until the `deadline` (monotonic seconds) is left out.
        """
        warnings, first = endpoints.warnings, segments[0] if segments else None
        if result is None:
            fields = self.search_fields(request, segments)
        else:
            fields = self.path_fields(segments, result)
            if request.any_angle and fields['is_final']:
                parts = [
                    (segment.costmap.grid_graph, stretch)
                    for segment in segments
                    for stretch in segment.stretches()
                ]
                fields['any_angle'], problem = self.shorten(request, parts, deadline)
                warnings = (*warnings, problem) if problem else warnings
            if request.smoothing and fields['is_final']:
                shortened = fields.get('any_angle')
                points = result.path if shortened is None else shortened.points
                fields['smoothed'] = self.smooth(request, endpoints, points)
        # Where there are via points, no source is asked.
        reply = first.reply if first else NOT_ASKED
        if request.source is not None and not (first and first.is_asked):
            reply = not_asked(request, self.costmap)
        if first and first.checked_waypoints:
            fields['checked_waypoints'] = first.checked_waypoints
            fields['guided_by'] = first.reply.label if first.guiding_waypoints else 'none'
        return Plan(
            code=getattr(failure, 'code', ResultCode.UNKNOWN) if failure else ResultCode.NONE,
            message=str(failure) if failure else success_message(segments[0], result),
            method=request.method, start=endpoints.start, goal=endpoints.goal,
            source='none' if request.source is None else name_of(request.source), reply=reply,
            seconds_source=sum(map(attrgetter('seconds_source'), segments), 0.0),
            seconds_search=sum(map(attrgetter('seconds_search'), segments), 0.0),
            start_shift=endpoints.start_shift, goal_shift=endpoints.goal_shift, via=endpoints.via,
            footprint=request.footprint, warnings=warnings, **fields,
        )  # fmt: skip

    def search_fields(
        self, request: PlanRequest, segments: Sequence[SegmentPlanner]
    ) -> dict[str, Any]:
        """Return the fields of a plan that has no path, by name."""
        results = [part.result for part in segments if part.result is not NOT_SEARCHED]
        expanded = results[-1].expanded if results else NOT_SEARCHED.expanded
        if request.want_expanded and expanded.size == 0:
            expanded = np.zeros(self.grid_map.cells.shape, dtype=np.bool_)
        return {
            'expansions': sum(result.expansions for result in results),
            'storage': sum(result.storage for result in results),
            'expanded': expanded,
        }

    def path_fields(
        self, segments: Sequence[SegmentPlanner], result: SearchResult
    ) -> dict[str, Any]:
        """Return the fields of a plan that has a path, by name."""
        bounded = result if isinstance(result, BoundedResult) else None
        return {
            'path': result.path, 'length': result.length,
            'cost': bounded.cost if bounded else result.length,
            'suboptimality_bound': bounded.suboptimality_bound if bounded else math.nan,
            'expansions': result.expansions,
            'first_expansions': bounded.first_expansions if bounded else result.expansions,
            'storage': result.storage, 'expanded': result.expanded,
            'is_final': segments[-1].result is not NOT_SEARCHED,
            **self.checker.measure(result.path)._asdict(),
        }  # fmt: skip

    def shorten(
        self, request: PlanRequest, stretches: Sequence[tuple[GridGraph, Int32s]], deadline: float
    ) -> tuple[AnyAnglePath | None, str]:
        """Shorten each part of a path at any angle until the deadline, and say what went wrong.

        None, with a warning or '', where there is nothing to shorten or the check finds a problem.
        """
        # Kernels that only these plans take.
        from llm_astar_planner.search.any_angle import AnyAnglePath, pullable_parts, string_pull  # noqa: PLC0415

        try:
            parts = [
                string_pull(*piece, deadline=deadline)
                for graph, part in stretches
                for piece in pullable_parts(graph, part, self.grid_map.forbidden)
            ]
        except TimeoutError as error:
            return None, str(error)
        if not parts:
            return None, ''
        points = np.concatenate([parts[0].points, *(part.points[1:] for part in parts[1:])])
        length, cost = sum(part.length for part in parts), sum(part.cost for part in parts)
        return self.checked(request, AnyAnglePath(points, length, cost))

    def checked(self, request: PlanRequest, path: AnyAnglePath) -> tuple[AnyAnglePath | None, str]:
        """Return a path at any angle, or None, with a warning or '', where it is not valid."""
        points = path.points
        if self.checker.segments_problem(points) is not None:
            return None, ''
        if request.footprint is not None and self.straight_problem(request, points):
            return None, NOT_SHORTENED
        return path, ''

    def smooth(
        self, request: PlanRequest, endpoints: Endpoints, points: Int32s
    ) -> Float64s | None:
        """Round the kinks of a valid path of straight lines through cells [n, 2].

        Arcs get smaller until the whole is valid and neither longer nor more expensive than
        MOST_SMOOTHED times the path; None where no size will do.
        """
        # What plans without it do not take.
        from llm_astar_planner.planning.smoothing import smoothed  # noqa: PLC0415
        from llm_astar_planner.search.any_angle import interpolate, turning_points  # noqa: PLC0415

        before = curve_measures(self.costmap, interpolate(points))
        kinks, via = turning_points(points), frozenset(endpoints.via)
        for metres in TANGENTS:
            longest = max(1.0, metres / self.grid_map.resolution)
            curve = smoothed(kinks, self.checker.is_free_curve, longest, via)
            now = curve_measures(self.costmap, curve)
            is_short = all(new <= MOST_SMOOTHED * old for new, old in zip(now, before))
            if is_short and self.curve_problem(request, endpoints, curve) is None:
                return curve
        return None

    def curve_problem(
        self, request: PlanRequest, endpoints: Endpoints, curve: Float64s
    ) -> str | None:
        """Say why a path of points [n, 2] at most a cell apart does not answer the request."""
        same_ends = replace(
            request, start=endpoints.start, goal=endpoints.goal, via=endpoints.via, footprint=None
        )
        problem = self.problem(same_ends, endpoints, validator.curve_cells(curve))
        if problem is not None or request.footprint is None:
            return problem
        return self.straight_problem(request, curve)

    def straight_problem(self, request: PlanRequest, points: NDArray[Any]) -> str | None:
        """Say that the footprint of a request meets an obstacle on straight lines, or None."""
        # Kernels and shapely, which plans without a footprint do not take.
        from llm_astar_planner.planning.footprint_search import collides  # noqa: PLC0415
        from llm_astar_planner.search.any_angle import interpolate  # noqa: PLC0415

        if collides(self.costmap, request, points):
            return 'the footprint would meet an obstacle'
        return validator.footprint_problem(interpolate(points), self.costmap, request)


def resolve_endpoints(costmap: Costmap, request: PlanRequest) -> Endpoints:
    """Return the cells to plan between. Raises PlanningFailure if start, goal or via cannot be."""
    components, start, goal, via = costmap.components, request.start, request.goal, request.via
    if not components.at(start):
        start = moved_start(costmap, request)
    # Where rules of the road cut a stretch between many via points off, its search finds out.
    if costmap.grid_map.forbidden.size and not via:
        components = costmap.reached(start)
    component = components.at(start)
    if components.at(goal) != component:
        goal = moved_goal(costmap, request, goal, (components, component))
    if via:
        via = tuple(
            cell
            if components.at(cell) == component
            else moved_goal(costmap, request, cell, (components, component), f'via {number}')
            for number, cell in enumerate(via, start=1)
        )
    if (start, goal, via) == (request.start, request.goal, request.via):
        return Endpoints(start, goal, via)
    resolution = costmap.grid_map.resolution
    start_shift = math.dist(request.start, start) * resolution
    goal_shift = math.dist(request.goal, goal) * resolution
    warnings = []
    if start != request.start:
        message = blocked_message(costmap, 'start', request.start)
        begin = costmap.describe_cell(start)
        warnings.append(f'{message}; the path begins at {begin}, {start_shift:.2f} m off')
    if via != request.via:
        warnings.append(moved_via(costmap, request, via))
    if goal != request.goal:
        failure, end = goal_failure(costmap, request, request.goal), costmap.describe_cell(goal)
        warnings.append(f'{failure}; the path ends at {end}, {goal_shift:.2f} m off')
    return Endpoints(start, goal, via, start_shift, goal_shift, tuple(warnings))


def curve_measures(costmap: Costmap, curve: Float64s) -> tuple[float, float]:
    """Return length and cost, in cells, of points at most a cell apart."""
    lengths = np.hypot(*np.diff(curve, axis=0).T)
    surcharge = costmap.grid_graph.cell_surcharge
    if not surcharge.size:
        return float(lengths.sum()), float(lengths.sum())
    x, y = np.floor((curve[1:] + curve[:-1]) / 2.0 + 0.5).astype(np.int64).T
    prices = 1.0 + surcharge[y * costmap.grid_map.width + x] / SURCHARGE_ONE
    return float(lengths.sum()), float((lengths * prices).sum())


def no_path(request: PlanRequest, segments: Sequence[SegmentPlanner]) -> PlanningFailure:
    """Return why there is no path: the search of the last segment ended without one."""
    via = [f'via {number}' for number in range(1, len(request.via) + 1)]
    names = ['the start', *via, 'the goal']
    expansions = sum(segment.result.expansions for segment in segments)
    return segments[-1].failure(expansions, *names[len(segments) - 1 : len(segments) + 1])


def kind_of_plan(
    config: CostmapConfig, request: PlanRequest, is_graded: bool, has_landmarks: bool
) -> tuple[object, ...]:
    """Return what decides which kernels a plan takes, for `planning.compile`.

    `is_graded`: costs are not uniform on the map. `has_landmarks`: there are some.
    """
    is_guided, has_source = request.method == GUIDED, request.source is not None
    return (
        config.has_radius, is_graded, request.method if request.method in METHODS else EXACT,
        has_source or bool(request.viapoints), has_landmarks and is_guided, request.any_angle,
        bool(request.via), request.footprint is None, request.instruction is None,
    )  # fmt: skip
