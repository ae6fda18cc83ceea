"""What of an earlier plan still holds on a map that has changed: its path, its waypoints."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
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

# How far, in cells, a robot may be off an earlier path and still be on its way along it.
ON_THE_WAY = 3.0
# Goals whose waypoints are kept.
KEPT_GOALS = 64


def standing_problem(plan: Plan, before: GridMap, planner: Planner) -> str | None:
    """Say why the path of a plan made on the map `before` cannot stand, or None.

    It stands where it is still valid on the planner's map, which must lie where `before` did; a
    path at any angle where its cells and its straight legs are.
    """
    if not _MapName.of(before).lies_as(planner.grid_map):
        return 'the map has another size, resolution, origin or frame'
    problem = planner.path_problem(plan.path, plan.start, plan.goal)
    if problem is None and plan.any_angle is not None:
        return planner.legs_problem(plan.any_angle.points)
    return problem


class _MapName(NamedTuple):
    """Which map it was and where it lay, without its cells: there may be many, and large ones."""

    digest: str
    shape: tuple[int, ...]
    resolution: float
    origin: Pose2D
    frame_id: str

    @classmethod
    def of(cls, grid_map: GridMap) -> _MapName:
        shape, resolution = grid_map.cells.shape, grid_map.resolution
        return cls(grid_map.digest, shape, resolution, grid_map.origin, grid_map.frame_id)

    def lies_as(self, grid_map: GridMap) -> bool:
        """Tell whether a cell is the same place on both."""
        return self[1:] == _MapName.of(grid_map)[1:]


@dataclass(frozen=True)
class _Kept:
    """What led to a goal: the waypoints as the source gave them, and the path they led to."""

    grid_map: _MapName
    reply: WaypointReply
    path: NDArray[np.int32]


class WaypointCache:
    """The last good waypoints of each goal, to be used again while they hold: asked once.

    They hold where all were accepted, all can still be stood on and reached on the map as it is
    now, and the start lies along the path they led to; those the robot has passed are left out.
    The very same question on the very same map is left to the source. Thread-safe.
    """

    def __init__(self) -> None:
        """Make an empty memory."""
        self._lock = threading.Lock()
        self._kept: OrderedDict[tuple[Cell, str], _Kept] = OrderedDict()

    def forget(self) -> None:
        """Forget every goal."""
        with self._lock:
            self._kept.clear()

    def keep(self, request: PlanRequest, plan: Plan, grid_map: GridMap) -> None:
        """Keep the waypoints of a plan, if every one of them was accepted."""
        good = plan.code is ResultCode.NONE and plan.source_status is SourceStatus.OK
        accepted = all(point.status is WaypointStatus.ACCEPTED for point in plan.waypoints)
        if not (good and plan.waypoints and accepted):
            return
        with self._lock:
            self._kept[_key(request)] = _Kept(_MapName.of(grid_map), plan.reply, plan.path)
            self._kept.move_to_end(_key(request))
            while len(self._kept) > KEPT_GOALS:
                self._kept.popitem(last=False)

    def source_for(self, request: PlanRequest, planner: Planner) -> WaypointSource | None:
        """Return the request's source, or one of the kept waypoints where they still hold."""
        with self._lock:
            kept = self._kept.get(_key(request))
        if request.source is None or kept is None:
            return request.source
        waypoints = _ahead(kept, request.start)
        is_same_map = kept.grid_map.digest == planner.grid_map.digest
        is_same = is_same_map and waypoints == kept.reply.waypoints
        if waypoints is None or is_same:
            return request.source
        if not _hold(waypoints, kept.grid_map, planner, request):
            return request.source
        return CachedWaypointSource(request.source.name, kept, waypoints)


class CachedWaypointSource:
    """A source of waypoints given earlier, for the same goal."""

    def __init__(self, name: str, kept: _Kept, waypoints: tuple[Waypoint, ...]) -> None:
        """Take what was kept, and which waypoints of it still lie ahead."""
        self.name = name
        detail = f'kept from the plan on map {kept.grid_map.digest}'
        self._reply = replace(
            kept.reply,
            waypoints=waypoints,
            detail=detail,
            prompt_tokens=0,
            completion_tokens=0,
            seconds=0.0,
        )

    def waypoints(self, query: WaypointQuery) -> WaypointReply:  # noqa: ARG002 - as a source is
        """Return them at once."""
        return self._reply


def _key(request: PlanRequest) -> tuple[Cell, str]:
    return request.goal, request.instruction


def _ahead(kept: _Kept, start: Cell) -> tuple[Waypoint, ...] | None:
    """Return the waypoints a robot at `start` has not passed yet; None where it is off the way."""
    place, distance = _nearest(kept.path, start)
    if distance > ON_THE_WAY:
        return None
    if place == 0:
        return kept.reply.waypoints
    return tuple(point for point in kept.reply.waypoints if _nearest(kept.path, point)[0] > place)


def _nearest(path: NDArray[np.int32], point: tuple[float, float]) -> tuple[int, float]:
    distances = np.hypot(*(path - np.asarray(point)).T)
    index = int(np.argmin(distances))
    return index, float(distances[index])


def _hold(
    waypoints: tuple[Waypoint, ...], before: _MapName, planner: Planner, request: PlanRequest
) -> bool:
    """Tell whether each can still be stood on, and reached from the start."""
    components, grid_map = planner.costmap.components, planner.grid_map
    if not (before.lies_as(grid_map) and grid_map.contains(request.start)):
        return False
    cells = [(round(x), round(y)) for x, y in waypoints]
    here = components[request.start[1], request.start[0]]
    return all(grid_map.contains(cell) and components[cell[1], cell[0]] == here for cell in cells)
