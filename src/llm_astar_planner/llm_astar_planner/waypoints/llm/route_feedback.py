# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Find what is wrong with a model's route, and tell the model, so that it can correct it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.prompts.map_description import Lattice
from llm_astar_planner.waypoints.source import Waypoint

MAX_FAULTS_NAMED = 8
ASK_FOR_A_LIST = (
    'That holds no list of points. Reply with the route alone, in the form '
    '"Generated Path: [[x1, y1], [x2, y2], ...]".'
)

_DOES_NOT_WORK = 'This route does not work:'


def find_faults(
    costmap: Costmap, start: Cell, goal: Cell, waypoints: Sequence[Waypoint], lattice: Lattice
) -> list[str]:
    """Return a sentence for each fault of a route from start to goal, given in grid coordinates.

    These are points off the map or on a blocked cell, and straight segments between the others
    that meet one. The sentences are in the coordinates of `lattice`.
    """
    blocked = costmap.blocked
    faults: list[str] = []
    good: list[Waypoint] = [(float(start[0]), float(start[1]))]
    for point in waypoints:
        cell = round(point[0]), round(point[1])
        if not costmap.grid_map.contains(cell):
            faults.append(f'- The point {point_name(point, lattice)} lies off the map.')
        elif blocked[cell[1], cell[0]]:
            faults.append(f'- The point {point_name(point, lattice)} lies on a barrier.')
        elif point != good[-1]:
            good.append(point)
    if good[-1] != goal:
        good.append((float(goal[0]), float(goal[1])))
    for ends in pairwise(good):
        at = first_blocked_cell(blocked, *ends)
        if at is not None:
            names = [point_name(point, lattice) for point in (*ends, at)]
            way = '- The straight way from {} to {} meets a barrier at {}.'
            faults.append(way.format(*names))
    return faults


def follow_up(faults: Sequence[str]) -> str:
    """Return the message that names the faults and asks again."""
    lines = [_DOES_NOT_WORK, *faults[:MAX_FAULTS_NAMED]]
    if len(faults) > MAX_FAULTS_NAMED:
        lines.append(f'- and {len(faults) - MAX_FAULTS_NAMED} more like these.')
    lines.append(
        'Correct it. End the reply with the whole new route in the form '
        '"Generated Path: [[x1, y1], [x2, y2], ...]".'
    )
    return '\n'.join(lines)


def is_follow_up(text: str) -> bool:
    """Tell whether a message asks about an answer of the model, which stands before it."""
    return text == ASK_FOR_A_LIST or text.startswith(_DOES_NOT_WORK)


def point_name(point: Waypoint, lattice: Lattice) -> str:
    """Return a point of the grid as a prompt writes it."""
    return str(list(lattice.to_lattice((round(point[0]), round(point[1])))))


def first_blocked_cell(blocked: NDArray[np.bool_], a: Waypoint, b: Waypoint) -> Cell | None:
    """Return the first blocked cell (x, y) on the straight segment from a to b, None if free."""
    steps = int(2 * max(abs(b[0] - a[0]), abs(b[1] - a[1]))) + 1
    x = np.rint(np.linspace(a[0], b[0], steps + 1)).astype(int)
    y = np.rint(np.linspace(a[1], b[1], steps + 1)).astype(int)
    hits = np.flatnonzero(blocked[y, x])
    return (int(x[hits[0]]), int(y[hits[0]])) if hits.size else None
