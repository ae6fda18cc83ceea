"""Compiled loops of the landmarks: exact distances from one cell to all others.

See `_kernels/astar` for the layout of cells and moves. A landmark's distances are one contiguous
row, int32 [cells], in units, -1 where it does not reach.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from llm_astar_planner.search._kernels.astar import (
    BUCKET_BITS,
    CANONICAL_SUCCESSORS,
    FOUND,
    LIMIT,
    LOWEST,
    NEED_SPACE,
    NO_PATH,
    OVERFLOW,
    POLL_MASK,
    RUNNING,
    STEP_X,
    STEP_Y,
    STOPPED,
)

# Slots of the control array: the state of a run between two calls.
D_BUCKET, D_SEED, D_FREE, D_TOP, D_LIVE, D_SIZE = range(6)
# A queue entry holds cell << 32 | move that led there << 28 | number of the next entry.
_MOVE_SHIFT = 28
_NEXT_MASK = (1 << _MOVE_SHIFT) - 1
# The row of CANONICAL_SUCCESSORS that keeps all moves.
_ANY_MOVE = 8

_jit: Any = njit(cache=True, nogil=True)


@_jit
def propagate(
    moves: NDArray[np.uint8],
    cell_surcharge: NDArray[np.uint16],
    width: int,
    straight: int,
    diagonal: int,
    canonical: bool,
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
    in `distances`. `canonical` skips superfluous moves, which is exact only on uniform costs and
    from a single source. `heads` and `control` are zero at first. At most `quota` cells are
    expanded. Returns FOUND when all is done, STOPPED, OVERFLOW, RUNNING (the quota is used up) or
    NEED_SPACE (the pool is full): after the last two call again, with a longer copy of the pool.
    """
    graded = cell_surcharge.size > 0
    ring = heads.size - 1
    bucket, seed = control[D_BUCKET], control[D_SEED]
    free, top, live = control[D_FREE], control[D_TOP], control[D_LIVE]
    count = 0
    status = FOUND
    # The bucket of the next seed.
    due = seeds[seed] >> 32 + BUCKET_BITS if seed < seeds.size else NO_PATH
    entry: Any
    slot: Any
    while live > 0 or seed < seeds.size:
        if top + 8 > pool.size:
            status = NEED_SPACE
            break
        if live == 0:
            bucket = max(bucket, due)
        slot = bucket & ring
        if bucket >= due:
            if free:
                entry = free
                free = pool[entry - 1]
            else:
                top += 1
                entry = top
            cell = seeds[seed] & 0xFFFFFFFF
            pool[entry - 1] = cell << 32 | _ANY_MOVE << _MOVE_SHIFT | heads[slot]
            heads[slot] = entry
            live += 1
            seed += 1
            due = seeds[seed] >> 32 + BUCKET_BITS if seed < seeds.size else NO_PATH
            continue
        entry = np.int64(heads[slot])
        if entry == 0:
            bucket += 1
            continue
        item = pool[entry - 1]
        cell = item >> 32
        g = np.int64(distances[cell])
        if g >> BUCKET_BITS == bucket:
            if count >= quota:
                status = RUNNING
                break
            count += 1
            if count & POLL_MASK == 0 and stop[0] != 0:
                status = STOPPED
                break
        heads[slot] = item & _NEXT_MASK
        pool[entry - 1] = free
        free = entry
        live -= 1
        # A bucket is narrower than a move: a distance is final when its bucket is the current one.
        if g >> BUCKET_BITS != bucket:
            continue
        if g > LIMIT:
            status = OVERFLOW
            break
        came = (item >> _MOVE_SHIFT & 15) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[came | moves[cell]])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other = cell + STEP_Y[move] * width + STEP_X[move]
            length = straight if move < 4 else diagonal
            other_g = g + length
            if graded:
                other_g += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[other]) >> 9
            # Unsigned, -1 is more than any distance.
            if other_g < np.uint32(distances[other]):
                distances[other] = other_g
                slot = (other_g >> BUCKET_BITS) & ring
                if free:
                    entry = free
                    free = pool[entry - 1]
                else:
                    top += 1
                    entry = top
                kept = move if canonical else _ANY_MOVE
                pool[entry - 1] = other << 32 | kept << _MOVE_SHIFT | heads[slot]
                heads[slot] = entry
                live += 1
    control[D_BUCKET] = bucket
    control[D_SEED] = seed
    control[D_FREE] = free
    control[D_TOP] = top
    control[D_LIVE] = live
    return status
