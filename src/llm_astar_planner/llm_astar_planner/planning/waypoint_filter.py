"""Checks a source's waypoints and builds the paper's target list T from them.

The paper asks that T holds start and goal and that no target lies in an obstacle (sec. 3.2). Its
published code also drops points within two cells of the map's edge.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning._kernels.nearest import nearest_places
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.tiles import Tiles
from llm_astar_planner.waypoints.source import Waypoint

# The published filter keeps 1 < x < width - 2, and likewise y.
PAPER_EDGE = 2


class WaypointStatus(str, Enum):
    """What became of a waypoint."""

    ACCEPTED = 'accepted'
    OUT_OF_BOUNDS = 'out_of_bounds'
    OCCUPIED = 'occupied'
    UNREACHABLE = 'unreachable'
    OUT_OF_ORDER = 'out_of_order'


# The paper's methods drop a waypoint only if no robot can be there.
KEPT_BY_PAPER = frozenset(WaypointStatus) - {WaypointStatus.OUT_OF_BOUNDS, WaypointStatus.OCCUPIED}
# Which waypoints the guided search uses. OUT_OF_ORDER is known only after it, so it was used.
GUIDING = frozenset({WaypointStatus.ACCEPTED, WaypointStatus.OUT_OF_ORDER})


@dataclass(frozen=True)
class CheckedWaypoint:
    """A waypoint in grid coordinates, with its status."""

    x: float
    y: float
    status: WaypointStatus


def check_waypoints(
    waypoints: Sequence[Waypoint],
    occupied: NDArray[np.bool_],
    components: Tiles | NDArray[np.int32],
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
    return [(point.x, point.y) for point in waypoints if point.status in GUIDING]


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


def mark_out_of_order(
    waypoints: Sequence[CheckedWaypoint], path: NDArray[np.int32]
) -> tuple[CheckedWaypoint, ...]:
    """Mark the accepted waypoints that the path passes in another order than given.

    Each is placed at its nearest cell of the path [n, 2]. Those outside the longest run of places
    that never goes back are out of order.
    """
    if len(path) == 0 or len(waypoints) < 2:
        return tuple(waypoints)
    accepted, points = [], []
    for i, point in enumerate(waypoints):
        if point.status is WaypointStatus.ACCEPTED:
            accepted.append(i)
            points.append((point.x, point.y))
    if len(accepted) < 2:
        return tuple(waypoints)
    places = nearest_places(path, np.array(points)).tolist()
    if sorted(places) == places:
        return tuple(waypoints)
    in_order = {accepted[i] for i in longest_rising_run(places)}
    return tuple(
        replace(point, status=WaypointStatus.OUT_OF_ORDER)
        if point.status is WaypointStatus.ACCEPTED and i not in in_order
        else point
        for i, point in enumerate(waypoints)
    )


def snap(value: float, tolerance: float = 1e-6) -> float:
    """Return the whole number within `tolerance` of a grid coordinate, else the coordinate.

    Coordinates that were converted to metres and back are off by rounding errors.
    """
    if not math.isfinite(value):
        return value
    nearest = float(round(value))
    return nearest if abs(value - nearest) <= tolerance else value


def longest_rising_run(places: list[int]) -> list[int]:
    """Return the indices of a longest non-decreasing subsequence, in O(n log n)."""
    # levels[k]: indices that end a run of length k + 1; within a level the places decrease.
    levels: list[list[int]] = []
    ends: list[int] = []
    for i, place in enumerate(places):
        level = bisect_right(ends, place)
        ends[level : level + 1] = [place]
        if level == len(levels):
            levels.append([])
        levels[level].append(i)
    run = [levels[-1][0]]
    for before in reversed(levels[:-1]):
        run.append(next(i for i in before if places[i] <= places[run[-1]]))
    return run[::-1]
