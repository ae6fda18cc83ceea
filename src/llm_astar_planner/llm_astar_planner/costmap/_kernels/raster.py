# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops that find the cells which polygons cover."""

from __future__ import annotations

import math

import numpy as np

from llm_astar_planner.search.arrays import Bools, Float64s, Int8s, Int64s
from llm_astar_planner.search.kernel_cache import jit


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
