# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loop of the search that follows waypoints.

Cells, moves, units and records are those of `_kernels/astar`; the tag also holds the index of
the target that the cell heads for. The queue is a window of buckets over the keys, `base` to
`base + (buckets << shift)`; its last bucket holds all entries beyond the window. The key of each
entry is in `keys`. Keys may fall below the current bucket: the search then goes back to theirs.
"""

from __future__ import annotations

import numpy as np

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import Cells, estimate_to_goal, octile, pop, push
from llm_astar_planner.search.arrays import Float64s, Int32s, Int64s
from llm_astar_planner.search.kernel_cache import jit

LOWEST, STEP_X, STEP_Y = shared.LOWEST, shared.STEP_X, shared.STEP_Y
CANONICAL_SUCCESSORS = shared.CANONICAL_SUCCESSORS

# The number of targets that a cell's tag can hold: eight bits, above the closed bit and the move.
MAX_TARGETS = 256
TARGET_SHIFT = 4
# The buckets of the queue's window.
MIN_BUCKETS, MAX_BUCKETS = 2048, 65536

# Slots of the control array: the query, then the state of the queue and the counts.
(
    G_START, G_GOAL, G_GENERATION, G_WEIGHT, G_RADIUS, G_SUCCESSORS, G_LAG,
    G_FREE, G_TOP, G_BASE, G_BUCKET, G_LIVE, G_SHIFT, G_REACHED, G_BEST, G_EXPANSIONS, G_STORAGE,
    G_SIZE,
) = range(18)  # fmt: skip
# Weights are whole numbers, in parts of this one.
ONE = 1 << 16


@jit
def advance_target(
    targets: Int64s, index: int, x: int, y: int, straight: int, extra: int, radius: int
) -> int:
    """Return the index of the target that a cell heads for, given that of its parent.

    A cell has passed a target if it is within the radius of it, or nearer to the next target
    than the passed one is.
    """
    last = targets.shape[0] - 1
    while index < last:
        if octile(straight, extra, x - targets[index, 0], y - targets[index, 1]) > radius:
            following = index + 1
            ahead = octile(straight, extra, x - targets[following, 0], y - targets[following, 1])
            if ahead > targets[following, 3]:
                break
        index += 1
    return index


@jit
def move_window(heads: Int32s, pool: Int64s, keys: Int64s, control: Int64s) -> int:
    """Move the empty window to the lowest key beyond it; queue the entries that it then covers.

    Returns the new base.
    """
    last = heads.size - 1
    shift = control[G_SHIFT]
    first = np.int64(heads[last])
    lowest = np.int64(shared.NO_PATH)
    entry = first
    while entry:
        lowest = min(lowest, keys[entry - 1])
        entry = pool[entry - 1] & 0xFFFFFFFF
    heads[last] = 0
    base = lowest >> shift << shift
    entry = first
    while entry:
        item = pool[entry - 1]
        bucket = min((keys[entry - 1] - base) >> shift, last)
        pool[entry - 1] = item >> 32 << 32 | heads[bucket]
        heads[bucket] = entry
        entry = item & 0xFFFFFFFF
    return base


@jit
def make_targets(cells: Cells, points: Float64s, control: Int64s) -> Int64s:
    """Turn waypoints [n, 2] into targets, which end with the goal: int64 [k, 4].

    These are x, y, the units from there to the goal along the list and those from the target
    before. Points that are not finite are dropped, points off the map moved to its border; of
    equal ones in a row one remains, and of more than MAX_TARGETS as many, evenly.
    """
    moves, _, width, straight, diagonal = cells
    height = moves.size // width
    targets = np.zeros((points.shape[0] + 1, 4), dtype=np.int64)
    x, y = control[G_START] % width, control[G_START] // width
    count = 0
    for number in range(points.shape[0]):
        if not (np.isfinite(points[number, 0]) and np.isfinite(points[number, 1])):
            continue
        other_x = int(np.rint(min(max(points[number, 0], 0.0), width - 1.0)))
        other_y = int(np.rint(min(max(points[number, 1], 0.0), height - 1.0)))
        if other_x != x or other_y != y:
            x, y = other_x, other_y
            targets[count, 0], targets[count, 1] = x, y
            count += 1
    goal_x, goal_y = control[G_GOAL] % width, control[G_GOAL] // width
    if count == 0 or goal_x != x or goal_y != y:
        targets[count, 0], targets[count, 1] = goal_x, goal_y
        count += 1
    if count > MAX_TARGETS:
        for number in range(MAX_TARGETS):
            chosen = (number * (count - 1) + (MAX_TARGETS - 1) // 2) // (MAX_TARGETS - 1)
            targets[number, 0], targets[number, 1] = targets[chosen, 0], targets[chosen, 1]
        count = MAX_TARGETS
    targets[count - 1, 2] = 0
    for number in range(count - 2, -1, -1):
        delta_x = targets[number + 1, 0] - targets[number, 0]
        delta_y = targets[number + 1, 1] - targets[number, 1]
        way = octile(straight, diagonal - straight, delta_x, delta_y)
        targets[number, 2] = targets[number + 1, 2] + way
        targets[number + 1, 3] = way
    return targets[:count].copy()


@jit
def follow(
    cells: Cells,
    targets: Int64s,
    records: Int32s,
    pool: Int64s,
    keys: Int64s,
    before: Int32s,
    landmark_distances: Int32s,
    active: Int64s,
    control: Int64s,
    same: bool,
) -> Int32s:
    """Queue the open cells for new targets, see `advance`, at first the start alone.

    Or for the `same` ones and another weight. `before` holds the heads of the buckets until now.
    Returns the new ones.
    """
    _, _, width, straight, diagonal = cells
    extra = diagonal - straight
    # The window covers about the keys of a path half as long again as the way along the targets,
    # in buckets of half a cell or less: within one the order is lost.
    span = 3 * targets[0, 2] * control[G_WEIGHT] // (2 * ONE) + 64 * straight
    buckets = MIN_BUCKETS
    while buckets < MAX_BUCKETS and buckets * straight < 2 * span:
        buckets *= 2
    shift = shared.BUCKET_BITS
    while buckets << shift < span:
        shift += 1
    heads = np.zeros(buckets + 1, dtype=np.int32)
    goal_x, goal_y = control[G_GOAL] % width, control[G_GOAL] // width
    opened = np.empty(max(control[G_LIVE], 1), dtype=np.int64)
    count = 0
    if control[G_STORAGE] == 0:
        start = control[G_START]
        records[2 * start] = 0
        records[2 * start + 1] = control[G_GENERATION] << shared.TAG_BITS
        control[G_STORAGE] = 1
        control[G_BEST] = shared.NO_PATH
        opened[0] = start
        count = 1
    else:
        for head in before:
            entry = np.int64(head)
            while entry:
                cell = pool[entry - 1] >> 32
                if records[2 * cell + 1] & shared.CLOSED == 0:
                    opened[count] = cell
                    count += 1
                entry = pool[entry - 1] & 0xFFFFFFFF
    last = heads.size - 1
    lowest = np.int64(shared.NO_PATH)
    for number in range(count):
        cell = opened[number]
        y = cell // width
        x = cell - y * width
        passed = records[2 * cell + 1] >> TARGET_SHIFT & MAX_TARGETS - 1 if same else 0
        index = advance_target(targets, passed, x, y, straight, extra, control[G_RADIUS])
        kept = records[2 * cell + 1] & ~((MAX_TARGETS - 1) << TARGET_SHIFT)
        records[2 * cell + 1] = kept | index << TARGET_SHIFT
        distance = octile(straight, extra, x - goal_x, y - goal_y)
        estimate = estimate_to_goal(landmark_distances, active, cell, distance)
        way = octile(straight, extra, x - targets[index, 0], y - targets[index, 1])
        to_go = max(way + targets[index, 2], estimate) * control[G_WEIGHT] >> 16
        keys[number] = records[2 * cell] + to_go
        # Keys fall along a path, as the cost to go weighs more, but not below its cost.
        lowest = min(lowest, records[2 * cell] + estimate)
    base = lowest >> shift << shift
    for number in range(count):
        bucket = min((keys[number] - base) >> shift, last)
        pool[number] = opened[number] << 32 | heads[bucket]
        heads[bucket] = number + 1
    control[G_FREE] = control[G_BUCKET] = control[G_REACHED] = 0
    control[G_TOP] = control[G_LIVE] = count
    control[G_SHIFT], control[G_BASE] = shift, base
    return heads


@jit
def advance(
    cells: Cells,
    records: Int32s,
    pool: Int64s,
    keys: Int64s,
    heads: Int32s,
    targets: Int64s,
    landmark_distances: Int32s,
    active: Int64s,
    control: Int64s,
    quota: int,
) -> int:
    """Expand up to `quota` cells along the targets; return how the call ended.

    `targets` is int64 [n, 4]: x, y, the units from there to the goal along the list, which ends
    with the goal, and those from the target before. Cells that head for one more than
    control[G_LAG] before the farthest one headed for are put off. FOUND: the goal was taken from
    the queue. EXHAUSTED: no open cell leads to a path cheaper than control[G_BEST], which the
    caller may lower between calls. RUNNING: the quota is used up. NEED_SPACE and OVERFLOW are
    those of `_kernels/astar`.
    """
    moves, cell_surcharge, width, straight, diagonal = cells
    graded = cell_surcharge.size > 0
    goal, generation = control[G_GOAL], control[G_GENERATION]
    weight, radius = control[G_WEIGHT], control[G_RADIUS]
    reached, lag = control[G_REACHED], control[G_LAG]
    start, successors = control[G_START], control[G_SUCCESSORS]
    extra = diagonal - straight
    free, top, live = control[G_FREE], control[G_TOP], control[G_LIVE]
    base, bucket, shift = control[G_BASE], control[G_BUCKET], control[G_SHIFT]
    best, storage = control[G_BEST], control[G_STORAGE]
    goal_y = goal // width
    goal_x = goal - goal_y * width
    per_width = 1.0 / width
    last = heads.size - 1
    offsets = STEP_Y * width + STEP_X
    lengths = np.array([straight] * 4 + [diagonal] * 4)
    states = records.view(np.int64)
    tag = np.int64(generation) << 32 + shared.TAG_BITS
    closed = np.int64(shared.CLOSED) << 32
    spent = 0
    status = shared.RUNNING
    while spent < quota:
        while live > 0:
            while bucket < last and heads[np.uint64(bucket)] == 0:
                bucket += 1
            if bucket < last:
                break
            base = move_window(heads, pool, keys, control)
            bucket = reached = 0
        if live == 0:
            status = shared.EXHAUSTED
            break
        if top + 8 > pool.size:
            status = shared.NEED_SPACE
            break
        cell, free = pop(pool, heads, bucket, free)
        live -= 1
        state = states[np.uint64(cell)]
        if state & closed:
            continue
        if cell == goal:
            status = shared.FOUND
            break
        index = state >> 32 + TARGET_SHIFT & MAX_TARGETS - 1
        if index + lag < reached:
            # Put off until nothing else is in the window; its entry, and so its key, stays.
            _, free, top = push(pool, heads, last, cell << 32, free, top)
            live += 1
            continue
        states[np.uint64(cell)] = state | closed
        spent += 1
        g = state & 0xFFFFFFFF
        if g > shared.LIMIT:
            status = shared.OVERFLOW
            break
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        # Its successors head for the first target that the cell has not passed.
        index = advance_target(targets, index, x, y, straight, extra, radius)
        reached = max(reached, index)
        target_x, target_y, rest = targets[index, 0], targets[index, 1], targets[index, 2]
        # Canonical moves alone could not turn where the targets do.
        row = successors + ((state >> 32 & 7) << 8)
        if cell == start or successors == shared.EVERY_MOVE:
            row = np.int64(shared.EVERY_MOVE)
        mask = np.int64(CANONICAL_SUCCESSORS[np.uint64(row | moves[np.uint64(cell)])])
        price = np.int64(cell_surcharge[np.uint64(cell)]) if graded else 0
        while mask:
            move = np.uint64(LOWEST[np.uint64(mask)])
            mask &= mask - 1
            other = np.uint64(cell + offsets[move])
            other_g = g + lengths[move]
            if graded:
                other_g += lengths[move] * (price + np.int64(cell_surcharge[other])) >> 9
            known = states[other]
            new = known >> 32 + shared.TAG_BITS != generation
            if not new and other_g >= known & 0xFFFFFFFF:
                continue
            other_x, other_y = x + STEP_X[move], y + STEP_Y[move]
            distance = octile(straight, extra, other_x - goal_x, other_y - goal_y)
            estimate = estimate_to_goal(landmark_distances, active, other, distance)
            if other_g + estimate >= best:
                continue
            way = octile(straight, extra, other_x - target_x, other_y - target_y) + rest
            key = other_g + (max(way, estimate) * weight >> 16)
            storage += new
            states[other] = tag | (index << TARGET_SHIFT | np.int64(move)) << 32 | other_g
            if np.int64(other) == goal:
                best = other_g
            slot = min(max((key - base) >> shift, 0), last)
            bucket = min(bucket, slot)
            entry, free, top = push(pool, heads, slot, np.int64(other) << 32, free, top)
            keys[np.uint64(entry - 1)] = key
            live += 1
    control[G_FREE], control[G_TOP], control[G_LIVE] = free, top, live
    control[G_BASE], control[G_BUCKET], control[G_REACHED] = base, bucket, reached
    control[G_BEST], control[G_STORAGE] = best, storage
    control[G_EXPANSIONS] += spent
    return status
