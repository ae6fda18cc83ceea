"""The compiled loop of the guided search: a waypoint queue and an A* queue over one set of g.

See docs/guided-search.md for what it does and why its bounds hold, and `kernels_bucket` for how
cells, moves and records are laid out. A queue is an array of buckets over a window of keys, with
one more bucket for the keys beyond it; its entries live in a pool both queues share.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from llm_astar_planner.search.kernels_bucket import (
    BUCKET_BITS,
    CLOSED,
    EXHAUSTED,
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
    TAG_BITS,
)

# Targets a cell's tag can count: eight bits, kept above the closed bit and the move.
MAX_TARGETS = 256
TARGET_SHIFT = 4

# Slots of the control array. Those of a queue follow each other: base, bucket, live entries.
(
    G_START,
    G_GOAL,
    G_GENERATION,
    G_STRAIGHT,
    G_DIAGONAL,
    G_WIDTH,
    G_FREE,
    G_TOP,
    G_GUIDE_BASE,
    G_GUIDE_BUCKET,
    G_GUIDE_LIVE,
    G_PROOF_BASE,
    G_PROOF_BUCKET,
    G_PROOF_LIVE,
    G_GUIDING,
    G_PROVING,
    G_TARGETS,
    G_WEIGHT,
    G_BEST,
    G_REPORTED,
    G_BOUND,
    G_GUIDED,
    G_PROOF,
    G_SURE,
    G_STORAGE,
    G_RATIO,
    G_SLACK,
    G_SURELY,
    G_SIZE,
) = range(29)
# Weights, ratios and slacks are whole numbers of this size.
ONE = 1 << 16

_jit: Any = njit(cache=True, nogil=True)


@_jit
def _octile(control: NDArray[np.int64], x: int, y: int, other_x: int, other_y: int) -> int:
    delta_x = abs(x - other_x)
    delta_y = abs(y - other_y)
    straight = control[G_STRAIGHT]
    return straight * max(delta_x, delta_y) + (control[G_DIAGONAL] - straight) * min(
        delta_x, delta_y
    )


@_jit
def _estimate(
    control: NDArray[np.int64],
    marks: NDArray[np.int32],
    active: NDArray[np.int64],
    cell: int,
    octile: int,
) -> int:
    """Raise the octile estimate of a cell's way to the goal to what the landmarks prove."""
    best = octile
    for row in range(active.shape[0]):
        distance = marks[cell, active[row, 0]]
        best = max(best, abs(np.int64(distance) - active[row, 1]))
    return best


@_jit
def _push(
    control: NDArray[np.int64],
    queue: int,
    heads: NDArray[np.int32],
    shift: int,
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    cell: int,
    key: int,
) -> None:
    last = heads.size - 1
    bucket = min(max((key - control[queue]) >> shift, 0), last)
    if bucket < control[queue + 1]:
        control[queue + 1] = bucket
    entry = control[G_FREE]
    if entry:
        control[G_FREE] = pool[entry - 1]
    else:
        entry = control[G_TOP] + 1
        control[G_TOP] = entry
    pool[entry - 1] = np.int64(cell) << 32 | heads[bucket]
    keys[entry - 1] = key
    heads[bucket] = entry
    control[queue + 2] += 1


@_jit
def _settle(
    control: NDArray[np.int64],
    queue: int,
    heads: NDArray[np.int32],
    shift: int,
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    records: NDArray[np.int32],
) -> int:
    """Bring the queue to its first open entry and return that bucket's key, or -1 if empty.

    Drops stale entries on the way. Where the window is empty, moves it to the keys beyond.
    """
    last = heads.size - 1
    while control[queue + 2] > 0:
        bucket = control[queue + 1]
        while bucket < last and heads[bucket] == 0:
            bucket += 1
        control[queue + 1] = bucket
        if bucket == last:
            entry = heads[last]
            lowest = np.int64(NO_PATH)
            while entry:
                lowest = min(lowest, keys[entry - 1])
                entry = pool[entry - 1] & 0xFFFFFFFF
            entry = heads[last]
            heads[last] = 0
            control[queue] = lowest >> shift << shift
            control[queue + 1] = 0
            while entry:
                item = pool[entry - 1]
                bucket = min((keys[entry - 1] - control[queue]) >> shift, last)
                pool[entry - 1] = item >> 32 << 32 | heads[bucket]
                heads[bucket] = entry
                entry = item & 0xFFFFFFFF
            continue
        entry = heads[bucket]
        if records[2 * (pool[entry - 1] >> 32) + 1] & CLOSED:
            _drop(control, queue, heads, pool)
            continue
        return control[queue] + (bucket << shift)
    return -1


@_jit
def _drop(
    control: NDArray[np.int64], queue: int, heads: NDArray[np.int32], pool: NDArray[np.int64]
) -> int:
    """Take the first entry of the current bucket off; return its cell."""
    bucket = control[queue + 1]
    entry = heads[bucket]
    item = pool[entry - 1]
    heads[bucket] = item & 0xFFFFFFFF
    pool[entry - 1] = control[G_FREE]
    control[G_FREE] = entry
    control[queue + 2] -= 1
    return item >> 32


@_jit
def _target(
    control: NDArray[np.int64],
    targets: NDArray[np.int64],
    index: int,
    x: int,
    y: int,
) -> int:
    """Return the target a cell is drawn to, given the one its parent was drawn to."""
    last = control[G_TARGETS] - 1
    while index < last:
        near = _octile(control, x, y, targets[index, 0], targets[index, 1])
        if near > targets[index, 3]:
            ahead = _octile(control, x, y, targets[index + 1, 0], targets[index + 1, 1])
            leg = targets[index, 2] - targets[index + 1, 2]
            if not (near <= targets[index, 4] and ahead <= leg):
                break
        index += 1
    return index


@_jit
def _guide_key(
    control: NDArray[np.int64],
    targets: NDArray[np.int64],
    index: int,
    x: int,
    y: int,
    g: int,
    estimate: int,
) -> int:
    way = _octile(control, x, y, targets[index, 0], targets[index, 1]) + targets[index, 2]
    return g + (max(way, estimate) * control[G_WEIGHT] >> 16)


@_jit
def _copy_open(
    control: NDArray[np.int64],
    source: NDArray[np.int32],
    target_queue: int,
    target: NDArray[np.int32],
    shift: int,
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    records: NDArray[np.int32],
    targets: NDArray[np.int64],
    marks: NDArray[np.int32],
    active: NDArray[np.int64],
) -> None:
    """Push every open cell that `source` holds on the other queue, with that queue's key."""
    width = control[G_WIDTH]
    goal_x, goal_y = control[G_GOAL] % width, control[G_GOAL] // width
    for head in source:
        entry = np.int64(head)
        while entry:
            cell = pool[entry - 1] >> 32
            entry = pool[entry - 1] & 0xFFFFFFFF
            cell_tag = records[2 * cell + 1]
            if cell_tag & CLOSED:
                continue
            y = cell // width
            x = cell - y * width
            g = np.int64(records[2 * cell])
            estimate = _estimate(
                control, marks, active, cell, _octile(control, x, y, goal_x, goal_y)
            )
            key = g + estimate
            if target_queue == G_GUIDE_BASE:
                index = _target(control, targets, 0, x, y)
                low = cell_tag & (CLOSED | 7)
                records[2 * cell + 1] = (
                    control[G_GENERATION] << TAG_BITS | index << TARGET_SHIFT | low
                )
                key = _guide_key(control, targets, index, x, y, g, estimate)
            _push(control, target_queue, target, shift, pool, keys, cell, key)


@_jit
def begin(
    graded: bool,
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    proof_heads: NDArray[np.int32],
    marks: NDArray[np.int32],
    active: NDArray[np.int64],
    control: NDArray[np.int64],
) -> None:
    """Start a search that only proves, without waypoints; `control` holds the query already."""
    start, goal, width = control[G_START], control[G_GOAL], control[G_WIDTH]
    delta_x = abs(start % width - goal % width)
    delta_y = abs(start // width - goal // width)
    octile = _octile(control, delta_x, delta_y, 0, 0)
    estimate = _estimate(control, marks, active, start, octile)
    records[2 * start] = 0
    records[2 * start + 1] = control[G_GENERATION] << TAG_BITS
    proof_heads[:] = 0
    control[G_BOUND] = estimate
    control[G_PROOF_BASE] = estimate >> BUCKET_BITS << BUCKET_BITS
    control[G_STORAGE] = 1
    control[G_BEST] = NO_PATH if start != goal else 0
    control[G_REPORTED] = NO_PATH
    control[G_PROVING] = 1
    # Any path has at least so many moves, and A* expands all of its cells but the goal.
    control[G_SURELY] = max(delta_x, delta_y)
    if not graded:
        control[G_SURELY] = max(control[G_SURELY], estimate // control[G_DIAGONAL])
    _push(control, G_PROOF_BASE, proof_heads, BUCKET_BITS, pool, keys, start, estimate)


@_jit
def retarget(
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    guide_heads: NDArray[np.int32],
    proof_heads: NDArray[np.int32],
    guide_shift: int,
    targets: NDArray[np.int64],
    marks: NDArray[np.int32],
    active: NDArray[np.int64],
    control: NDArray[np.int64],
) -> int:
    """Draw the search to `targets` from here on: FOUND, or NEED_SPACE and nothing was done."""
    if control[G_TOP] + 2 * (control[G_GUIDE_LIVE] + control[G_PROOF_LIVE]) + 16 > pool.size:
        return NEED_SPACE
    if control[G_PROVING] == 0:
        _begin_proof(
            control, guide_heads, proof_heads, pool, keys, records, targets, marks, active
        )
    for bucket in range(guide_heads.size):
        entry = np.int64(guide_heads[bucket])
        while entry:
            following = pool[entry - 1] & 0xFFFFFFFF
            pool[entry - 1] = control[G_FREE]
            control[G_FREE] = entry
            entry = following
        guide_heads[bucket] = 0
    control[G_GUIDE_LIVE] = 0
    control[G_GUIDE_BUCKET] = 0
    control[G_GUIDE_BASE] = control[G_BOUND] >> guide_shift << guide_shift
    control[G_TARGETS] = targets.shape[0]
    control[G_GUIDING] = 1
    _copy_open(
        control,
        proof_heads,
        G_GUIDE_BASE,
        guide_heads,
        guide_shift,
        pool,
        keys,
        records,
        targets,
        marks,
        active,
    )
    if control[G_PROOF] + control[G_GUIDED] == 0:
        # Nothing is expanded yet: the proof can wait until the waypoints' work is used up.
        control[G_PROVING] = 0
        control[G_PROOF_LIVE] = 0
        proof_heads[:] = 0
    return FOUND


@_jit
def _begin_proof(
    control: NDArray[np.int64],
    guide_heads: NDArray[np.int32],
    proof_heads: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    records: NDArray[np.int32],
    targets: NDArray[np.int64],
    marks: NDArray[np.int32],
    active: NDArray[np.int64],
) -> None:
    proof_heads[:] = 0
    control[G_PROVING] = 1
    control[G_PROOF_LIVE] = 0
    control[G_PROOF_BUCKET] = 0
    control[G_PROOF_BASE] = control[G_BOUND] >> BUCKET_BITS << BUCKET_BITS
    _copy_open(
        control,
        guide_heads,
        G_PROOF_BASE,
        proof_heads,
        BUCKET_BITS,
        pool,
        keys,
        records,
        targets,
        marks,
        active,
    )


@_jit
def advance(
    moves: NDArray[np.uint8],
    price: NDArray[np.uint16],
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    guide_heads: NDArray[np.int32],
    proof_heads: NDArray[np.int32],
    guide_shift: int,
    targets: NDArray[np.int64],
    marks: NDArray[np.int32],
    active: NDArray[np.int64],
    control: NDArray[np.int64],
    quota: int,
    stop: NDArray[np.uint8],
) -> int:
    """Search on for `quota` expansions or until there is something to tell; return what.

    FOUND: a new best path (control[G_BEST]) from the waypoints, or any path whose ratio is met;
    EXHAUSTED: everything that could beat the best path was expanded; RUNNING: the quota is used.
    """
    start = control[G_START]
    goal = control[G_GOAL]
    width = control[G_WIDTH]
    generation = control[G_GENERATION]
    tag = generation << TAG_BITS
    goal_y = goal // width
    goal_x = goal - goal_y * width
    per_width = 1.0 / width
    graded = price.size > 0
    spent = 0
    while True:
        if spent & POLL_MASK == POLL_MASK and stop[0] != 0:
            return STOPPED
        if spent >= quota:
            return RUNNING
        if control[G_TOP] + 16 > pool.size:
            return NEED_SPACE
        if control[G_PROVING] == 0 and not _may_guide(control):
            if control[G_TOP] + control[G_GUIDE_LIVE] + 16 > pool.size:
                return NEED_SPACE
            _begin_proof(
                control, guide_heads, proof_heads, pool, keys, records, targets, marks, active
            )
            continue
        if control[G_PROVING]:
            floor = _settle(control, G_PROOF_BASE, proof_heads, BUCKET_BITS, pool, keys, records)
            if floor < 0 or floor >= control[G_BEST]:
                control[G_BOUND] = control[G_BEST]
                return EXHAUSTED
            control[G_BOUND] = max(control[G_BOUND], floor)
            met = control[G_BEST] * ONE <= control[G_BOUND] * control[G_RATIO]
            if control[G_RATIO] and control[G_BEST] < NO_PATH and met:
                return FOUND
        guided = _may_guide(control)
        if guided:
            if _settle(control, G_GUIDE_BASE, guide_heads, guide_shift, pool, keys, records) < 0:
                control[G_GUIDING] = 0
                if control[G_PROVING] == 0:
                    control[G_BOUND] = control[G_BEST]
                    return EXHAUSTED
                continue
            cell = _drop(control, G_GUIDE_BASE, guide_heads, pool)
            if cell == goal:
                control[G_REPORTED] = control[G_BEST]
                return FOUND
            control[G_GUIDED] += 1
        else:
            cell = _drop(control, G_PROOF_BASE, proof_heads, pool)
            control[G_PROOF] += 1
        spent += 1
        cell_tag = records[2 * cell + 1]
        records[2 * cell + 1] = cell_tag | CLOSED
        g = np.int64(records[2 * cell])
        if g > LIMIT:
            return OVERFLOW
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        mask = np.int64(moves[cell])
        cell_target = (cell_tag >> TARGET_SHIFT) & 255
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            other = other_y * width + other_x
            length = control[G_STRAIGHT] if move < 4 else control[G_DIAGONAL]
            other_g = g + length
            if graded:
                other_g += length * (np.int64(price[cell]) + price[other]) >> 9
            new = records[2 * other + 1] >> TAG_BITS != generation
            if not new and other_g >= records[2 * other]:
                continue
            octile = _octile(control, other_x, other_y, goal_x, goal_y)
            estimate = _estimate(control, marks, active, other, octile)
            if other_g + estimate >= control[G_BEST]:
                continue
            index = _target(control, targets, cell_target, other_x, other_y)
            control[G_STORAGE] += new
            control[G_SURE] += new and other_g + octile < control[G_BOUND]
            records[2 * other] = other_g
            records[2 * other + 1] = tag | index << TARGET_SHIFT | move
            if other == goal:
                control[G_BEST] = other_g
            if control[G_GUIDING]:
                key = _guide_key(control, targets, index, other_x, other_y, other_g, estimate)
                _push(control, G_GUIDE_BASE, guide_heads, guide_shift, pool, keys, other, key)
            if control[G_PROVING]:
                _push(
                    control,
                    G_PROOF_BASE,
                    proof_heads,
                    BUCKET_BITS,
                    pool,
                    keys,
                    other,
                    other_g + estimate,
                )


@_jit
def _may_guide(control: NDArray[np.int64]) -> bool:
    """Tell whether the waypoint queue may expand: it looks for a path and has work left."""
    work = max(control[G_PROOF], control[G_SURE], control[G_SURELY])
    return (
        control[G_GUIDING] != 0
        and control[G_REPORTED] == NO_PATH
        and control[G_GUIDED] * ONE < work * control[G_SLACK]
    )
