# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of lines of sight: what a line costs, string pulling, walls without thickness."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from llm_astar_planner.search.arrays import Bools, Float64s, Int32s, Int64s, Uint16s
from llm_astar_planner.search.kernel_cache import jit

# Blocked cells, surcharges or none, and whether moves may cut corners, as `line_cost` takes them.
Rules = tuple[Bools, Uint16s, bool]
# A path is pulled until it gains less than this, in cells, or this often.
MIN_GAIN = 1e-9
MAX_PULLS = 16
# Slots of the counts that `string_pull` keeps from call to call.
POINTS, CENTRES, INDEX, ANCHOR, KEPT, PULLS, COUNTS = range(7)


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
def next_is_in_sight(
    blocked: Bools, corner_cutting: bool, x: int, y: int, to_x: int, to_y: int
) -> bool:
    """Tell whether (to_x, to_y) is in sight of (x, y), as the cell before it along x is.

    That cell is nearer by one. The rules are those of `line_cost`. In each row the line crosses
    at most one cell that the line to the cell before does not, the last one in that row; so only
    one cell a row is looked at.
    """
    step_x = 1 if to_x > x else -1
    step_y = 1 if to_y > y else -1
    columns = abs(to_x - x)
    rows = abs(to_y - y)
    # The line leaves row j at column ((2 j + 1) columns / rows) / 2. Half a column less than that
    # is last - 1 + rest / (2 rows), with a rest above 0: `last` is the last cell crossed there.
    last: Any = -((rows - columns) // (2 * rows))
    rest: Any = columns - rows - 2 * rows * (last - 1)
    more = columns // rows
    more_rest = 2 * (columns - more * rows)
    for row in range(rows):
        here = y + step_y * row
        # The line to the cell before leaves the row by (2 row + 1) / (2 rows) earlier.
        if rest <= 2 * row + 1 and blocked[here, x + step_x * last]:
            return False
        beside = x + step_x * (last + 1)
        is_corner = rest == 2 * rows and not corner_cutting
        if is_corner and (blocked[here, beside] or blocked[here + step_y, beside - step_x]):
            return False
        last += more
        rest += more_rest
        if rest > 2 * rows:
            last += 1
            rest -= 2 * rows
    return not blocked[to_y, to_x]


@jit
def path_cost(rules: Rules, points: Int32s) -> tuple[float, float, int, int]:
    """Return what straight segments through `points` [n, 2] cost, and how long they are.

    After cost and length, in cells, comes the number of the first point that is off the grid or
    that the segment from the point before does not reach, -1 if there is none; last the most
    points that `string_pull` needs room for.
    """
    height, width = rules[0].shape
    cost = length = 0.0
    room: Any = 1
    for index in range(points.shape[0]):
        x = np.int64(points[index, 0])
        y = np.int64(points[index, 1])
        if x < 0 or x >= width or y < 0 or y >= height:
            return cost, length, index, room
        if index > 0:
            from_x = np.int64(points[index - 1, 0])
            from_y = np.int64(points[index - 1, 1])
            segment = line_cost(*rules, from_x, from_y, x, y)
            if segment < 0.0:
                return cost, length, index, room
            cost += segment
            length += math.sqrt((x - from_x) ** 2 + (y - from_y) ** 2)
            room += max(1, abs(x - from_x), abs(y - from_y))
    return cost, length, -1, room


@jit
def add_passed_centres(points: Int32s, count: int, centres: Int32s) -> int:
    """Write `count` points and every cell whose centre a segment between them passes.

    A pull may turn at each of these `centres`. Returns how many there are.
    """
    centres[0, 0], centres[0, 1] = points[0, 0], points[0, 1]
    total = 1
    for index in range(1, count):
        x = points[index - 1, 0]
        y = points[index - 1, 1]
        delta_x = points[index, 0] - x
        delta_y = points[index, 1] - y
        parts = max(1, math.gcd(delta_x, delta_y))
        for part in range(1, parts + 1):
            centres[total, 0] = x + part * (delta_x // parts)
            centres[total, 1] = y + part * (delta_y // parts)
            total += 1
    return total


@jit
def string_pull(
    rules: Rules, points: Int32s, centres: Int32s, counts: Int64s, costs: Float64s, quota: int
) -> bool:
    """Pull the path in `points` taut, or go on with that; return whether it is done.

    From each kept point the path goes straight on, as long as the next point is in sight and
    the straight line to it costs no more than the path does. It is pulled from both ends in turn
    until nothing changes. `points` and `centres` [room, 2] have as much room as `path_cost` says.
    `counts` and `costs` are kept from call to call: how many points there are, and the slots
    below, at first 0; the path's cost, and that along it from the last kept point. A call ends
    after lines over `quota` cells.
    """
    blocked, cell_surcharge, corner_cutting = rules
    left: Any = quota
    uniform = cell_surcharge.size == 0
    index: Any
    anchor: Any
    kept: Any
    while True:
        index, anchor, kept = counts[INDEX], counts[ANCHOR], counts[KEPT]
        if index == 0:
            counts[CENTRES] = add_passed_centres(points, counts[POINTS], centres)
            index, anchor, kept = 1, 0, 1
        along = costs[1]
        while index < counts[CENTRES] and left > 0:
            turn_x, turn_y = np.int64(centres[index - 1, 0]), np.int64(centres[index - 1, 1])
            x, y = np.int64(centres[index, 0]), np.int64(centres[index, 1])
            from_x, from_y = np.int64(centres[anchor, 0]), np.int64(centres[anchor, 1])
            segment = line_cost(blocked, cell_surcharge, corner_cutting, turn_x, turn_y, x, y)
            across = (turn_x - from_x) * (y - turn_y) - (turn_y - from_y) * (x - turn_x)
            ahead = (turn_x - from_x) * (x - turn_x) + (turn_y - from_y) * (y - turn_y)
            if index == anchor + 1:
                direct = along = segment
            elif across == 0 and ahead > 0:
                direct = along + segment
            elif uniform and y == turn_y != from_y and abs(x - from_x) == abs(turn_x - from_x) + 1:
                seen = next_is_in_sight(blocked, corner_cutting, from_x, from_y, x, y)
                direct = math.sqrt((x - from_x) ** 2 + (y - from_y) ** 2) if seen else -1.0
                left -= abs(y - from_y)
            elif uniform and x == turn_x != from_x and abs(y - from_y) == abs(turn_y - from_y) + 1:
                seen = next_is_in_sight(blocked.T, corner_cutting, from_y, from_x, y, x)
                direct = math.sqrt((x - from_x) ** 2 + (y - from_y) ** 2) if seen else -1.0
                left -= abs(x - from_x)
            else:
                direct = line_cost(blocked, cell_surcharge, corner_cutting, from_x, from_y, x, y)
                left -= max(abs(x - from_x), abs(y - from_y))
            left -= max(abs(x - turn_x), abs(y - turn_y)) + 1
            if direct < 0.0 or direct > along + segment + 1e-9:
                anchor = index - 1
                points[kept, 0], points[kept, 1] = centres[anchor, 0], centres[anchor, 1]
                kept += 1
                along = segment
            else:
                # Replaced by the straight line, so that savings do not pay for a detour later.
                along = direct
            index += 1
        counts[INDEX], counts[ANCHOR], counts[KEPT], costs[1] = index, anchor, kept, along
        if index < counts[CENTRES]:
            return False
        points[kept, 0], points[kept, 1] = centres[index - 1, 0], centres[index - 1, 1]
        counts[POINTS] = kept + 1
        # By hand, since numba takes two seconds to compile an assignment to a slice.
        for n in range((kept + 1) // 2):
            for axis in range(2):
                before = points[n, axis]
                points[n, axis] = points[kept - n, axis]
                points[kept - n, axis] = before
        counts[INDEX] = 0
        counts[PULLS] += 1
        if counts[PULLS] % 2 == 0:
            cost = path_cost(rules, points[: kept + 1])[0]
            if cost > costs[0] - MIN_GAIN or counts[PULLS] == MAX_PULLS:
                costs[0] = cost
                return True
            costs[0] = cost


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
