# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Rounds the kinks of a path: at each one an arc that touches both straight lines (a fillet)."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.any_angle import interpolate

Points = NDArray[np.float64]
# Cells from a kink to where its arc begins, at least; at an arc that must not leave the kink's
# cell, at most.
LEAST_TANGENT, WITHIN_CELL = 0.25, 0.49
# How far the path turns from pose to pose on an arc, and what is no kink: radians.
SAME_PLACE = 1e-6
ARC_STEP, STRAIGHT = math.radians(8.0), math.radians(1.0)


def smoothed(
    points: NDArray[Any],
    is_free: Callable[[Points], bool],
    longest: float,
    fixed: frozenset[tuple[int, ...]] = frozenset(),
) -> Points:
    """Return a path of points [n, 2] in cells with its kinks rounded, at most a cell apart.

    An arc begins at most `longest` cells before its kink and takes at most half of the lines
    beside it; it is halved until `is_free` says that its points are, and left out where none is.
    Arcs at `fixed` cells stay inside of them. The ends stay.
    """
    corners = np.asarray(points, dtype=np.float64)
    corners = without_repeats(corners)
    parts = [corners[:1]]
    for before, corner, after in zip(corners, corners[1:], corners[2:]):
        most = WITHIN_CELL if tuple(corner.astype(int).tolist()) in fixed else longest
        parts.append(rounded(before, corner, after, is_free, most))
    whole = np.concatenate([*parts, corners[-1:]])
    return interpolate(without_repeats(whole))


def without_repeats(points: Points) -> Points:
    """Return the points [n, 2] without those at the place of the one before."""
    moves = np.abs(np.diff(points, axis=0)).max(axis=1, initial=0.0) > SAME_PLACE
    return np.asarray(points[np.concatenate([[True], moves])])


def rounded(
    before: Points, corner: Points, after: Points, is_free: Callable[[Points], bool], most: float
) -> Points:
    """Return the points [n, 2] of the largest free arc at a corner, else the corner.

    It begins at most `most` cells before the corner.
    """
    back, ahead = before - corner, after - corner
    lengths = math.hypot(*back), math.hypot(*ahead)
    back, ahead = back / lengths[0], ahead / lengths[1]
    turn = math.pi - math.acos(min(max(float(back @ ahead), -1.0), 1.0))
    tangent = min(most, lengths[0] / 2.0, lengths[1] / 2.0)
    # On the spot there is no arc.
    while STRAIGHT < turn < math.pi - STRAIGHT and tangent >= LEAST_TANGENT:
        arc = arc_at(corner, tangent * back, tangent * ahead, turn)
        if is_free(arc):
            return arc
        tangent /= 2.0
    return corner[None]


def arc_at(corner: Points, back: Points, ahead: Points, turn: float) -> Points:
    """Return an arc [n, 2] that begins at corner + back, ends at corner + ahead, and turns so far.

    The vectors are as long as each other, and the arc touches both.
    """
    radius = math.hypot(*back) / math.tan(turn / 2.0)
    count = math.ceil(max(turn / ARC_STEP, radius * turn))
    # From the centre, the corner is in the middle of the turn.
    middle = (back + ahead) / math.hypot(*(back + ahead))
    centre = corner + middle * radius / math.cos(turn / 2.0)
    side = math.copysign(1.0, back[1] * ahead[0] - back[0] * ahead[1])
    angles = math.atan2(*-middle[::-1]) + side * turn * (np.arange(count + 1) / count - 0.5)
    return np.asarray(centre + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
