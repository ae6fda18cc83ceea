# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What of an earlier plan still holds on a changed map: its way, its path, its waypoints.

The way of the last plan to a goal is kept while a new path would gain too little. The rest of it,
from the robot on, is held against the newest map by the check of every path, priced on it exactly,
and compared with the path of the new search.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Hashable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.caches import Recent
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.planning._kernels.path_checks import nearest_places, passed_cells
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_planner import PathPlanner
from llm_astar_planner.planning.path_validator import via_problem
from llm_astar_planner.planning.segment import length_text
from llm_astar_planner.planning.types import (
    Endpoints,
    LastPath,
    Plan,
    PlanRequest,
    ResultCode,
    WaypointStatus,
    describe_expansions,
)
from llm_astar_planner.search.arrays import Bools, Int32s, Int64s, StopFlag
from llm_astar_planner.search.grid_graph import path_cost, path_length
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

if TYPE_CHECKING:
    from llm_astar_planner.instructions.interpretation import RouteInstruction
    from llm_astar_planner.search.any_angle import AnyAnglePath

# Goals whose last ways are remembered.
REMEMBERED_GOALS = 64
# How far a robot may be off its last way and still be taken to follow it: cells, metres.
OFF_CELLS, OFF_METRES = 3.0, 0.5
# A path that is nowhere so far from the last way is no other way: the cheaper one is taken.
SAME_WAY_METRES = 1.0
# The part of a request's time that a path at any angle along the kept way may take.
PULL_SHARE = 0.1
# How many cells a robot may be off an earlier path and still count as following it.
MAX_DEVIATION = 3.0
# Goals whose waypoints are cached.
CACHED_GOALS = 64
# Costs that differ by less, in cells, are the same.
SAME_COST = 1e-6


class PathLost(LlmAstarError):  # noqa: N818 - an outcome, not a bug
    """Why the last way is not kept, as a report says it."""


class PathHistory:
    """Remembers the last way by a key: a client and its goal. Thread-safe."""

    def __init__(self) -> None:
        """Remember nothing yet."""
        self._lock = threading.Lock()
        self._ways: Recent[Hashable, LastPath] = Recent(REMEMBERED_GOALS)

    def add_to(self, request: PlanRequest, key: Hashable) -> PlanRequest:
        """Return the request with the last way of a key, if there is one to keep."""
        if not request.switch_margin:
            return request
        with self._lock:
            return replace(request, last_path=self._ways.get(key))

    def remember(self, plan: Plan, request: PlanRequest, key: Hashable, costmap: Costmap) -> None:
        """Remember the way of a plan; one without a path changes nothing."""
        if request.switch_margin and plan.code is ResultCode.NONE:
            way = way_of(plan, costmap)
            with self._lock:
                self._ways[key] = way

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._ways.clear()


def way_of(plan: Plan, costmap: Costmap) -> LastPath:
    """Return the way of a plan that has a path: the cells along what was published."""
    cells, turns = plan.path, np.zeros(0, dtype=np.int64)
    if plan.any_angle is not None:
        parts = lines_along(plan.any_angle.points, costmap.blocked)
        cells = np.concatenate(parts)
        turns = np.cumsum([len(part) for part in parts]) - 1
    ((x, y),) = costmap.grid_map.grid_to_world([(0, 0)]).tolist()
    return LastPath(cells, turns, (x, y), frame_of(costmap.grid_map))


def frame_of(grid_map: GridMap) -> tuple[float, float, str]:
    """Return what two maps share if the cells of one are those of the other, moved along."""
    return grid_map.resolution, grid_map.origin.yaw, grid_map.frame_id


def kept_plans(
    planner: PathPlanner,
    request: PlanRequest,
    way: LastPath,
    plans: Iterator[Plan],
    stop: StopFlag,
) -> Iterator[Plan]:
    """Yield the plans of a request; of the answer, which is the last, the way is kept if it can.

    The answer's message says so, or why the way has changed. A request that was stopped, or that
    has no path for another reason than its time, is answered as it is.
    """
    for plan in plans:
        is_answer = plan.is_final and not stop[0]
        if not is_answer or plan.code not in (ResultCode.NONE, ResultCode.TIMEOUT):
            yield plan
            continue
        deadline = time.monotonic() + PULL_SHARE * request.time_limit
        # The ends of the plan were judged when they were moved.
        asked = replace(request, start=plan.start, goal=plan.goal, via=plan.via)
        try:
            yield PathKeeper(planner, asked, plan, deadline).keep(way)
        except PathLost as lost:
            yield replace(plan, message=f'{plan.message}; changed: {lost}')


class PathKeeper(NamedTuple):
    """Decides for the plan of a request between its ends whether the last way is kept instead.

    The plan has a path or is out of time. At any angle, the way is shortened until the `deadline`
    (monotonic seconds).
    """

    planner: PathPlanner
    request: PlanRequest
    plan: Plan
    deadline: float

    @property
    def ends(self) -> Endpoints:
        """The ends of the plan."""
        return Endpoints(self.plan.start, self.plan.goal, self.plan.via)

    def keep(self, way: LastPath) -> Plan:
        """Return the plan that keeps the rest of a way. Raises PathLost."""
        planner, costmap = self.planner, self.planner.costmap
        cells, turns = rest_of_way(costmap, way, self.plan)
        problem = self.problem(cells)
        if problem is not None:
            raise PathLost(problem)
        kept = replace(
            self.plan, code=ResultCode.NONE, path=cells, length=path_length(cells),
            cost=path_cost(costmap.grid_graph, cells), any_angle=self.straightened(cells, turns),
            **planner.checker.measure(cells)._asdict(),
        )  # fmt: skip
        if self.request.smoothing:
            points = cells if kept.any_angle is None else kept.any_angle.points
            kept = replace(kept, smoothed=planner.smooth(self.request, self.ends, points))
        if self.request.instruction is None:
            return self.compared(kept)
        return self.instructed(kept, self.request.instruction)

    def problem(self, cells: Int32s) -> str | None:
        """Say why a path [n, 2] is no answer on this map, or None."""
        request = self.request
        problem = self.planner.problem(request, self.ends, cells)
        if problem is None and request.footprint is not None:
            # Kernels that plans without a footprint do not take.
            from llm_astar_planner.planning.footprint_search import collides  # noqa: PLC0415

            if collides(self.planner.costmap, request, cells):
                problem = 'the footprint would meet an obstacle'
        return problem

    def straightened(self, cells: Int32s, turns: Int32s) -> AnyAnglePath | None:
        """Return the path [n, 2] at any angle, if that is asked for: as it was, through `turns`.

        Where the robot does not get to the first turn on a straight line it is shortened again.
        With an instruction there is one only where the plan has one.
        """
        has_one = self.plan.any_angle is not None or self.request.instruction is None
        if not (self.request.any_angle and has_one):
            return None
        # Kernels that only these plans take.
        from llm_astar_planner.search.any_angle import straight_path  # noqa: PLC0415

        graph = self.planner.costmap.grid_graph
        if len(turns):
            path = straight_path(graph, np.concatenate((cells[:1], turns)))
            kept = None if path is None else self.planner.checked(self.request, path)[0]
            if kept is not None:
                return kept
        parts = [(graph, part) for part in between_via(cells, self.request.via)]
        return self.planner.shorten(self.request, parts, self.deadline)[0]

    def compared(self, kept: Plan) -> Plan:
        """Return the plan of the kept way with what is known of its cost.

        It is the new plan itself where that is cheaper and goes the same way. Raises PathLost if
        the path of another way costs less by more than the margin.
        """
        plan, graph = self.plan, self.planner.costmap.grid_graph
        longer, shorter = ('longer', 'shorter') if graph.cost is None else ('costlier', 'cheaper')
        found, ratio = 'no better one in time', math.nan
        if plan.code is ResultCode.NONE:
            new_cost, cost = path_cost(graph, plan.path), kept.cost
            if plan.any_angle is not None and kept.any_angle is not None:
                new_cost, cost = plan.any_angle.cost, kept.any_angle.cost
            if cost > new_cost + SAME_COST and self.is_same_way(kept):
                found = f'{100.0 * (1.0 - new_cost / cost):.1f} % {shorter} on the same way'
                return replace(plan, message=f'{plan.message}; kept: {found}')
            if cost > (1.0 + self.request.switch_margin) * new_cost + SAME_COST:
                raise PathLost(f'{100.0 * (1.0 - new_cost / cost):.1f} % {shorter}')
            more = max(0.0, cost / new_cost - 1.0) if new_cost else 0.0
            found = f'{100.0 * more:.1f} % {longer} than the best found'
            # What the search has proven is of paths of cells without an instruction.
            if self.request.instruction is None and plan.cost > 0.0:
                ratio = max(1.0, kept.cost * plan.suboptimality_bound / plan.cost)
            if kept.any_angle is None and math.isfinite(ratio):
                found = f'at most {100.0 * (ratio - 1.0):.1f} % {longer} than the best'
        text = length_text(self.planner.costmap, kept.length)
        message = f'{text}, {describe_expansions(plan.expansions)}; kept: {found}'
        return replace(kept, suboptimality_bound=ratio, message=message)

    def is_same_way(self, kept: Plan) -> bool:
        """Tell whether the new path is beside the kept one all along; not with an instruction."""
        cells = self.plan.path[::4]
        beside = kept.path[nearest_places(kept.path, cells.astype(float))]
        away = np.hypot(*(beside - cells).T).max()
        is_beside = away * self.planner.grid_map.resolution < SAME_WAY_METRES
        return bool(is_beside and self.request.instruction is None)

    def instructed(self, kept: Plan, instruction: RouteInstruction) -> Plan:
        """Return the plan of the kept way with what became of the instruction on it.

        Raises PathLost if the new plan keeps to the instruction better, or costs too much less.
        """
        # Many modules, which plans without an instruction do not need.
        from llm_astar_planner.instructions.outcome import ClauseStatus  # noqa: PLC0415
        from llm_astar_planner.instructions.route import Route  # noqa: PLC0415
        from llm_astar_planner.planning import instruction as instructed  # noqa: PLC0415

        plan, before = self.plan, self.plan.instruction
        places, driven = instruction.places, instruction.driven
        route = Route(self.planner.costmap, plan.start, plan.goal, places, driven)
        note = '' if before is None else before.note
        kept, outcome = instructed.verified(kept, route, instruction, note, self.deadline)
        pairs = list(zip(before.clauses if before else (), outcome.clauses))
        for new, old in pairs:
            most = (1.0 + self.request.switch_margin) * new.measured + SAME_COST
            if old.measured > most or old.status not in (ClauseStatus.KEPT, new.status):
                raise PathLost(f'"{new.clause.sentence()}" is {new.status.value} now')
        problem = instructed.required_problem(outcome) if instruction.policy == REQUIRE else None
        if problem is not None:
            raise PathLost(problem)
        if pairs:
            clauses = tuple(instructed.with_price(old, new.price) for new, old in pairs)
            outcome = replace(outcome, clauses=clauses)
        return instructed.with_outcome(self.compared(kept), outcome)


def rest_of_way(costmap: Costmap, way: LastPath, plan: Plan) -> tuple[Int32s, Int32s]:
    """Return the cells [n, 2] of a way that are left to a plan's goal, and the turns [m, 2] ahead.

    The cells begin at the plan's start: a robot beside the way joins it by a straight line. Raises
    PathLost.
    """
    if frame_of(costmap.grid_map) != way.frame:
        raise PathLost('the map has another resolution or frame')
    cells = (way.cells + costmap.grid_map.world_to_cells([way.first])[0]).astype(np.int32)
    if tuple(cells[-1].tolist()) != plan.goal:
        raise PathLost('it ends at another cell')
    away = np.hypot(*(cells - plan.start).T)
    metres, nearest = costmap.grid_map.resolution, float(away.min())
    if nearest > max(OFF_CELLS, OFF_METRES / metres):
        raise PathLost(f'the robot is {nearest * metres:.2f} m off the last way')
    rest, join, ahead = cells, cells[:0], 0
    for place in places_near(away, nearest):
        ahead = min(place + math.ceil(2.0 * nearest), len(cells) - 1)
        rest = cells[ahead:]
        join = cells_along(np.array([plan.start, rest[0]]), costmap.blocked)[:-1]
        if via_problem(rest, plan.via) is None:
            break
    x, y = np.concatenate((join, rest)).T
    height, width = costmap.blocked.shape
    off = (x < 0) | (y < 0) | (x >= width) | (y >= height)
    wrong = off | costmap.blocked[y.clip(0, height - 1), x.clip(0, width - 1)]
    if wrong.any():
        n = int(wrong.argmax())
        ((east, north),) = costmap.grid_map.grid_to_world([(x[n], y[n])]).tolist()
        raise PathLost(f'blocked at ({east:.2f}, {north:.2f})')
    return np.column_stack((x, y)).astype(np.int32), cells[way.turns[way.turns > ahead]]


def places_near(away: NDArray[np.float64], nearest: float) -> Iterator[int]:
    """Yield where a way passes a robot, last first, of the distances [n] of its cells to it.

    A way through via points may pass the same place several times.
    """
    near = np.flatnonzero(away <= nearest + 1.0)
    for passage in reversed(np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)):
        yield int(passage[away[passage].argmin()])


def between_via(cells: Int32s, via: tuple[Cell, ...]) -> list[Int32s]:
    """Cut a path [n, 2] at the via points that it passes in turn; the parts share their ends."""
    cuts = [0]
    for cell in via:
        cuts.append(cuts[-1] + int((cells[cuts[-1] :] == cell).all(axis=1).argmax()))
    cuts.append(len(cells) - 1)
    return [cells[begin : end + 1] for begin, end in pairwise(cuts)]


def cells_along(points: NDArray[np.integer[Any]], blocked: Bools) -> Int32s:
    """Return a path of single moves [n, 2] along straight lines between cells `points` [m, 2].

    It keeps to the cells that the lines cross, and goes diagonally where both cells beside are
    free in `blocked` [height, width]; so it is legal where the lines are.
    """
    return np.concatenate(lines_along(points, blocked))


def lines_along(points: NDArray[np.integer[Any]], blocked: Bools) -> list[Int32s]:
    """Return the first point, and for each line the cells [n, 2] that `cells_along` adds."""
    corners = np.asarray(points, dtype=np.int64)
    parts = [corners[:1], *(line_cells(*ends, blocked)[1:] for ends in pairwise(corners))]
    return [part.astype(np.int32) for part in parts]


def line_cells(begin: Int64s, end: Int64s, blocked: Bools) -> Int64s:
    """Return the cells [n, 2] from one to another, as `cells_along` does."""
    cells, counts = passed_cells(begin, end), np.abs(end - begin)
    # Each move along the shorter side follows one along the longer: both are one if they may be.
    short = int(counts[1] <= counts[0])
    moves = np.diff(cells, axis=0)
    turns = 1 + np.flatnonzero((moves[1:, 1 - short] == 0) & (moves[:-1, short] == 0))
    height, width = blocked.shape
    x, y = (cells[turns - 1] + moves[turns]).T
    beside = blocked[y.clip(0, height - 1), x.clip(0, width - 1)]
    return np.delete(cells, turns[~beside], axis=0)


def reuse_problem(
    plan: Plan, grid_map: GridMap, planner: PathPlanner, footprint: Footprint | None = None
) -> str | None:
    """Say why a plan made on `grid_map` cannot be kept on the planner's map, or None.

    It can be kept if both maps have their cells at the same places and its path, the any-angle
    one too, is still valid, also for the `footprint`.
    """
    if grid_map.layout != planner.grid_map.layout:
        return 'the map has another size, resolution, origin or frame'
    problem = planner.checker.path_problem(plan.path, plan.start, plan.goal)
    if problem is None and plan.any_angle is not None:
        problem = planner.checker.segments_problem(plan.any_angle.points)
    if problem is None and footprint is not None:
        # Kernels that plans without a footprint do not take.
        from llm_astar_planner.planning.footprint_search import FootprintChecker  # noqa: PLC0415

        points = plan.path if plan.any_angle is None else plan.any_angle.points
        if FootprintChecker(planner.costmap, footprint).path_collides(points):
            return f'the footprint ({footprint}) meets an obstacle on it'
    return problem


class CachedWaypoints(NamedTuple):
    """The waypoints as the source gave them, the path they led to, and the map they were for.

    Of the map only its digest and where its cells lie is kept, without the cells themselves.
    """

    reply: WaypointReply
    path: Int32s
    digest: str
    layout: tuple[object, ...]


class WaypointCache:
    """The last good waypoints of goals from one source, while they hold. Thread-safe.

    They hold if all were accepted, all are still free and reachable on the current map, and the
    start lies along the path they led to; those that the robot has passed are left out. The very
    same query on the very same map is left to the source.
    """

    def __init__(self, source: str) -> None:
        """Start empty; `source` is the name of the source."""
        self._source = source
        self._lock = threading.Lock()
        self._cached: Recent[Cell, CachedWaypoints] = Recent(CACHED_GOALS)
        self._cleared = -math.inf

    def find(self, query: WaypointQuery) -> WaypointReply | None:
        """Return the reply with the waypoints that hold, None where the source is to be asked."""
        with self._lock:
            cached = self._cached.get(query.goal)
        if cached is None or cached.layout != query.grid_map.layout:
            return None
        place, distance = nearest_on_path(cached.path, query.start)
        waypoints = tuple(
            point
            for point in cached.reply.waypoints
            if place == 0 or nearest_on_path(cached.path, point)[0] > place
        )
        components = query.costmap.components
        here = components.at(query.start)
        cells = [(round(x), round(y)) for x, y in waypoints]
        holds = here > 0 and all(components.at(cell) == here for cell in cells)
        is_same_map = cached.digest == query.grid_map.digest
        is_same_query = is_same_map and waypoints == cached.reply.waypoints
        if is_same_query or not holds or distance > MAX_DEVIATION:
            return None
        detail = f'kept from the plan on map {cached.digest}'
        return replace(
            cached.reply, waypoints=waypoints, detail=detail, prompt_tokens=0,
            completion_tokens=0, seconds=0.0,
        )  # fmt: skip

    def clear(self) -> None:
        """Drop everything: the source may answer differently from now on."""
        with self._lock:
            self._cleared = time.monotonic()
            self._cached.clear()

    def remember(self, plan: Plan, grid_map: GridMap, started: float) -> None:
        """Cache the waypoints of a plan if every one of them was accepted.

        Results that started (monotonic seconds) before the cache was cleared are discarded.
        """
        good = plan.code is ResultCode.NONE and plan.source_status is SourceStatus.OK
        if plan.source != self._source:
            return  # the request's own via points
        accepted = all(point.status is WaypointStatus.ACCEPTED for point in plan.checked_waypoints)
        if not (good and plan.checked_waypoints and accepted):
            return
        cached = CachedWaypoints(plan.reply, plan.path, grid_map.digest, grid_map.layout)
        with self._lock:
            if started > self._cleared:
                self._cached[plan.goal] = cached


def nearest_on_path(path: Int32s, point: tuple[float, float]) -> tuple[int, float]:
    """Return the index of a path's cell [n, 2] nearest to a point, and the distance in cells."""
    place = int(nearest_places(path, np.array([point], dtype=np.float64))[0])
    return place, math.dist(path[place], point)
