"""What of an earlier plan still holds on a changed map: its path, its waypoints."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from cachetools import LRUCache
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from numpy.typing import NDArray

from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode
from llm_astar_planner.planning.waypoint_filter import WaypointStatus
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

# How many cells a robot may be off an earlier path and still count as following it.
MAX_DEVIATION = 3.0
# Goals whose waypoints are cached.
CACHED_GOALS = 64


class MapPlacement(NamedTuple):
    """Which map a plan was made on and where its cells lie, without the cells themselves."""

    digest: str
    shape: tuple[int, ...]
    resolution: float
    origin: Pose2D
    frame_id: str

    @classmethod
    def of(cls, grid_map: GridMap) -> MapPlacement:
        """Return the placement of a map."""
        shape, resolution = grid_map.cells.shape, grid_map.resolution
        return cls(grid_map.digest, shape, resolution, grid_map.origin, grid_map.frame_id)

    def matches(self, grid_map: GridMap) -> bool:
        """Tell whether each cell is at the same place on both maps."""
        return self[1:] == MapPlacement.of(grid_map)[1:]


def reuse_problem(plan: Plan, grid_map: GridMap, planner: Planner) -> str | None:
    """Say why a plan made on `grid_map` cannot be kept on the planner's map, or None.

    It can be kept if both maps have their cells at the same places and its path, the any-angle
    one too, is still valid.
    """
    if not MapPlacement.of(grid_map).matches(planner.grid_map):
        return 'the map has another size, resolution, origin or frame'
    problem = planner.path_problem(plan.path, plan.start, plan.goal)
    if problem is None and plan.any_angle is not None:
        return planner.segments_problem(plan.any_angle.points)
    return problem


@dataclass(frozen=True)
class CachedWaypoints:
    """The waypoints as the source gave them, the map they were for, and the path they led to."""

    placement: MapPlacement
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


class CachedWaypointSource:
    """Answers with waypoints that a source gave earlier for the same goal."""

    def __init__(
        self, name: str, cached: CachedWaypoints, waypoints: tuple[Waypoint, ...]
    ) -> None:
        """Take the name of the source, what is cached, and the waypoints that lie ahead."""
        self.name = name
        self._reply = replace(
            cached.reply,
            waypoints=waypoints,
            detail=f'kept from the plan on map {cached.placement.digest}',
            prompt_tokens=0,
            completion_tokens=0,
            seconds=0.0,
        )

    def waypoints(self, query: WaypointQuery) -> WaypointReply:  # noqa: ARG002 - the protocol's
        """Return them at once."""
        return self._reply


class WaypointCache:
    """The last good waypoints of each goal, used again while they hold, so they are asked once.

    They hold if all were accepted, all are still free and reachable on the current map, and the
    start lies along the path they led to; those that the robot has passed are left out. The very
    same query on the very same map is left to the source. Thread-safe.
    """

    def __init__(self) -> None:
        """Make an empty cache."""
        self._lock = threading.Lock()
        self._cached: LRUCache[tuple[Cell, str], CachedWaypoints] = LRUCache(CACHED_GOALS)
        self._generation = 0

    @property
    def generation(self) -> int:
        """How often the cache was cleared."""
        return self._generation

    def clear(self) -> None:
        """Drop everything: the source may answer differently from now on."""
        with self._lock:
            self._generation += 1
            self._cached.clear()

    def remember(
        self, request: PlanRequest, plan: Plan, grid_map: GridMap, generation: int
    ) -> None:
        """Cache the waypoints of a plan if every one of them was accepted.

        `generation` is the cache's when planning started: results that started before the cache
        was cleared are discarded.
        """
        good = plan.code is ResultCode.NONE and plan.source_status is SourceStatus.OK
        accepted = all(point.status is WaypointStatus.ACCEPTED for point in plan.checked_waypoints)
        if not (good and plan.checked_waypoints and accepted):
            return
        cached = CachedWaypoints(MapPlacement.of(grid_map), plan.reply, plan.path)
        with self._lock:
            if generation == self._generation:
                self._cached[request.goal, request.instruction] = cached

    def source_for(self, request: PlanRequest, planner: Planner) -> WaypointSource | None:
        """Return a source of the cached waypoints if they hold, else the request's own source."""
        with self._lock:
            cached = self._cached.get((request.goal, request.instruction))
        if request.source is None or cached is None:
            return request.source
        waypoints = cached.ahead_of(request.start)
        is_same_map = cached.placement.digest == planner.grid_map.digest
        is_same_query = is_same_map and waypoints == cached.reply.waypoints
        if waypoints is None or is_same_query:
            return request.source
        if not can_be_reached(waypoints, cached.placement, planner, request.start):
            return request.source
        return CachedWaypointSource(request.source.name, cached, waypoints)


def nearest_on_path(path: NDArray[np.int32], point: tuple[float, float]) -> tuple[int, float]:
    """Return the index of a path's cell [n, 2] nearest to a point, and the distance in cells."""
    distances = np.hypot(*(path - np.asarray(point)).T)
    index = int(np.argmin(distances))
    return index, float(distances[index])


def can_be_reached(
    waypoints: tuple[Waypoint, ...], placement: MapPlacement, planner: Planner, start: Cell
) -> bool:
    """Tell whether every waypoint is still free and reachable from `start`."""
    components, grid_map = planner.costmap.components, planner.grid_map
    if not (placement.matches(grid_map) and grid_map.contains(start)):
        return False
    cells = [(round(x), round(y)) for x, y in waypoints]
    here = components[start[1], start[0]]
    return all(grid_map.contains(cell) and components[cell[1], cell[0]] == here for cell in cells)
