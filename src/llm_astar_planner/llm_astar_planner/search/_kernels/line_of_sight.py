"""Compiled loops of the any-angle paths: the cost of a straight line, and string pulling."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_jit: Any = njit(cache=True, nogil=True)


@_jit
def line_cost(
    blocked: NDArray[np.bool_],
    cell_surcharge: NDArray[np.uint16],
    corner_cutting: bool,
    x: int,
    y: int,
    to_x: int,
    to_y: int,
) -> float:
    """Return the cost in cells of the straight line between two cell centres, -1 if blocked.

    The line is blocked by any blocked cell whose inside it crosses. Where it passes exactly
    through a corner, either cell next to the corner blocks it too, unless `corner_cutting`. Each
    cell's surcharge counts for the length inside that cell. Crossings are computed in whole
    numbers, so rounding misses no cell.
    """
    width = blocked.shape[1]
    graded = cell_surcharge.size > 0
    step_x = 1 if to_x > x else -1
    step_y = 1 if to_y > y else -1
    delta_x = abs(to_x - x)
    delta_y = abs(to_y - y)
    length = math.sqrt(delta_x * delta_x + delta_y * delta_y)
    if blocked[y, x]:
        return -1.0
    # Cell borders crossed so far; the line meets the next one in x at (2 i + 1) / (2 delta_x).
    crossed_x = 0
    crossed_y = 0
    cost = length
    before = 0.0
    while x != to_x or y != to_y:
        order = (2 * crossed_x + 1) * delta_y - (2 * crossed_y + 1) * delta_x
        if order <= 0:
            after = (2 * crossed_x + 1) / (2 * delta_x)
        else:
            after = (2 * crossed_y + 1) / (2 * delta_y)
        if graded:
            cost += (after - before) * length * cell_surcharge[y * width + x] / 256.0
            before = after
        if (
            order == 0
            and not corner_cutting
            and (blocked[y, x + step_x] or blocked[y + step_y, x])
        ):
            return -1.0
        if order <= 0:
            x += step_x
            crossed_x += 1
        if order >= 0:
            y += step_y
            crossed_y += 1
        if blocked[y, x]:
            return -1.0
    if graded:
        cost += (1.0 - before) * length * cell_surcharge[y * width + x] / 256.0
    return cost


@_jit
def string_pull(
    blocked: NDArray[np.bool_],
    cell_surcharge: NDArray[np.uint16],
    corner_cutting: bool,
    points: NDArray[np.int32],
    kept: NDArray[np.bool_],
) -> int:
    """Mark in `kept` the points at which the path has to turn; return how many.

    From each kept point the path goes straight on, as long as the next point is in sight and
    the straight line to it costs no more than the path does.
    """
    count = points.shape[0]
    kept[:] = False
    kept[0] = True
    kept[count - 1] = True
    turns = 2
    anchor = 0
    along = 0.0
    for index in range(1, count):
        segment = line_cost(
            blocked, cell_surcharge, corner_cutting,
            points[index - 1, 0], points[index - 1, 1], points[index, 0], points[index, 1],
        )  # fmt: skip
        direct = line_cost(
            blocked, cell_surcharge, corner_cutting,
            points[anchor, 0], points[anchor, 1], points[index, 0], points[index, 1],
        )  # fmt: skip
        if direct < 0.0 or direct > along + segment + 1e-9:
            anchor = index - 1
            kept[anchor] = True
            turns += 1
            along = segment
        else:
            # Replaced by the straight line, so that savings do not pay for a detour later.
            along = direct
    return turns
