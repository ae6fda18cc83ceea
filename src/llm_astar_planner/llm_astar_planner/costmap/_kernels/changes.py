# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops that find where two maps differ, and whether costs are graded."""

from __future__ import annotations

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int8s, Int64s
from llm_astar_planner.search.kernel_cache import jit

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
