# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of the search over cells and headings.

A state is a cell and one of eight headings, `cell * 8 + heading`; heading h looks h * 45 degrees
from +x towards +y. From a state a robot moves to the cell ahead, or turns by 45 degrees. What a
motion sweeps is a list of spans (row, first column, last column) relative to the cell: spans
`begins[k]` to `begins[k + 1]` are those of the move of heading k, and of the turn from heading
k - 8 to the next one for k from 8 on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import STEP_X, STEP_Y, Cells, heap_pop, heap_push
from llm_astar_planner.search.arrays import Int8s, Int32s, Int64s, Uint8s, Uint16s
from llm_astar_planner.search.kernel_cache import jit

# The move, a bit of `_kernels.astar`, of each heading.
MOVE_OF = np.array([0, 4, 1, 5, 2, 6, 3, 7], dtype=np.int64)
ALL_KNOWN = np.uint16(0xFFFF)
# How a state was reached, the low bits of `came`: not at all, by a move, by a turn from the
# heading before or after it, or as a start. CLOSED is added when it is expanded.
UNSEEN, MOVED, TURNED_UP, TURNED_DOWN, STARTED = range(5)
CLOSED = 8
KIND = 7
# Slots of the control array.
H_SIZE, H_EXPANSIONS, H_STORAGE, H_FOUND, H_SLOTS = range(5)


# What a polygon must not meet: cells int8 [height, width], the occupancy from which they are
# lethal, and whether unknown ones are too.
Obstacles = tuple[Int8s, int, bool]


class SweptCells(NamedTuple):
    """The cells that each motion of a polygon sweeps, relative to the cell where it begins.

    `spans` is int64 [n, 3], (row, first column, last column); those from `begins[k]` to
    `begins[k + 1]` are of motion k: moves by heading, then turns to the next heading. No motion
    leaves the square of `reach` cells to each side.
    """

    spans: Int64s
    begins: Int64s
    reach: int


@jit
def is_lethal(
    cells: Int8s, threshold: int, unknown_blocks: bool, row: int, first: int, last: int
) -> bool:
    """Tell whether a span of a row holds a lethal cell or leaves the map."""
    height, width = cells.shape
    if row < 0 or row >= height or first < 0 or last >= width:
        return True
    line = cells[row, first : last + 1]
    found = False
    for n in range(line.size):
        found |= (line[n] >= threshold) | (unknown_blocks & (line[n] < 0))
    return found


@jit
def fits(
    obstacles: Obstacles, swept: SweptCells, known: Uint16s, free: Uint16s, cell: int, motion: int
) -> bool:
    """Tell whether what a motion from a cell sweeps is free; remember it in `known` and `free`."""
    spans, begins, reach = swept
    width = obstacles[0].shape[1]
    bit = np.uint16(1 << motion)
    if known[cell] & bit:
        return bool(free[cell] & bit)
    y = cell // width
    x = cell - y * width
    if known[cell] == 0:
        # Far from obstacles one look tells of all motions.
        for row in range(y - reach, y + reach + 1):
            if is_lethal(*obstacles, row, x - reach, x + reach):
                break
        else:
            known[cell] = free[cell] = ALL_KNOWN
            return True
    known[cell] |= bit
    for n in range(begins[motion], begins[motion + 1]):
        row, first, last = y + spans[n, 0], x + spans[n, 1], x + spans[n, 2]
        if is_lethal(*obstacles, row, first, last):
            return False
    free[cell] |= bit
    return True


@jit
def search(
    grid: Cells,
    obstacles: Obstacles,
    swept: SweptCells,
    to_goal: Int32s,
    known: Uint16s,
    free: Uint16s,
    costs: Int32s,
    came: Uint8s,
    keys: Int64s,
    states: Int64s,
    control: Int64s,
    goal: int,
    goal_headings: int,
    quota: int,
) -> int:
    """Run or resume an A* over cells and headings for up to `quota` expansions.

    `to_goal` [cells] holds the exact costs to the goal without the polygon, -1 where there is no
    way: never more than what is left, so the first time that a state is expanded its cost is the
    least. A turn costs nothing. `costs` [8 * cells] are costs plus 1, 0 where never seen; ties
    go to the state nearer to the goal. Returns RUNNING, FOUND, EXHAUSTED, OVERFLOW, or NEED_SPACE
    if the heap (`keys`, `states`) is nearly full: call again with a longer copy.
    """
    moves, cell_surcharge, width, straight, diagonal = grid
    graded = cell_surcharge.size > 0
    size, count = control[H_SIZE], 0
    status = shared.EXHAUSTED
    while size > 0:
        if count >= quota:
            status = shared.RUNNING
            break
        if size + 3 > keys.size:
            status = shared.NEED_SPACE
            break
        state = heap_pop(keys, states, size, False)
        size -= 1
        if came[state] & CLOSED:
            continue
        came[state] |= CLOSED
        count += 1
        cell, heading = state >> 3, state & 7
        if cell == goal and goal_headings >> heading & 1:
            control[H_FOUND] = state
            status = shared.FOUND
            break
        cost = np.int64(costs[state])
        if cost > shared.LIMIT:
            status = shared.OVERFLOW
            break
        for motion in range(3):
            other, other_cost = state, cost
            if motion == 0:
                move = MOVE_OF[heading]
                if moves[cell] >> move & 1 == 0:
                    continue
                other_cell = cell + STEP_Y[move] * width + STEP_X[move]
                if to_goal[other_cell] < 0:
                    continue
                length = straight if move < 4 else diagonal
                other_cost += length
                if graded:
                    pair = np.int64(cell_surcharge[cell]) + cell_surcharge[other_cell]
                    other_cost += length * pair >> 9
                other, motion_swept, kind = other_cell * 8 + heading, heading, MOVED
            elif motion == 1:
                other = cell * 8 + (heading + 1 & 7)
                motion_swept, kind = 8 + heading, TURNED_UP
            else:
                other = cell * 8 + (heading - 1 & 7)
                motion_swept, kind = 8 + (heading - 1 & 7), TURNED_DOWN
            before = np.int64(costs[other])
            if before != 0 and before <= other_cost:
                continue
            if not fits(obstacles, swept, known, free, cell, motion_swept):
                continue
            control[H_STORAGE] += before == 0
            costs[other] = other_cost
            came[other] = kind
            left = np.int64(to_goal[other >> 3])
            heap_push(keys, states, size, other_cost + left << 31 | left, other, False)
            size += 1
    control[H_SIZE] = size
    control[H_EXPANSIONS] += count
    return status


@jit
def trace(came: Uint8s, width: int, state: int, path: Int32s) -> tuple[int, int]:
    """Write the cells (x, y) from the start to a state to the end of `path`, as many as fit.

    Returns how many cells there are, and the heading at the start.
    """
    count, row = 0, len(path)
    last = -1
    while True:
        cell, heading = state >> 3, state & 7
        if cell != last:
            count += 1
            row -= 1
            last = cell
            if row >= 0:
                path[row, 0], path[row, 1] = cell % width, cell // width
        kind = came[state] & KIND
        if kind == STARTED:
            return count, heading
        if kind == MOVED:
            move = MOVE_OF[heading]
            state = (cell - STEP_Y[move] * width - STEP_X[move]) * 8 + heading
        elif kind == TURNED_UP:
            state = cell * 8 + (heading - 1 & 7)
        else:
            state = cell * 8 + (heading + 1 & 7)
