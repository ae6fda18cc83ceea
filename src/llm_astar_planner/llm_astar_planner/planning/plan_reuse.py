# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What of an earlier plan still holds on a changed map: its path, its waypoints."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass, replace

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.caches import Recent
from llm_astar_planner.planning._kernels.path_checks import nearest_places
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.footprint_search import FootprintChecker
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, ResultCode, WaypointStatus
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
)

# How many cells a robot may be off an earlier path and still count as following it.
MAX_DEVIATION = 3.0
# Goals whose waypoints are cached.
CACHED_GOALS = 64


def reuse_problem(
    plan: Plan, grid_map: GridMap, planner: Planner, footprint: Footprint | None = None
) -> str | None:
    """Say why a plan made on `grid_map` cannot be kept on the planner's map, or None.

    It can be kept if both maps have their cells at the same places and its path, the any-angle
    one too, is still valid, also for the `footprint`.
    """
    if not grid_map.is_laid_out_as(planner.grid_map):
        return 'the map has another size, resolution, origin or frame'
    problem = planner.checker.path_problem(plan.path, plan.start, plan.goal)
    if problem is None and plan.any_angle is not None:
        problem = planner.checker.segments_problem(plan.any_angle.points)
    if problem is None and footprint is not None:
        points = plan.path if plan.any_angle is None else plan.any_angle.points
        if FootprintChecker(planner.costmap, footprint).path_collides(points):
            return f'the footprint ({footprint}) meets an obstacle on it'
    return problem


@dataclass(frozen=True)
class CachedWaypoints:
    """The waypoints as the source gave them, the map they were for, and the path they led to.

    Of the map only its digest and where its cells lie is kept, without the cells themselves.
    """

    digest: str
    layout: tuple[object, ...]
    reply: WaypointReply
    path: NDArray[np.int32]

    def ahead_of(self, start: Cell) -> tuple[Waypoint, ...] | None:
        """Return the waypoints not passed by a robot at `start`; None if it is off the path."""
        place, distance = nearest_on_path(self.path, start)
        if distance > MAX_DEVIATION:
            return None
        if place == 0:
            return self.reply.waypoints
        return tuple(
            point for point in self.reply.waypoints if nearest_on_path(self.path, point)[0] > place
        )

    def can_reach(self, waypoints: tuple[Waypoint, ...], query: WaypointQuery) -> bool:
        """Tell whether every waypoint is still free and reachable from the query's start."""
        components = query.costmap.components
        here = components.at(query.start)
        return (
            self.layout == query.grid_map.layout
            and here > 0
            and all(components.at((round(x), round(y))) == here for x, y in waypoints)
        )


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
        waypoints = None if cached is None else cached.ahead_of(query.start)
        if cached is None or waypoints is None:
            return None
        is_same_map = cached.digest == query.grid_map.digest
        is_same_query = is_same_map and waypoints == cached.reply.waypoints
        if is_same_query or not cached.can_reach(waypoints, query):
            return None
        return replace(
            cached.reply,
            waypoints=waypoints,
            detail=f'kept from the plan on map {cached.digest}',
            prompt_tokens=0,
            completion_tokens=0,
            seconds=0.0,
        )

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
        cached = CachedWaypoints(grid_map.digest, grid_map.layout, plan.reply, plan.path)
        with self._lock:
            if started > self._cleared:
                self._cached[plan.goal] = cached


def nearest_on_path(path: NDArray[np.int32], point: tuple[float, float]) -> tuple[int, float]:
    """Return the index of a path's cell [n, 2] nearest to a point, and the distance in cells."""
    place = int(nearest_places(path, np.array([point], dtype=np.float64))[0])
    return place, math.dist(path[place], point)
