# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops that look for what closes every way: floods, distances, and the widest way.

Grids are flat here and have a frame of one closed cell around the map.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.kernel_cache import jit

# What `flood` notes of a cell: reached, and met but not open.
REACHED, EDGE = 1, 2


@jit
def flood(
    groups: NDArray[np.int32],
    is_open: NDArray[np.bool_],
    steps: NDArray[np.int32],
    targets: NDArray[np.bool_],
    seen: NDArray[np.uint8],
    stack: NDArray[np.int32],
    count: int,
    edges: NDArray[np.int32],
) -> tuple[int, int]:
    """Reach all cells of open groups from the first `count` of `stack`, until one is a target.

    `groups` [cells] numbers what closes a cell, 0 what nothing opens; `is_open` [groups]. Fills
    `seen`, and `edges` with the closed cells met; returns the target or -1, and their number.
    """
    met = 0
    for n in range(count):
        seen[stack[n]] = REACHED
        if targets[stack[n]]:
            return stack[n], met
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
                return other, met
            stack[count] = other
            count += 1
    return -1, met


@jit
def fill_room(
    lethal: NDArray[np.bool_],
    reach: int,
    groups: NDArray[np.int32],
    is_open: NDArray[np.bool_],
    wide_groups: NDArray[np.int32],
    is_wide: NDArray[np.bool_],
    squared: NDArray[np.int32],
) -> None:
    """Fill `squared` [height, width] with the squared distance to the nearest lethal cell.

    In cells: 0 where the group is not open, and the most, one beyond `reach` squared, where the
    other group is wide. Axis by axis, see `costmap._kernels.inflation`.
    """
    height, width = lethal.shape
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
            squared[y, x] = best


@jit
def nearest_reached(seen: NDArray[np.uint8], x: int, y: int) -> tuple[int, int]:
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
    room: NDArray[np.int32],
    steps: NDArray[np.int32],
    targets: NDArray[np.bool_],
    seen: NDArray[np.uint8],
    edges: NDArray[np.int32],
) -> tuple[int, int, int]:
    """Return the target that the widest way leads to, its least room, and where that is.

    `room` [cells] is from 0, closed. The way goes on from what a flood has `seen`, at `edges`. No
    other way to a target has more room; -1 and 0 if none is open.
    """
    heads = np.full(room.max() + 1, -1, dtype=np.int32)
    following = np.empty(room.size, dtype=np.int32)
    stack = np.empty(room.size, dtype=np.int32)
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
