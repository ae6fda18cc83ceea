# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of lines of sight: what a line costs, string pulling, walls without thickness."""

from __future__ import annotations

import math

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int32s, Int64s, Uint16s
from llm_astar_planner.search.kernel_cache import jit

# Blocked cells, surcharges or none, and whether moves may cut corners, as `line_cost` takes them.
Rules = tuple[Bools, Uint16s, bool]


@jit
def line_cost(
    blocked: Bools,
    cell_surcharge: Uint16s,
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
    crossed_x = crossed_y = 0
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


@jit
def path_cost(rules: Rules, points: Int32s) -> tuple[float, float, int]:
    """Return what straight segments through `points` [n, 2] cost, and how long they are.

    After cost and length, in cells, comes the number of the first point that is off the grid or
    that the segment from the point before does not reach, -1 if there is none.
    """
    height, width = rules[0].shape
    cost = length = 0.0
    for index in range(points.shape[0]):
        x = np.int64(points[index, 0])
        y = np.int64(points[index, 1])
        if x < 0 or x >= width or y < 0 or y >= height:
            return cost, length, index
        if index > 0:
            from_x = np.int64(points[index - 1, 0])
            from_y = np.int64(points[index - 1, 1])
            segment = line_cost(*rules, from_x, from_y, x, y)
            if segment < 0.0:
                return cost, length, index
            cost += segment
            length += math.sqrt((x - from_x) ** 2 + (y - from_y) ** 2)
    return cost, length, -1


@jit
def passed_centres(path: Int32s) -> Int32s:
    """Return the points of a path [n, 2], and every cell whose centre it passes between them."""
    points = [(path[0, 0], path[0, 1])]
    for index in range(1, len(path)):
        x, y = points[-1]
        delta_x, delta_y = path[index, 0] - x, path[index, 1] - y
        parts = max(1, math.gcd(delta_x, delta_y))
        step_x, step_y = delta_x // parts, delta_y // parts
        points += [(x + n * step_x, y + n * step_y) for n in range(1, parts + 1)]
    return np.array(points, dtype=np.int32)


@jit
def pulled(rules: Rules, path: Int32s) -> Int32s:
    """Return a path [n, 2] pulled taut from its beginning on, and turned round.

    From each point that is kept it goes straight on as long as the next centre of a cell is in
    sight and the straight line to it costs no more than the path does.
    """
    points = passed_centres(path)
    anchor = 0
    along = 0.0
    kept = 1
    for index in range(1, len(points)):
        turn_x, turn_y = np.int64(points[index - 1, 0]), np.int64(points[index - 1, 1])
        x, y = np.int64(points[index, 0]), np.int64(points[index, 1])
        from_x, from_y = np.int64(points[anchor, 0]), np.int64(points[anchor, 1])
        segment = line_cost(*rules, turn_x, turn_y, x, y)
        across = (turn_x - from_x) * (y - turn_y) - (turn_y - from_y) * (x - turn_x)
        ahead = (turn_x - from_x) * (x - turn_x) + (turn_y - from_y) * (y - turn_y)
        if index == anchor + 1:
            direct = along = segment
        elif across == 0 and ahead > 0:
            direct = along + segment
        else:
            direct = line_cost(*rules, from_x, from_y, x, y)
        # Replaced by the straight line, so that savings do not pay for a detour later.
        along, before = direct, along
        if direct < 0.0 or direct > before + segment + 1e-9:
            anchor = index - 1
            points[kept, 0], points[kept, 1] = turn_x, turn_y
            kept += 1
            along = segment
    if len(points) > 1:
        points[kept, 0], points[kept, 1] = points[-1, 0], points[-1, 1]
        kept += 1
    return points[:kept][::-1].copy()


@jit
def line_is_free(padded: Bools, x: int, y: int, to_x: int, to_y: int, scale: int) -> bool:
    """Tell whether a straight line touches no wall; a wall joins blocked cells that share a side.

    `padded` are the blocked cells in a ring of free ones. The ends are in cells, times `scale`:
    whole numbers, so that nothing is rounded. The line is looked at where it crosses the centres
    of a column or of a row, and at its beginning, as it may cross none.
    """
    height = padded.shape[0] - 2
    width = padded.shape[1] - 2
    delta_x = to_x - x
    delta_y = to_y - y
    for along in range(2):
        # Columns first; then rows, as columns of the map transposed.
        first = max(0, -(-min(x, to_x) // scale))
        last = min(width - 1, max(x, to_x) // scale)
        if delta_x == 0 and x % scale != 0:
            last = -1
        for column in range(first, last + 1):
            if delta_x == 0:
                above, size = y, scale
            else:
                above = y * delta_x + (column * scale - x) * delta_y
                size = delta_x * scale
            if size < 0:
                above, size = -above, -size
            row = above // size
            if -1 <= row < height:
                here = padded[row + 1, column + 1] if along == 0 else padded[column + 1, row + 1]
                if here and row * size == above:
                    return False
                after = padded[row + 2, column + 1] if along == 0 else padded[column + 1, row + 2]
                if here and after:
                    return False
        x, y, to_x, to_y = y, x, to_y, to_x
        delta_x, delta_y = delta_y, delta_x
        height, width = width, height
    return True


@jit
def lines_are_free(padded: Bools, lines: Int64s) -> Bools:
    """Tell it for each of the `lines` [n, 4]: x and y of both ends, in cells."""
    free = np.empty(len(lines), dtype=np.bool_)
    for index in range(len(lines)):
        x, y, to_x, to_y = lines[index]
        free[index] = line_is_free(padded, x, y, to_x, to_y, 1)
    return free
