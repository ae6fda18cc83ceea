"""Compiled loops that hold a polygon against the cells of a map.

Coordinates are those of the grid: cell centres are whole numbers and cells reach half a cell to
each side. A cell is lethal from `threshold` up, and where it is unknown if `unknown_blocks`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

HALF = 0.5

_jit: Any = njit(cache=True, nogil=True)


@_jit
def touches(corners: NDArray[np.float64], x: float, y: float) -> bool:
    """Tell whether a polygon [n, 2], its interior included, meets the cell at (x, y)."""
    inside = False
    before_x, before_y = corners[-1, 0] - x, corners[-1, 1] - y
    for n in range(len(corners)):
        here_x, here_y = corners[n, 0] - x, corners[n, 1] - y
        # The edge and the square are apart if an axis separates them: x, y or the edge's normal.
        middle_x, middle_y = (here_x + before_x) / 2.0, (here_y + before_y) / 2.0
        far_x, far_y = abs(here_x - before_x) / 2.0, abs(here_y - before_y) / 2.0
        across = middle_x * (here_y - before_y) / 2.0 - middle_y * (here_x - before_x) / 2.0
        if (
            abs(middle_x) <= HALF + far_x
            and abs(middle_y) <= HALF + far_y
            and abs(across) <= HALF * (far_x + far_y)
        ):
            return True
        if (here_y > 0.0) != (before_y > 0.0):
            crossing = here_x + (before_x - here_x) * here_y / (here_y - before_y)
            inside ^= crossing > 0.0
        before_x, before_y = here_x, here_y
    return inside


@_jit
def collides(
    cells: NDArray[np.int8],
    threshold: int,
    unknown_blocks: bool,
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
    corners: NDArray[np.float64],
) -> bool:
    """Tell whether a polygon at a pose (x, y, yaw) meets a lethal cell or leaves the map.

    `points` [n, 2] is the polygon in the robot's frame; `corners` [n, 2] is written over.
    """
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
    if not (left > -HALF and top > -HALF and right < width - HALF and bottom < height - HALF):
        return True
    first, last = math.floor(left + HALF), math.floor(right + HALF)
    for row in range(math.floor(top + HALF), math.floor(bottom + HALF) + 1):
        line = cells[row, first : last + 1]
        found = False
        for n in range(line.size):
            found |= (line[n] >= threshold) | (unknown_blocks & (line[n] < 0))
        if not found:
            continue
        for n in range(line.size):
            lethal = line[n] >= threshold or (unknown_blocks and line[n] < 0)
            if lethal and touches(corners, first + n, row):
                return True
    return False


@_jit
def first_collision(
    cells: NDArray[np.int8],
    threshold: int,
    unknown_blocks: bool,
    points: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> int:
    """Return the index of the first pose [m, 3] at which a polygon collides, or -1."""
    corners = np.empty_like(points)
    for n in range(len(poses)):
        if collides(cells, threshold, unknown_blocks, points, poses[n], corners):
            return n
    return -1


@_jit
def all_collisions(
    cells: NDArray[np.int8],
    threshold: int,
    unknown_blocks: bool,
    points: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Tell for each pose [m, 3] whether a polygon collides there: bool [m]."""
    corners = np.empty_like(points)
    found = np.empty(len(poses), dtype=np.bool_)
    for n in range(len(poses)):
        found[n] = collides(cells, threshold, unknown_blocks, points, poses[n], corners)
    return found
