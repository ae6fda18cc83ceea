# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of reference searches: the least sum of weights, and what can be reached."""

from __future__ import annotations

import heapq
import math

import numpy as np

from llm_astar_planner.search.arrays import Bools, Float32s, Float64s, Uint8s
from llm_astar_planner.search.kernel_cache import jit

# The eight moves; weights are stored for the first four, at the cell that the move leaves.
STEP_X = np.array([1, 0, 1, -1, -1, 0, -1, 1])
STEP_Y = np.array([0, 1, 1, 1, 0, -1, -1, -1])
# Cells. A centre nearer to a line than this lies on it.
ON_LINE = 1e-6


@jit
def can_move(blocked: Bools, corner_cutting: bool, x: int, y: int, to_x: int, to_y: int) -> bool:
    """Tell whether a robot in a free cell may move to a neighbour."""
    height, width = blocked.shape
    if to_x < 0 or to_x >= width or to_y < 0 or to_y >= height or blocked[to_y, to_x]:
        return False
    return corner_cutting or not (blocked[y, to_x] or blocked[to_y, x])


@jit
def least_sum(
    blocked: Bools, corner_cutting: bool, weights: Float32s, x: int, y: int, goals: Bools
) -> float:
    """Return the least sum of weights of the moves from (x, y) to any goal, inf without a path.

    `weights` [4, height, width], 0 and up, are those of the moves to the right, up, up right and
    up left from each cell; the moves back weigh the same. Dijkstra's algorithm; moves of weight
    0 go through a stack instead of the queue. O(cells log cells) time.
    """
    height, width = blocked.shape
    best = np.full(height * width, np.inf)
    done = np.zeros(height * width, dtype=np.bool_)
    stack = np.empty(height * width + 1, dtype=np.int32)
    best[y * width + x] = 0.0
    queue = [(0.0, y * width + x)]
    while len(queue) > 0:
        total, cell = heapq.heappop(queue)
        stack[0] = cell
        count = 1
        while count > 0:
            count -= 1
            cell = stack[count]
            if done[cell]:
                continue
            done[cell] = True
            y = cell // width
            x = cell - y * width
            if goals[y, x]:
                return total
            for move in range(8):
                to_x = x + STEP_X[move]
                to_y = y + STEP_Y[move]
                if not can_move(blocked, corner_cutting, x, y, to_x, to_y):
                    continue
                if move < 4:
                    sum_there = total + weights[move, y, x]
                else:
                    sum_there = total + weights[move - 4, to_y, to_x]
                other = to_y * width + to_x
                if done[other] or sum_there >= best[other]:
                    continue
                best[other] = sum_there
                if sum_there == total:
                    stack[count] = other
                    count += 1
                else:
                    heapq.heappush(queue, (sum_there, other))
    return math.inf


@jit
def reach(
    blocked: Bools, corner_cutting: bool, removed: Bools, line: Float64s, starts: Bools
) -> Uint8s:
    """Return which cells can be reached from `starts` by moves between cells that are not removed.

    `starts` is bool [height, width]; what is removed or blocked is none. `removed` cells may
    still be passed by their corners. `line`, (x, y, dx, dy), is a ray that no move may cross,
    from a point in a direction of length 1, or all NaN. A cell whose centre lies on the ray may
    be entered and left on the same side only. The result is uint8 [height, width]: 1 reached, or
    reached from the left of the ray, 2 from its right, 3 both.
    """
    height, width = blocked.shape
    reached = np.zeros((height, width), dtype=np.uint8)
    with_line = not math.isnan(line[0])
    stack = [(0, 0, 1) for _ in range(0)]
    for start in np.flatnonzero(starts & ~removed & ~blocked):
        y = int(start) // width
        x = int(start) - y * width
        stack.append((x, y, 1))
        reached[y, x] = 1
        if with_line and side_of(line, x, y) == 0:
            stack.append((x, y, 2))
            reached[y, x] = 3
    while len(stack) > 0:
        x, y, bit = stack.pop()
        side = side_of(line, x, y) if with_line else 1
        for move in range(8):
            to_x = x + STEP_X[move]
            to_y = y + STEP_Y[move]
            if not can_move(blocked, corner_cutting, x, y, to_x, to_y) or removed[to_y, to_x]:
                continue
            to_bit = 1
            if with_line:
                to_side = side_of(line, to_x, to_y)
                if to_side == 0:
                    to_bit = bit if side == 0 else (1 if side > 0 else 2)
                elif side == 0:
                    if to_side != (1 if bit == 1 else -1):
                        continue
                elif to_side != side and crosses(line, x, y, to_x, to_y):
                    continue
            if not reached[to_y, to_x] & to_bit:
                reached[to_y, to_x] |= to_bit
                stack.append((to_x, to_y, to_bit))
    return reached


@jit
def side_of(line: Float64s, x: int, y: int) -> int:
    """Return 1 for a point left of the ray's line, -1 right of it; 0 on the ray itself.

    On the line behind the ray's origin everything counts as left: nothing is crossed there.
    """
    across = line[2] * (y - line[1]) - line[3] * (x - line[0])
    if abs(across) > ON_LINE:
        return 1 if across > 0.0 else -1
    along = line[2] * (x - line[0]) + line[3] * (y - line[1])
    return 0 if along >= -ON_LINE else 1


@jit
def crosses(line: Float64s, x: int, y: int, to_x: int, to_y: int) -> bool:
    """Tell whether a move from one side of the ray's line to the other crosses the ray itself."""
    across = line[2] * (y - line[1]) - line[3] * (x - line[0])
    to_across = line[2] * (to_y - line[1]) - line[3] * (to_x - line[0])
    share = across / (across - to_across) if across != to_across else 0.0
    hit_x = x + share * (to_x - x) - line[0]
    hit_y = y + share * (to_y - y) - line[1]
    return line[2] * hit_x + line[3] * hit_y > ON_LINE
