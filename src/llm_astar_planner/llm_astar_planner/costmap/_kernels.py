# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops over the cells of maps: inflation, changes, costs, and what polygons cover."""

import math

import numpy as np

from llm_astar_planner.search.arrays import Bools, Float64s, Int8s, Int64s
from llm_astar_planner.search.kernel_cache import jit

# Rows inflated at a time, so that what is kept of them stays in the processor's cache.
BAND_ROWS = 64


@jit
def inflate(
    cells: Int8s,
    threshold: int,
    allow_unknown: bool,
    unknown_cost: int,
    inscribed: int,
    costs: Int8s,
    reach: int,
    windows: Int64s,
    blocked: Bools,
    cost: Int8s,
) -> None:
    """Fill `blocked` and `cost` [height, width] in the windows from the map's cells.

    Cells whose squared distance to a lethal one is at most `inscribed` are blocked; `costs` are
    by squared distance, the last one for all beyond. `reach` is the greatest distance, in cells,
    that matters. Unknown cells stay -1 where their inflation costs no more than `unknown_cost`.
    Exact Euclidean distances, axis by axis (Meijster, Roerdink and Hesselink, "A general algorithm
    for computing distance transforms in linear time", 2000), truncated.
    """
    height, width = cells.shape
    farthest = max(costs.size - 2, inscribed)
    for n in range(len(windows)):
        top, bottom, left, right = windows[n]
        first, last = max(left - reach, 0), min(right + reach, width)
        size, columns, shift = right - left, last - first, first - (left - reach)
        # Squared distances up and down; beside the map there is nothing lethal.
        squared = np.empty((BAND_ROWS, size + 2 * reach), dtype=np.int32)
        squared[:] = farthest + 1
        steps = np.empty(columns, dtype=np.int32)
        nearest = np.empty(size, dtype=np.int32)
        for begin in range(top, bottom, BAND_ROWS):
            end = min(begin + BAND_ROWS, bottom)
            steps[:] = reach + 1
            for y in range(max(begin - reach, 0), end):
                row = cells[y, first:last]
                for x in range(columns):
                    steps[x] = 0 if row[x] >= threshold else min(steps[x] + 1, reach + 1)
                if y >= begin:
                    squared[y - begin, shift : shift + columns] = steps
            steps[:] = reach + 1
            for y in range(min(end + reach, height) - 1, begin - 1, -1):
                row = cells[y, first:last]
                for x in range(columns):
                    steps[x] = 0 if row[x] >= threshold else min(steps[x] + 1, reach + 1)
                if y < end:
                    line = squared[y - begin, shift : shift + columns]
                    for x in range(columns):
                        line[x] = min(line[x], steps[x])
            for y in range(begin, end):
                own, walls, values = (
                    cells[y, left:right],
                    blocked[y, left:right],
                    cost[y, left:right],
                )
                for x in range(size):
                    values[x] = own[x]
                    walls[x] = own[x] >= threshold or (own[x] < 0 and not allow_unknown)
                line = squared[y - begin, shift : shift + columns]
                least = reach + 1
                for x in range(columns):
                    least = min(least, line[x])
                if least > reach:
                    continue
                for x in range(columns):
                    line[x] = farthest + 1 if line[x] > reach else line[x] * line[x]
                padded = squared[y - begin]
                nearest[:] = padded[reach : reach + size]
                for step in range(1, reach + 1):
                    if least * least + step * step > farthest:
                        break
                    west = padded[reach - step : reach - step + size]
                    east = padded[reach + step : reach + step + size]
                    for x in range(size):
                        nearest[x] = min(nearest[x], min(west[x], east[x]) + step * step)
                for x in range(size):
                    distance = nearest[x]
                    if distance <= farthest:
                        walls[x] |= distance <= inscribed
                        least_cost = values[x] if values[x] >= 0 else unknown_cost
                        if distance < costs.size and costs[distance] > least_cost:
                            values[x] = costs[distance]


# Cells on a side of the squares in which changes are looked for.
TILE = 64
# With more windows than this, one for the whole map is less work.
MOST_WINDOWS = 256


@jit
def changed_windows(before: Int8s, after: Int8s, margin: int) -> Int64s:
    """Return disjoint windows, int64 [n, 4], that hold all differing cells and `margin` around.

    A window is (top, bottom, left, right) in cells, half open. `before` and `after` are
    [height, width]. Where the windows would cover more than half of the map, one covers it all.
    """
    height, width = before.shape
    whole = np.zeros((1, 4), dtype=np.int64)
    whole[0, 1], whole[0, 3] = height, width
    tiles = (width + TILE - 1) // TILE
    windows = np.empty((MOST_WINDOWS, 4), dtype=np.int64)
    count = 0
    found = np.full(tiles, -1, dtype=np.int64)  # the window of each tile of this row of tiles
    for y in range(height):
        if y % TILE == 0:
            found[:] = -1
        old, new = before[y], after[y]
        differs = False
        for x in range(width):
            differs |= old[x] != new[x]
        if not differs:
            continue
        for tile in range(tiles):
            first, last = -1, -1
            for x in range(tile * TILE, min((tile + 1) * TILE, width)):
                if old[x] != new[x]:
                    first = x if first < 0 else first
                    last = x
            if first < 0:
                continue
            if found[tile] < 0:
                if count == MOST_WINDOWS:
                    return whole
                found[tile] = count
                windows[count, 0], windows[count, 2], windows[count, 3] = y, first, last
                count += 1
            window = windows[found[tile]]
            window[1] = y
            window[2], window[3] = min(window[2], first), max(window[3], last)
    for n in range(count):
        window = windows[n]
        window[0], window[1] = max(window[0] - margin, 0), min(window[1] + margin + 1, height)
        window[2], window[3] = max(window[2] - margin, 0), min(window[3] + margin + 1, width)
    merged = True
    while merged:
        merged = False
        for n in range(count - 1, 0, -1):
            a = windows[n]
            for m in range(n):
                b = windows[m]
                if a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3]:
                    b[0], b[1] = min(a[0], b[0]), max(a[1], b[1])
                    b[2], b[3] = min(a[2], b[2]), max(a[3], b[3])
                    count -= 1
                    for side in range(4):
                        a[side] = windows[count, side]
                    merged = True
                    break
    covered = 0
    for n in range(count):
        window = windows[n]
        covered += (window[1] - window[0]) * (window[3] - window[2])
    return whole if 2 * covered > height * width else windows[:count].copy()


@jit
def has_graded(cost: Int8s, blocked: Bools, unknown_cost: int) -> bool:
    """Tell whether any free cell costs something; `cost` and `blocked` are [height, width]."""
    unknown = 0 if unknown_cost > 0 else -128  # cells below it cost something
    for y in range(len(cost)):
        values, walls = cost[y], blocked[y]
        graded = False
        for x in range(values.size):
            graded |= ((values[x] > 0) | (values[x] < unknown)) & (not walls[x])
        if graded:
            return True
    return False


@jit
def cover(points: Float64s, ends: Int64s, on_border: float, inside: Bools, border: Bools) -> None:
    """Mark the cells whose centres lie inside rings, and those that the rings pass through.

    `points` [n, 2] are grid coordinates, where cell centres are integers; a ring ends before each
    of `ends`, with its first point once more. Inside is decided by the even-odd rule. `inside`
    and `border`, bool [height, width], begin without marks. What lies within `on_border` cells of
    a cell's border does not pass through the cell.
    """
    height, width = inside.shape
    toggles = np.zeros((height, width + 1), dtype=np.bool_)
    begin = 0
    for end in ends:
        for n in range(begin, end - 1):
            x0, y0, x1, y1 = points[n, 0], points[n, 1], points[n + 1, 0], points[n + 1, 1]
            low, high = min(y0, y1), max(y0, y1)
            left, right = min(x0, x1), max(x0, x1)
            slope = (x1 - x0) / (y1 - y0) if y0 != y1 else 0.0
            # Rows with low <= y < high: each crossing counts once, at shared corners too.
            for y in range(max(math.ceil(low), 0), min(math.ceil(high), height)):
                x = min(max(math.ceil(x0 + (y - y0) * slope), 0), width)
                toggles[y, x] = not toggles[y, x]
            if right < -0.5 or left > width - 0.5:
                continue
            reach = 0.5 - on_border
            for y in range(
                max(math.ceil(low - reach), 0), min(math.floor(high + reach), height - 1) + 1
            ):
                first, last = left, right
                if y0 != y1:
                    a = x0 + (max(low, y - reach) - y0) * slope
                    b = x0 + (min(high, y + reach) - y0) * slope
                    first, last = max(left, min(a, b)), min(right, max(a, b))
                for x in range(
                    max(math.ceil(first - reach), 0), min(math.floor(last + reach), width - 1) + 1
                ):
                    border[y, x] = True
        begin = end
    for y in range(height):
        is_inside = False
        for x in range(width):
            is_inside ^= toggles[y, x]
            inside[y, x] = is_inside


@jit
def raise_to_mask(
    mask: Int8s, table: Int8s, first: Float64s, step_x: Float64s, step_y: Float64s, costs: Int8s
) -> None:
    """Raise costs [height, width] to what the values of a mask on another grid mean.

    The value at cell (x, y) is that of the mask's cell (x, y) that contains
    `first` + x * `step_x` + y * `step_y`; `table` [101] says what it means. Unknown values and
    cells off the mask change nothing.
    """
    rows, columns = mask.shape
    for y in range(costs.shape[0]):
        for x in range(costs.shape[1]):
            column = first[0] + x * step_x[0] + y * step_y[0]
            row = first[1] + x * step_x[1] + y * step_y[1]
            if 0.0 <= column < columns and 0.0 <= row < rows:
                value = mask[int(row), int(column)]
                if value >= 0:
                    costs[y, x] = max(costs[y, x], table[value])
