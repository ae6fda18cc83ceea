"""The compiled loop of the guided search: it follows waypoints first, then proves its path.

See docs/guided-search.md for the algorithm and the proofs of its bounds, and `_kernels/astar` for
the layout of cells, moves and records. The queue is an array of buckets over a window of keys,
last in first out, with one more bucket for the keys beyond the window; its entries live in a
pool.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from llm_astar_planner.search._kernels.astar import (
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

# The number of targets that a cell's tag can hold: seven bits, above the closed bit and the move.
MAX_TARGETS = 128
TARGET_SHIFT = 4
# The tag bit of a cell that was counted in G_SURE, so that it is counted once.
COUNTED = 1 << 11

# Slots of the control array. G_SURE counts cells that plain A* surely expands, G_PENDING those
# that will count once the bound passes their bucket, G_LEAST a lower bound on A*'s expansions.
(
    G_START, G_GOAL, G_GENERATION, G_STRAIGHT, G_DIAGONAL, G_WIDTH, G_WEIGHT, G_RADIUS,
    G_SUBOPTIMALITY, G_WORK_FACTOR, G_FREE, G_TOP, G_BASE, G_BUCKET, G_LIVE, G_SHIFT,
    G_PROVING, G_BEST, G_BOUND, G_GUIDED, G_PROOF, G_LEAST, G_SURE, G_PENDING, G_STORAGE,
    G_SIZE,
) = range(26)  # fmt: skip
# One more way a call can end: the work limit is reached until plain A* has done more.
WORK_LIMIT = 6
# Weights, suboptimality bounds and work factors are whole numbers, in parts of this one.
ONE = 1 << 16
# The work factor of a search without a work limit.
UNBOUNDED = -1

_jit: Any = njit(cache=True, nogil=True)


@_jit
def octile_distance(control: NDArray[np.int64], x: int, y: int, other_x: int, other_y: int) -> int:
    """Return the octile distance between two cells, in units."""
    delta_x = abs(x - other_x)
    delta_y = abs(y - other_y)
    straight = control[G_STRAIGHT]
    extra = control[G_DIAGONAL] - straight
    return straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)


@_jit
def estimate_to_goal(
    landmark_distances: NDArray[np.int32], active: NDArray[np.int64], cell: int, octile: int
) -> int:
    """Return a lower bound on a cell's cost to the goal: the octile one or a landmark's."""
    best = octile
    for row in range(active.shape[0]):
        best = max(best, abs(np.int64(landmark_distances[active[row, 0], cell]) - active[row, 1]))
    return best


@_jit
def push(
    control: NDArray[np.int64],
    heads: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    cell: int,
    key: int,
) -> None:
    """Put a cell on the queue."""
    bucket = min(max((key - control[G_BASE]) >> control[G_SHIFT], 0), heads.size - 1)
    if bucket < control[G_BUCKET]:
        control[G_BUCKET] = bucket
    entry = control[G_FREE]
    if entry:
        control[G_FREE] = pool[entry - 1]
    else:
        entry = control[G_TOP] + 1
        control[G_TOP] = entry
    pool[entry - 1] = np.int64(cell) << 32 | heads[bucket]
    keys[entry - 1] = key
    heads[bucket] = entry
    control[G_LIVE] += 1


@_jit
def pop(control: NDArray[np.int64], heads: NDArray[np.int32], pool: NDArray[np.int64]) -> int:
    """Remove the first entry of the current bucket; return its cell."""
    bucket = control[G_BUCKET]
    entry = heads[bucket]
    item = pool[entry - 1]
    heads[bucket] = item & 0xFFFFFFFF
    pool[entry - 1] = control[G_FREE]
    control[G_FREE] = entry
    control[G_LIVE] -= 1
    return item >> 32


@_jit
def move_window(
    control: NDArray[np.int64],
    heads: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
) -> None:
    """Move the empty window to the lowest key beyond it; queue the entries that it then covers."""
    last = heads.size - 1
    shift = control[G_SHIFT]
    first = np.int64(heads[last])
    lowest = np.int64(NO_PATH)
    entry = first
    while entry:
        lowest = min(lowest, keys[entry - 1])
        entry = pool[entry - 1] & 0xFFFFFFFF
    heads[last] = 0
    control[G_BASE] = lowest >> shift << shift
    control[G_BUCKET] = 0
    entry = first
    while entry:
        item = pool[entry - 1]
        bucket = min((keys[entry - 1] - control[G_BASE]) >> shift, last)
        pool[entry - 1] = item >> 32 << 32 | heads[bucket]
        heads[bucket] = entry
        entry = item & 0xFFFFFFFF


@_jit
def settle(
    control: NDArray[np.int64],
    heads: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    records: NDArray[np.int32],
) -> int:
    """Advance the queue to its first open entry; return the lowest key of that bucket, or -1.

    Removes the entries of cells already expanded and, while proving, those that cannot improve
    the best path.
    """
    last = heads.size - 1
    limit = control[G_BEST] if control[G_PROVING] else np.int64(NO_PATH)
    while control[G_LIVE] > 0:
        bucket = control[G_BUCKET]
        while bucket < last and heads[bucket] == 0:
            bucket += 1
        control[G_BUCKET] = bucket
        if bucket == last:
            move_window(control, heads, pool, keys)
            continue
        entry = heads[bucket]
        cell = pool[entry - 1] >> 32
        if records[2 * cell + 1] & CLOSED or keys[entry - 1] >= limit:
            pop(control, heads, pool)
            continue
        return control[G_BASE] + (bucket << control[G_SHIFT])
    return -1


@_jit
def advance_target(
    control: NDArray[np.int64], targets: NDArray[np.int64], index: int, x: int, y: int
) -> int:
    """Return the index of the target that a cell heads for, given that of its parent.

    A cell has passed a target if it is within the radius of it, or nearer to the next target
    than the passed one is.
    """
    last = targets.shape[0] - 1
    while index < last:
        if (
            octile_distance(control, x, y, targets[index, 0], targets[index, 1])
            > control[G_RADIUS]
        ):
            ahead = octile_distance(control, x, y, targets[index + 1, 0], targets[index + 1, 1])
            if ahead > targets[index, 2] - targets[index + 1, 2]:
                break
        index += 1
    return index


@_jit
def guide_key(
    control: NDArray[np.int64],
    targets: NDArray[np.int64],
    index: int,
    x: int,
    y: int,
    g: int,
    estimate: int,
) -> int:
    """Return the queue key of a cell that follows the targets: g + weight * cost to go."""
    way = octile_distance(control, x, y, targets[index, 0], targets[index, 1]) + targets[index, 2]
    return g + (max(way, estimate) * control[G_WEIGHT] >> 16)


@_jit
def begin(
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    heads: NDArray[np.int32],
    graded: bool,
    landmark_distances: NDArray[np.int32],
    active: NDArray[np.int64],
    control: NDArray[np.int64],
) -> None:
    """Put the start on the queue; `control` holds the query and is zero elsewhere."""
    start, goal, width = control[G_START], control[G_GOAL], control[G_WIDTH]
    delta_x = abs(start % width - goal % width)
    delta_y = abs(start // width - goal // width)
    estimate = estimate_to_goal(
        landmark_distances, active, start, octile_distance(control, delta_x, delta_y, 0, 0)
    )
    records[2 * start] = 0
    records[2 * start + 1] = control[G_GENERATION] << TAG_BITS
    heads[:] = 0
    control[G_BOUND] = estimate
    control[G_BASE] = estimate
    control[G_STORAGE] = 1
    control[G_BEST] = NO_PATH if start != goal else 0
    # Any path has at least so many moves, and A* expands all of its cells but the goal.
    control[G_LEAST] = max(delta_x, delta_y)
    if not graded:
        control[G_LEAST] = max(control[G_LEAST], estimate // control[G_DIAGONAL])
    push(control, heads, pool, keys, start, estimate)


@_jit
def rekey(
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    heads: NDArray[np.int32],
    targets: NDArray[np.int64],
    landmark_distances: NDArray[np.int32],
    active: NDArray[np.int64],
    proving: bool,
    shift: int,
    control: NDArray[np.int64],
) -> None:
    """Rebuild the queue from the open cells: for the proof, or for new targets."""
    width = control[G_WIDTH]
    goal_x, goal_y = control[G_GOAL] % width, control[G_GOAL] // width
    cells = np.empty(control[G_LIVE], dtype=np.int64)
    count = 0
    for head in heads:
        entry = np.int64(head)
        while entry:
            cell = pool[entry - 1] >> 32
            if records[2 * cell + 1] & CLOSED == 0:
                cells[count] = cell
                count += 1
            entry = pool[entry - 1] & 0xFFFFFFFF
    heads[:] = 0
    control[G_FREE] = 0
    control[G_TOP] = 0
    control[G_LIVE] = 0
    control[G_BUCKET] = 0
    control[G_PROVING] = proving
    control[G_SHIFT] = shift
    control[G_BASE] = control[G_BOUND] >> shift << shift
    for cell in cells[:count]:
        y = cell // width
        x = cell - y * width
        g = np.int64(records[2 * cell])
        estimate = estimate_to_goal(
            landmark_distances, active, cell, octile_distance(control, x, y, goal_x, goal_y)
        )
        key = g + estimate
        if not proving:
            index = advance_target(control, targets, 0, x, y)
            kept = records[2 * cell + 1] & ~((MAX_TARGETS - 1) << TARGET_SHIFT)
            records[2 * cell + 1] = kept | index << TARGET_SHIFT
            key = guide_key(control, targets, index, x, y, g, estimate)
        push(control, heads, pool, keys, cell, key)


@_jit
def raise_bound(
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    heads: NDArray[np.int32],
    landmark_distances: NDArray[np.int32],
    active: NDArray[np.int64],
    control: NDArray[np.int64],
) -> None:
    """Raise the lower bound to the least f of the open cells, or to the best path's cost."""
    width = control[G_WIDTH]
    goal_x, goal_y = control[G_GOAL] % width, control[G_GOAL] // width
    bound = control[G_BEST]
    for head in heads:
        entry = np.int64(head)
        while entry:
            cell = pool[entry - 1] >> 32
            if records[2 * cell + 1] & CLOSED == 0:
                octile = octile_distance(control, cell % width, cell // width, goal_x, goal_y)
                estimate = estimate_to_goal(landmark_distances, active, cell, octile)
                bound = min(bound, records[2 * cell] + estimate)
            entry = pool[entry - 1] & 0xFFFFFFFF
    control[G_BOUND] = max(control[G_BOUND], bound)


@_jit
def is_met(control: NDArray[np.int64]) -> bool:
    """Tell whether the best path is proven to be within the requested suboptimality bound."""
    best = control[G_BEST]
    return best < NO_PATH and best * ONE <= control[G_BOUND] * control[G_SUBOPTIMALITY]


@_jit
def advance(
    moves: NDArray[np.uint8],
    cell_surcharge: NDArray[np.uint16],
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    keys: NDArray[np.int64],
    heads: NDArray[np.int32],
    targets: NDArray[np.int64],
    landmark_distances: NDArray[np.int32],
    active: NDArray[np.int64],
    control: NDArray[np.int64],
    quota: int,
    stop: NDArray[np.uint8],
) -> int:
    """Expand up to `quota` cells along the targets or, once control[G_PROVING], by g + h.

    `targets` is int64 [n, 3]: x, y and the units from there to the goal along the list, which
    ends with the goal. Returns why it ended. FOUND: the search reached the goal along the
    targets, or the requested suboptimality bound is proven. EXHAUSTED: no open cell can improve
    the best path. WORK_LIMIT: the work limit is reached. RUNNING: the quota is used up. STOPPED,
    NEED_SPACE and OVERFLOW are those of `_kernels/astar`.
    """
    goal = control[G_GOAL]
    width = control[G_WIDTH]
    generation = control[G_GENERATION]
    proving = control[G_PROVING] != 0
    goal_y = goal // width
    goal_x = goal - goal_y * width
    per_width = 1.0 / width
    graded = cell_surcharge.size > 0
    for spent in range(quota):
        if spent & POLL_MASK == POLL_MASK and stop[0] != 0:
            return STOPPED
        if control[G_TOP] + 8 > pool.size:
            return NEED_SPACE
        floor = settle(control, heads, pool, keys, records)
        if floor < 0 or (proving and floor >= control[G_BEST]):
            control[G_BOUND] = max(control[G_BOUND], control[G_BEST])
            return EXHAUSTED
        if proving and floor > control[G_BOUND]:
            control[G_BOUND] = floor
            control[G_SURE] += control[G_PENDING]
            control[G_PENDING] = 0
        if proving and is_met(control):
            return FOUND
        work = max(control[G_SURE], control[G_LEAST]) * control[G_WORK_FACTOR]
        if 0 <= work < (control[G_GUIDED] + control[G_PROOF] + 1) * ONE:
            return WORK_LIMIT
        cell = pop(control, heads, pool)
        if proving:
            control[G_PROOF] += 1
        elif cell == goal:
            return FOUND
        else:
            control[G_GUIDED] += 1
        cell_tag = records[2 * cell + 1]
        g = np.int64(records[2 * cell])
        if g > LIMIT:
            return OVERFLOW
        if proving and cell_tag & COUNTED == 0:
            control[G_PENDING] += 1
            cell_tag |= COUNTED
        records[2 * cell + 1] = cell_tag | CLOSED
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        cell_target = (cell_tag >> TARGET_SHIFT) & (MAX_TARGETS - 1)
        mask = np.int64(moves[cell])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            other = other_y * width + other_x
            length = control[G_STRAIGHT] if move < 4 else control[G_DIAGONAL]
            other_g = g + length
            if graded:
                other_g += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[other]) >> 9
            old_tag = records[2 * other + 1]
            new = old_tag >> TAG_BITS != generation
            if not new and other_g >= records[2 * other]:
                continue
            octile = octile_distance(control, other_x, other_y, goal_x, goal_y)
            estimate = estimate_to_goal(landmark_distances, active, other, octile)
            if other_g + estimate >= control[G_BEST]:
                continue
            counted = 0 if new else old_tag & COUNTED
            if counted == 0 and other_g + estimate < control[G_BOUND]:
                counted = COUNTED
                control[G_SURE] += 1
            index = 0
            key = other_g + estimate
            if not proving:
                index = advance_target(control, targets, cell_target, other_x, other_y)
                key = guide_key(control, targets, index, other_x, other_y, other_g, estimate)
            control[G_STORAGE] += new
            records[2 * other] = other_g
            records[2 * other + 1] = (
                generation << TAG_BITS | counted | index << TARGET_SHIFT | move
            )
            if other == goal:
                control[G_BEST] = other_g
            push(control, heads, pool, keys, other, key)
    return RUNNING
