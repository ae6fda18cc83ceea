# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of the landmarks: distances from one cell to all others, and their repair.

See `_kernels/astar` for the layout of cells and moves. A landmark's distances are one contiguous
row, int32 [cells], in units, -1 where it does not reach.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import STEP_X, STEP_Y, Cells, push
from llm_astar_planner.search.kernel_cache import jit

CANONICAL_SUCCESSORS, LOWEST = shared.CANONICAL_SUCCESSORS, shared.LOWEST

# Slots of the control array: the state of a run between two calls.
D_BUCKET, D_SEED, D_FREE, D_TOP, D_LIVE, D_EXPANDED, D_SIZE = range(7)
# A queue entry holds cell << 32 | move that led there << 28 | number of the next entry.
_MOVE_SHIFT = 28
_NEXT_MASK = (1 << _MOVE_SHIFT) - 1
# Instead of a move: the row of CANONICAL_SUCCESSORS that keeps all moves.
_ANY_MOVE = 8


@jit
def propagate(
    cells: Cells,
    single: bool,
    seeds: NDArray[np.int64],
    distances: NDArray[np.int32],
    pool: NDArray[np.int64],
    heads: NDArray[np.int32],
    control: NDArray[np.int64],
    quota: int,
    stop: NDArray[np.uint8],
) -> int:
    """Lower the `distances` of all cells that the seeds bring nearer: Dijkstra's algorithm.

    `seeds` holds distance << 32 | cell in ascending order, cells whose lower distance is already
    in `distances`. `single` skips superfluous moves, which is exact only from a single source and
    on a single map, where a move joins any two free cells side by side. `heads` and `control` are
    zero at first. At most `quota` cells are expanded. Returns FOUND when all is done, STOPPED,
    OVERFLOW, RUNNING (the quota is used up) or NEED_SPACE (the pool is full): after the last two
    call again, with a longer copy of the pool.
    """
    moves, cell_surcharge, width, straight, diagonal = cells
    graded = cell_surcharge.size > 0
    offsets = STEP_Y * width + STEP_X
    lengths = np.array([straight] * 4 + [diagonal] * 4)
    ring = heads.size - 1
    bucket, seed = control[D_BUCKET], control[D_SEED]
    free, top, live = control[D_FREE], control[D_TOP], control[D_LIVE]
    count = 0
    status = shared.FOUND
    # The bucket of the next seed.
    due = seeds[seed] >> 32 + shared.BUCKET_BITS if seed < seeds.size else shared.NO_PATH
    slot: Any
    while live > 0 or seed < seeds.size:
        if top + 8 > pool.size:
            status = shared.NEED_SPACE
            break
        if live == 0:
            bucket = max(bucket, due)
        slot = bucket & ring
        if bucket >= due:
            item = (seeds[seed] & 0xFFFFFFFF) << 32 | _ANY_MOVE << _MOVE_SHIFT
            _, free, top = push(pool, heads, slot, item, free, top)
            live += 1
            seed += 1
            due = seeds[seed] >> 32 + shared.BUCKET_BITS if seed < seeds.size else shared.NO_PATH
            continue
        entry = np.int64(heads[np.uint64(slot)])
        if entry == 0:
            bucket += 1
            continue
        item = pool[np.uint64(entry - 1)]
        cell = item >> 32
        g = np.int64(distances[np.uint64(cell)])
        if g >> shared.BUCKET_BITS == bucket:
            if count >= quota:
                status = shared.RUNNING
                break
            count += 1
            if count & shared.POLL_MASK == 0 and stop[0] != 0:
                status = shared.STOPPED
                break
        heads[np.uint64(slot)] = item & _NEXT_MASK
        pool[np.uint64(entry - 1)] = free
        free = entry
        live -= 1
        # A bucket is narrower than a move: a distance is final when its bucket is the current one.
        if g >> shared.BUCKET_BITS != bucket:
            continue
        if g > shared.LIMIT:
            status = shared.OVERFLOW
            break
        row = (item >> _MOVE_SHIFT & 15) << 8
        if not single:
            row = np.int64(shared.EVERY_MOVE)
        elif graded and row != shared.EVERY_MOVE:
            row += shared.FORWARD
        mask = np.int64(CANONICAL_SUCCESSORS[np.uint64(row | moves[np.uint64(cell)])])
        price = np.int64(cell_surcharge[np.uint64(cell)]) if graded else 0
        while mask:
            move = np.uint64(LOWEST[np.uint64(mask)])
            mask &= mask - 1
            other = np.uint64(cell + offsets[move])
            other_g = g + lengths[move]
            if graded:
                other_g += lengths[move] * (price + np.int64(cell_surcharge[other])) >> 9
            # Unsigned, -1 is more than any distance.
            if other_g < np.uint32(distances[other]):
                distances[other] = other_g
                item = np.int64(other) << 32 | np.int64(move) << _MOVE_SHIFT
                _, free, top = push(
                    pool, heads, other_g >> shared.BUCKET_BITS & ring, item, free, top
                )
                live += 1
    control[D_BUCKET], control[D_SEED] = bucket, seed
    control[D_FREE], control[D_TOP], control[D_LIVE] = free, top, live
    control[D_EXPANDED] += count
    return status


@jit
def merge_freer(
    cells: Cells, freest: Cells, windows: NDArray[np.int64], changed: NDArray[np.int64]
) -> tuple[int, int, int]:
    """Add to the second map what is freer on the first: its moves and its lower surcharges.

    Only in windows, int64 [n, 4]. Surcharges count where a cell has moves. Of the cells that
    changed writes those that had no moves before to the front of `changed` [cells], the others to
    its end. Returns how many of each there are, and how many cells of the windows are now
    stricter on the first map than on the second.
    """
    moves, cell_surcharge, width, _, _ = cells
    least_moves, least_surcharge, _, _, _ = freest
    graded = cell_surcharge.size > 0
    freed = cheaper_cells = stricter = 0
    for n in range(len(windows)):
        top, bottom, left, right = windows[n]
        for y in range(top, bottom):
            begin, end = y * width + left, y * width + right
            # Most rows are equal: loops without branches, for many cells at once.
            differs = False
            new, old = moves[begin:end], least_moves[begin:end]
            for x in range(new.size):
                differs |= new[x] != old[x]
            if graded:
                new_cost, old_cost = cell_surcharge[begin:end], least_surcharge[begin:end]
                for x in range(new_cost.size):
                    differs |= new_cost[x] != old_cost[x]
            if not differs:
                continue
            for cell in range(begin, end):
                mask, least = moves[cell], least_moves[cell]
                cheaper = graded and cell_surcharge[cell] < least_surcharge[cell]
                if mask & ~least or (mask and cheaper):
                    if graded and (least == 0 or cheaper):
                        least_surcharge[cell] = cell_surcharge[cell]
                    least_moves[cell] |= mask
                    if least == 0:
                        changed[freed] = cell
                        freed += 1
                    else:
                        cheaper_cells += 1
                        changed[moves.size - cheaper_cells] = cell
                elif mask != least or (graded and cell_surcharge[cell] != least_surcharge[cell]):
                    stricter += 1
    return freed, cheaper_cells, stricter


@jit
def free_isolated(
    cells: Cells,
    limit: int,
    freed: NDArray[np.int64],
    marks: NDArray[np.uint8],
    changed: NDArray[np.int64],
) -> int:
    """Remove each isolated obstacle that has lost one of the cells `freed`: it is moving.

    That is a group of at most `limit` blocked cells. Around it the surcharges that fall with the
    distance from it become 0. `marks` [cells] is zero at first. Writes the cells whose moves or
    surcharge change to `changed` [cells]; returns their number.
    """
    moves, width = cells.moves, cells.width
    height = moves.size // width
    count = 0
    for start in freed:
        for turn in range(8):
            first = neighbour(start, turn, width, height)
            if first < 0 or moves[first] != 0 or marks[first] != 0:
                continue
            # The group of blocked cells around this one, at changed[count:end].
            changed[count] = first
            marks[first] = 1
            end, done = count + 1, count
            isolated = True
            while done < end and isolated:
                for move in range(8):
                    other = neighbour(changed[done], move, width, height)
                    if other >= 0 and moves[other] == 0:
                        if marks[other] == 2 or end - count == limit:
                            isolated = False
                        elif marks[other] == 0:
                            marks[other] = 1
                            changed[end] = other
                            end += 1
                done += 1
            if not isolated:
                for index in range(count, end):
                    marks[changed[index]] = 2
                continue
            count = remove(cells, 8 * limit, marks, changed, count, end)
    return count


@jit
def remove(
    cells: Cells,
    limit: int,
    marks: NDArray[np.uint8],
    changed: NDArray[np.int64],
    begin: int,
    end: int,
) -> int:
    """Free the cells changed[begin:end] and lower the surcharges around them; see above.

    Appends at most `limit` cells more to `changed`; returns where they end.
    """
    moves, cell_surcharge, width, _, _ = cells
    height = moves.size // width
    graded = cell_surcharge.size > 0
    last = end
    for index in range(begin, end):
        for move in range(8):
            other = neighbour(changed[index], move, width, height)
            if other >= 0 and marks[other] == 0 and moves[other] != 0:
                marks[other] = 3
                changed[last] = other
                last += 1
    for index in range(begin, last):
        moves[changed[index]] |= moves_among(moves, marks, changed[index], width, height)
    index = end
    while graded and index < last and last - end < limit:
        cell = changed[index]
        index += 1
        for move in range(8):
            other = neighbour(cell, move, width, height)
            if other < 0 or marks[other] != 0 or moves[other] == 0:
                continue
            if 0 < cell_surcharge[other] < cell_surcharge[cell]:
                marks[other] = 3
                changed[last] = other
                last += 1
    for index in range(begin, last):
        marks[changed[index]] = 0
        if graded:
            cell_surcharge[changed[index]] = 0
    return last


@jit
def neighbour(cell: int, move: int, width: int, height: int) -> int:
    """Return the cell that a move leads to, -1 if that is off the grid."""
    y = cell // width
    x = cell - y * width + STEP_X[move]
    y += STEP_Y[move]
    return y * width + x if 0 <= x < width and 0 <= y < height else -1


@jit
def moves_among(
    moves: NDArray[np.uint8], marks: NDArray[np.uint8], cell: int, width: int, height: int
) -> int:
    """Return the moves that a cell gains when the cells marked 1 become free."""
    free = removed = gained = 0
    for move in range(8):
        other = neighbour(cell, move, width, height)
        if other >= 0:
            removed |= (marks[other] == 1) << move
            free |= (moves[other] != 0) << move
    free |= removed
    for move in range(8):
        # A diagonal needs both cells beside it.
        beside = 1 << move - 4 | 1 << (move - 3) % 4 if move >= 4 else 0
        needed = beside | 1 << move
        if free & needed == needed and (marks[cell] == 1 or removed & needed):
            gained |= 1 << move
    return gained


@jit
def find_seeds(
    cells: Cells,
    changed: NDArray[np.int64],
    distances: NDArray[np.int32],
    seeds: NDArray[np.int64],
) -> int:
    """Lower the `distances` of the changed cells and of their neighbours, one move far.

    `changed` are cells that got more moves or a lower surcharge on this map. Writes what
    `propagate` continues from to `seeds` [9 * changed] in its form; returns their number.
    """
    moves, cell_surcharge, width, straight, diagonal = cells
    graded = cell_surcharge.size > 0
    count = 0
    for cell in changed:
        before = np.int64(np.uint32(distances[cell]))
        g = before
        mask = np.int64(moves[cell])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other = cell + STEP_Y[move] * width + STEP_X[move]
            length = straight if move < 4 else diagonal
            if graded:
                length += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[other]) >> 9
            if distances[other] >= 0:
                g = min(g, distances[other] + length)
        if g < before:
            distances[cell] = g
            seeds[count] = g << 32 | cell
            count += 1
            continue
        # The ends of a new move are both changed cells; a lower surcharge helps any neighbour.
        mask = np.int64(moves[cell]) if graded and distances[cell] >= 0 else np.int64(0)
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other = cell + STEP_Y[move] * width + STEP_X[move]
            length = straight if move < 4 else diagonal
            length += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[other]) >> 9
            if g + length < np.uint32(distances[other]):
                distances[other] = g + length
                seeds[count] = g + length << 32 | other
                count += 1
    seeds[:count].sort()
    return count
