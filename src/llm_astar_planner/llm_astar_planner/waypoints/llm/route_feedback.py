"""Tell a model what is wrong with its route, so that it can answer better."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.waypoints.prompts.lattice import Cell, Lattice, Waypoint

MAX_FAULTS_TOLD = 8


class Fault(NamedTuple):
    """A point off the map or on an obstacle, or a straight way that meets one, in cells."""

    kind: str  # 'off the map', 'occupied', 'collides'
    point: Waypoint
    to: Waypoint | None = None  # where the way leads
    at: Cell | None = None  # the first occupied cell on it


def find_faults(
    grid_map: GridMap, start: Cell, goal: Cell, waypoints: Sequence[Waypoint]
) -> list[Fault]:
    """Check waypoints in grid coordinates, and the straight ways from start to goal over them."""
    blocked = grid_map.blocked()
    faults: list[Fault] = []
    good: list[Waypoint] = [(float(start[0]), float(start[1]))]
    for point in waypoints:
        cell = round(point[0]), round(point[1])
        if not grid_map.contains(cell):
            faults.append(Fault('off the map', point))
        elif blocked[cell[1], cell[0]]:
            faults.append(Fault('occupied', point))
        elif point != good[-1]:
            good.append(point)
    if good[-1] != goal:
        good.append((float(goal[0]), float(goal[1])))
    for point, to in pairwise(good):
        at = _first_blocked(blocked, point, to)
        if at is not None:
            faults.append(Fault('collides', point, to, at))
    return faults


def follow_up(faults: Sequence[Fault], lattice: Lattice) -> str:
    """Say what is wrong, in the coordinates the model was asked in, and ask again."""
    lines = [_sentence(fault, lattice) for fault in faults[:MAX_FAULTS_TOLD]]
    if len(faults) > MAX_FAULTS_TOLD:
        lines.append(f'- and {len(faults) - MAX_FAULTS_TOLD} more like these.')
    return (
        'This route does not work:\n' + '\n'.join(lines) + '\nCorrect it. End the reply with '
        'the whole new route in the form "Generated Path: [[x1, y1], [x2, y2], ...]".'
    )


ASK_FOR_A_LIST = (
    'That holds no list of points. Reply with the route alone, in the form '
    '"Generated Path: [[x1, y1], [x2, y2], ...]".'
)


def _sentence(fault: Fault, lattice: Lattice) -> str:
    point = _named(fault.point, lattice)
    if fault.to is None or fault.at is None:
        where = 'lies on a barrier' if fault.kind == 'occupied' else 'lies off the map'
        return f'- The point {point} {where}.'
    return (
        f'- The straight way from {point} to {_named(fault.to, lattice)} '
        f'meets a barrier at {_named(fault.at, lattice)}.'
    )


def _named(point: Waypoint, lattice: Lattice) -> str:
    return str(list(lattice.to_lattice((round(point[0]), round(point[1])))))


def _first_blocked(blocked: NDArray[np.bool_], a: Waypoint, b: Waypoint) -> Cell | None:
    """Return the first occupied cell (x, y) that the straight way from a to b meets."""
    steps = int(2 * max(abs(b[0] - a[0]), abs(b[1] - a[1]))) + 1
    x = np.rint(np.linspace(a[0], b[0], steps + 1)).astype(int)
    y = np.rint(np.linspace(a[1], b[1], steps + 1)).astype(int)
    hits = np.flatnonzero(blocked[y, x])
    return (int(x[hits[0]]), int(y[hits[0]])) if hits.size else None
