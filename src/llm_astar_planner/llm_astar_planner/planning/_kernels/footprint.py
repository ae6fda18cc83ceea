# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops that hold a polygon against the cells of a map.

Coordinates are those of the grid: cell centres are whole numbers and cells reach half a cell to
each side. A cell is lethal from `threshold` up, and where it is unknown if `unknown_blocks`.
"""

import math

import numpy as np

from llm_astar_planner.search._kernels.headings import is_lethal
from llm_astar_planner.search.arrays import Bools, Float64s, Int8s
from llm_astar_planner.search.kernel_cache import jit

HALF = 0.5
# Cells that a point of the polygon may move between two looks, at first and if that finds a
# collision: cells are taken to be half of it larger, so that nothing between two looks is missed.
STEPS = (0.5, 0.1)
# A map's cells, the threshold, whether unknown cells are lethal, and the polygon [n, 2] in cells.
Body = tuple[Int8s, int, bool, Float64s]


@jit
def touches(corners: Float64s, x: float, y: float, half: float) -> bool:
    """Tell whether a polygon [n, 2], its inside too, meets the square of 2 * half at (x, y)."""
    inside = False
    before_x, before_y = corners[-1, 0] - x, corners[-1, 1] - y
    for n in range(len(corners)):
        here_x, here_y = corners[n, 0] - x, corners[n, 1] - y
        # The edge and the square are apart if an axis separates them: x, y or the edge's normal.
        middle_x, middle_y = (here_x + before_x) / 2.0, (here_y + before_y) / 2.0
        far_x, far_y = abs(here_x - before_x) / 2.0, abs(here_y - before_y) / 2.0
        across = middle_x * (here_y - before_y) / 2.0 - middle_y * (here_x - before_x) / 2.0
        if (
            abs(middle_x) <= half + far_x
            and abs(middle_y) <= half + far_y
            and abs(across) <= half * (far_x + far_y)
        ):
            return True
        if (here_y > 0.0) != (before_y > 0.0):
            crossing = here_x + (before_x - here_x) * here_y / (here_y - before_y)
            inside ^= crossing > 0.0
        before_x, before_y = here_x, here_y
    return inside


@jit
def collides(body: Body, pose: Float64s, corners: Float64s, half: float) -> bool:
    """Tell whether a polygon at a pose (x, y, yaw) meets a lethal cell or leaves the map.

    `points` [n, 2] is the polygon in the robot's frame; `corners` [n, 2] is written over. Cells
    reach `half` to each side, HALF or more.
    """
    cells, threshold, unknown_blocks, points = body
    height, width = cells.shape
    x, y, cos, sin = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    left = right = x + points[0, 0] * cos - points[0, 1] * sin
    top = bottom = y + points[0, 0] * sin + points[0, 1] * cos
    for n in range(len(points)):
        corner_x = x + points[n, 0] * cos - points[n, 1] * sin
        corner_y = y + points[n, 0] * sin + points[n, 1] * cos
        left, right = min(left, corner_x), max(right, corner_x)
        top, bottom = min(top, corner_y), max(bottom, corner_y)
        corners[n, 0], corners[n, 1] = corner_x, corner_y
    # Written so that what is not a number leaves the map.
    left, right, top, bottom = left - half, right + half, top - half, bottom + half
    if not (left > -1.0 and top > -1.0 and right < width and bottom < height):
        return True
    first, last = math.ceil(left), math.floor(right)
    for row in range(math.ceil(top), math.floor(bottom) + 1):
        if not is_lethal(cells, threshold, unknown_blocks, row, first, last):
            continue
        line = cells[row, first : last + 1]
        for n in range(line.size):
            lethal = line[n] >= threshold or (unknown_blocks and line[n] < 0)
            if lethal and touches(corners, first + n, row, half):
                return True
    return False


@jit
def clear(cells: Int8s, points: Float64s, pose: Float64s) -> None:
    """Set the cells that a polygon at a pose (x, y, yaw) touches to 0, free."""
    height, width = cells.shape
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    corners = np.empty_like(points)
    corners[:, 0] = pose[0] + points[:, 0] * cos - points[:, 1] * sin
    corners[:, 1] = pose[1] + points[:, 0] * sin + points[:, 1] * cos
    first, last = max(corners[:, 0].min() + HALF, 0.0), min(corners[:, 0].max() + HALF, width)
    top, bottom = max(corners[:, 1].min() + HALF, 0.0), min(corners[:, 1].max() + HALF, height)
    for y in range(math.floor(top), min(math.floor(bottom) + 1, height)):
        for x in range(math.floor(first), min(math.floor(last) + 1, width)):
            if touches(corners, x, y, HALF):
                cells[y, x] = 0


@jit
def all_collisions(body: Body, poses: Float64s) -> Bools:
    """Tell for each pose [m, 3] whether a polygon collides there: bool [m]."""
    corners = np.empty_like(body[3])
    found = np.empty(len(poses), dtype=np.bool_)
    for n in range(len(poses)):
        found[n] = collides(body, poses[n], corners, HALF)
    return found


@jit
def motion_collides(body: Body, begin: Float64s, change: Float64s) -> bool:
    """Tell whether a polygon collides between a pose (x, y, yaw) and the one `change` [3] on."""
    points = body[3]
    reach = 0.0
    for n in range(len(points)):
        reach = max(reach, math.hypot(points[n, 0], points[n, 1]))
    length = math.hypot(change[0], change[1]) + abs(change[2]) * reach
    corners, pose = np.empty_like(points), np.empty(3)
    for step in STEPS:
        count = max(math.ceil(length / step), 1)
        half = HALF + length / count / 2.0
        free = True
        for n in range(count + 1):
            pose[:] = begin + change * (n / count)
            if collides(body, pose, corners, half):
                free = False
                break
        if free:
            return False
    return True


@jit
def turn_collides(body: Body, x: float, y: float, yaws: tuple[float, float]) -> bool:
    """Tell whether a polygon collides that turns on the spot, whichever way round it turns."""
    begin, change = np.array([x, y, yaws[0]]), np.zeros(3)
    angle = (yaws[1] - yaws[0] + math.pi) % (2.0 * math.pi) - math.pi
    for turn in (0.0, -2.0 * math.pi if angle > 0.0 else 2.0 * math.pi):
        change[2] = angle + turn
        if not motion_collides(body, begin, change):
            return False
    return True


@jit
def path_collides(body: Body, path: Float64s, start_yaw: float, goal_yaw: float) -> bool:
    """Tell whether a polygon collides that follows a path [n, 2].

    It moves ahead from point to point and turns on the spot between; at the first point it turns
    from `start_yaw` and at the last to `goal_yaw`, unless these are NaN.
    """
    begin, change = np.zeros(3), np.zeros(3)
    before = start_yaw
    for n in range(len(path) - 1):
        x, y = path[n]
        step_x, step_y = path[n + 1, 0] - x, path[n + 1, 1] - y
        length = math.hypot(step_x, step_y)
        if length == 0.0:
            continue
        yaw = math.atan2(step_y, step_x)
        begin[2] = yaw
        count = math.ceil(length)
        change[0], change[1] = step_x / count, step_y / count
        for m in range(count):
            begin[0], begin[1] = x + m * change[0], y + m * change[1]
            if motion_collides(body, begin, change):
                return True
        turns = not math.isnan(before) and before != yaw
        if turns and turn_collides(body, x, y, (before, yaw)):
            return True
        before = yaw
    if math.isnan(goal_yaw):
        return False
    before = goal_yaw if math.isnan(before) else before
    x, y = path[-1]
    return turn_collides(body, x, y, (before, goal_yaw))
