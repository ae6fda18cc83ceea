# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops that look for what closes every way: floods, distances, and the widest way.

Grids are flat here and have a frame of one closed cell around the map.
"""

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int32s, Uint8s
from llm_astar_planner.search.kernel_cache import jit

# What `flood` notes of a cell: reached, and met but not open.
REACHED, EDGE = 1, 2


@jit
def flood(
    groups: Int32s, is_open: Bools, steps: Int32s, targets: Bools, seen: Uint8s, first: Int32s
) -> tuple[int, Int32s]:
    """Reach all cells of open groups from the `first` ones, until one is a target.

    `groups` [cells] numbers what closes a cell, 0 what nothing opens; `is_open` [groups]. Fills
    `seen`; returns the target or -1, and the closed cells met.
    """
    stack, edges = np.empty(groups.size, dtype=np.int32), np.empty(groups.size, dtype=np.int32)
    met, count = 0, len(first)
    for n in range(count):
        stack[n] = first[n]
        seen[first[n]] = REACHED
        if targets[first[n]]:
            return int(first[n]), edges[:0]
    while count:
        count -= 1
        cell = stack[count]
        for step in steps:
            other = cell + step
            if seen[other]:
                continue
            if not is_open[groups[other]]:
                seen[other] = EDGE
                edges[met] = other
                met += 1
                continue
            seen[other] = REACHED
            if targets[other]:
                return int(other), edges[:met]
            stack[count] = other
            count += 1
    return -1, edges[:met]


@jit
def room_of(
    lethal: Bools, reach: int, groups: Int32s, is_open: Bools, wide_groups: Int32s, is_wide: Bools
) -> Int32s:
    """Return the squared distance to the nearest lethal cell: [height + 2, width + 2].

    In cells: 0 where the group is not open, and the most, one beyond `reach` squared, where the
    other group is wide. Axis by axis, see `costmap._kernels`.
    """
    height, width = lethal.shape
    squared = np.zeros((height + 2, width + 2), dtype=np.int32)
    steps = np.full((height, width), reach + 1, dtype=np.int16)
    for y in range(height):
        row, before, walls = steps[y], steps[max(y - 1, 0)], lethal[y]
        for x in range(width):
            row[x] = 0 if walls[x] else min(before[x] + 1, reach + 1)
    for y in range(height - 2, -1, -1):
        row, after = steps[y], steps[y + 1]
        for x in range(width):
            row[x] = min(row[x], after[x] + 1)
    for y in range(height):
        row = steps[y]
        for x in range(width):
            best = (reach * reach + 1) * is_open[groups[y, x]]
            step = reach + 1 if is_wide[wide_groups[y, x]] else 0
            while step * step < best:
                nearest = min(row[max(x - step, 0)], row[min(x + step, width - 1)])
                best = min(best, nearest * nearest + step * step)
                step += 1
            squared[y + 1, x + 1] = best
    return squared


@jit
def nearest_reached(seen: Uint8s, x: int, y: int) -> tuple[int, int]:
    """Return the row and column of a reached cell nearest to another, -1 if there is none.

    `seen` is [height, width]; the other cell may lie off it.
    """
    best, row, column = -1, -1, -1
    for j in range(seen.shape[0]):
        if best >= 0 and (j - y) ** 2 >= best:
            continue
        for i in range(seen.shape[1]):
            squared = (i - x) ** 2 + (j - y) ** 2
            if seen[j, i] == REACHED and (best < 0 or squared < best):
                best, row, column = squared, j, i
    return row, column


@jit
def widest(
    room: Int32s, steps: Int32s, targets: Bools, seen: Uint8s, edges: Int32s
) -> tuple[int, int, int]:
    """Return the target that the widest way leads to, its least room, and where that is.

    `room` [cells] is from 0, closed. The way goes on from what a flood has `seen`, at `edges`. No
    other way to a target has more room; -1 and 0 if none is open.
    """
    heads = np.full(room.max() + 1, -1, dtype=np.int32)
    following, stack = np.empty(room.size, dtype=np.int32), np.empty(room.size, dtype=np.int32)
    for cell in edges:
        following[cell] = heads[room[cell]]
        heads[room[cell]] = cell
    for least in range(heads.size - 1, 0, -1):
        narrowest = heads[least]
        while narrowest >= 0:
            stack[0], count = narrowest, 1
            while count:
                count -= 1
                cell = np.int64(stack[count])
                if targets[cell]:
                    return int(cell), least, narrowest
                for step in steps:
                    other = cell + step
                    if seen[other]:
                        continue
                    seen[other] = REACHED
                    width = room[other]
                    if width >= least:
                        stack[count] = other
                        count += 1
                    elif width > 0:
                        following[other] = heads[width]
                        heads[width] = other
            narrowest = following[narrowest]
    return -1, 0, -1
