"""From a source's waypoints to the target list T: each one judged, the paper's two rules applied.

The paper asks that T holds start and goal and that no target lies in an obstacle (sec. 3.2). Its
published code also drops points within two lattice lines of the map's edge.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import Waypoint

# The published filter keeps 1 < x < width - 2, and likewise y.
PAPER_EDGE = 2


class WaypointStatus(str, Enum):
    """What the planner made of a waypoint."""

    ACCEPTED = 'accepted'
    OUT_OF_BOUNDS = 'out_of_bounds'
    OCCUPIED = 'occupied'
    UNREACHABLE = 'unreachable'
    OUT_OF_ORDER = 'out_of_order'

    @property
    def drops(self) -> bool:
        """Whether the paper's methods drop such a waypoint: what cannot be stood on."""
        return self in (WaypointStatus.OUT_OF_BOUNDS, WaypointStatus.OCCUPIED)


# What may lead the guided search. Out of order is found only after it, and was let in before.
GUIDING = frozenset({WaypointStatus.ACCEPTED, WaypointStatus.OUT_OF_ORDER})


@dataclass(frozen=True)
class CheckedWaypoint:
    """A waypoint in grid coordinates, with its status."""

    x: float
    y: float
    status: WaypointStatus


def judge(
    waypoints: Sequence[Waypoint],
    occupied: NDArray[np.bool_],
    components: NDArray[np.int32],
    start: Cell,
    edge: int = PAPER_EDGE,
) -> tuple[CheckedWaypoint, ...]:
    """Judge each waypoint by itself: bounds, obstacles, and whether start reaches it.

    `occupied` is `Costmap.blocked` or `Costmap.rejected_cells`; `components`
    [height, width] numbers the connected free cells. Within `edge` cells of the map's edge is out
    of bounds. A point between lattice points lies on no cell, as in the published code.
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


def target_list(judged: Sequence[CheckedWaypoint], start: Cell, goal: Cell) -> list[Waypoint]:
    """Build the paper's T: what it keeps, start put before and goal after where missing."""
    targets: list[Waypoint] = [(point.x, point.y) for point in judged if not point.status.drops]
    if not targets or targets[0] != start:
        targets.insert(0, start)
    if targets[-1] != goal:
        targets.append(goal)
    return targets


def mark_out_of_order(
    judged: Sequence[CheckedWaypoint], path: NDArray[np.int32]
) -> tuple[CheckedWaypoint, ...]:
    """Mark the accepted waypoints that the path found passes in another order than given.

    Each is placed at its nearest cell of the path [n, 2]; those outside the longest run of places
    that never goes back are out of order.
    """
    accepted = [i for i, point in enumerate(judged) if point.status is WaypointStatus.ACCEPTED]
    if len(path) == 0 or len(accepted) < 2:
        return tuple(judged)
    points = np.array([(judged[i].x, judged[i].y) for i in accepted])
    places = [int(np.argmin(np.hypot(*(path - point).T))) for point in points]
    in_order = {accepted[i] for i in _longest_rising(places)}
    return tuple(
        replace(point, status=WaypointStatus.OUT_OF_ORDER)
        if point.status is WaypointStatus.ACCEPTED and i not in in_order
        else point
        for i, point in enumerate(judged)
    )


def snap(value: float, tolerance: float = 1e-6) -> float:
    """Return the whole number within `tolerance` of a grid coordinate, else the value itself.

    Coordinates that went through metres come back a few ulps off the lattice.
    """
    if not math.isfinite(value):
        return value
    nearest = float(round(value))
    return nearest if abs(value - nearest) <= tolerance else value


def _longest_rising(places: list[int]) -> list[int]:
    """Return the indices of a longest non-decreasing subsequence, in O(n log n)."""
    # By the length of the longest run that ends there; along a level places fall.
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
