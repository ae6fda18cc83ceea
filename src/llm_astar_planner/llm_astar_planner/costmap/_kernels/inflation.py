# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The compiled loop that inflates the lethal cells of a map."""

from __future__ import annotations

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int8s, Int64s
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
