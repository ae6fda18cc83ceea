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
    squared: NDArray[np.int32],
) -> None:
    """Fill `squared` [height, width] with the squared distance to the nearest lethal cell.

    In cells; exact up to `reach` squared, that plus one beyond, and 0 in groups that are not open.
    See `costmap._kernels.inflation` for the source.
    """
    height, width = lethal.shape
    most = reach * reach + 1
    steps = np.full(width, reach + 1, dtype=np.int32)
    for y in range(height):
        for x in range(width):
            steps[x] = 0 if lethal[y, x] else min(steps[x] + 1, reach + 1)
        squared[y] = steps
    steps[:] = reach + 1
    padded = np.full(width + 2 * reach, most, dtype=np.int32)
    for y in range(height - 1, -1, -1):
        row, least = squared[y], reach + 1
        for x in range(width):
            steps[x] = 0 if lethal[y, x] else min(steps[x] + 1, reach + 1)
            nearest = min(row[x], steps[x])
            least = min(least, nearest)
            row[x] = min(most, nearest * nearest)
        padded[reach : reach + width] = row
        for step in range(1, reach + 1):
            if least > reach or least * least + step * step >= most:
                break
            west = padded[reach - step : reach - step + width]
            east = padded[reach + step : reach + step + width]
            for x in range(width):
                row[x] = min(row[x], min(west[x], east[x]) + step * step)
        for x in range(width):
            if not is_open[groups[y, x]]:
                row[x] = 0


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
    room: NDArray[np.int32], steps: NDArray[np.int32], targets: NDArray[np.bool_], start: int
) -> tuple[int, int, int]:
    """Return the target that the widest way from `start` leads to, its least room, and where.

    `room` [cells] is from 0, closed. No other way to a target has more; -1 and 0 if none is open.
    """
    heads = np.full(room.max() + 1, -1, dtype=np.int32)
    following = np.empty(room.size, dtype=np.int32)
    # Cells, each with the narrowest one on the way to it.
    stack = np.empty((room.size, 2), dtype=np.int32)
    seen = np.zeros(room.size, dtype=np.bool_)
    seen[start], following[start], heads[room[start]] = True, -1, start
    for least in range(room[start], 0, -1):
        count, head = 0, heads[least]
        while head >= 0:
            stack[count] = head
            count, head = count + 1, following[head]
        while count:
            count -= 1
            cell, narrowest = stack[count, 0], stack[count, 1]
            if targets[cell]:
                return cell, least, narrowest
            for step in steps:
                other = cell + step
                width = room[other]
                if width == 0 or seen[other]:
                    continue
                seen[other] = True
                if width >= least:
                    stack[count, 0], stack[count, 1] = other, narrowest
                    count += 1
                else:
                    following[other] = heads[width]
                    heads[width] = other
    return -1, 0, start
