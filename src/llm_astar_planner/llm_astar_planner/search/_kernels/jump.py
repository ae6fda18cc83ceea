# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of the jump point search: packed lines, scans by words, the search, its path.

Cells, moves and generations are those of `_kernels/astar`. `words` holds the map as bits, 64
cells a word, once along the rows and once along the columns, with a border of blocked cells:
cell (x, y) is bit x + 1 of row line y + 1 and bit y + 1 of column line x + 1. Each group of 64
cells has three words: where it is blocked, and where a scan with rising or with falling
positions must stop. It stops at blocked cells and at jump points: cells beside which an obstacle
has just ended (Harabor and Grastien, ICAPS 2014; here without corner cutting).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from llm_astar_planner.lazy import LazyModule
from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import Cells, estimate_to_goal, octile
from llm_astar_planner.search.arrays import Bools, Int32s, Int64s
from llm_astar_planner.search.kernel_cache import INTERPRETED, inlined, jit

# The compiler's parts, which only what is compiled takes.
extending, ir, types = map(LazyModule, ('numba.extending', 'llvmlite.ir', 'numba.core.types'))
CANONICAL_SUCCESSORS, LOWEST = shared.CANONICAL_SUCCESSORS, shared.LOWEST
STEP_X, STEP_Y = shared.STEP_X, shared.STEP_Y

# Words of 64 cells: blocked, stops of rising scans, stops of falling scans.
PLANES = 3
# A bucket of the queue is 1 << BUCKET_BITS units of f wide; the last one holds what is beyond.
BUCKET_BITS = 8
BUCKETS = 2048
# int64 numbers of a queue entry: cell << 32 | next entry, g << 32 | entry it came from, and
# f << 3 | move that led to the cell. Entries are numbered from 1.
ENTRY = 3
# A diagonal run is put off to a new entry after so many cells ...
LONGEST_RUN = 128
# ... and so many units after the estimate of its cost has begun to rise.
RISE = 8 * 2378

# Slots of the control array. Bucket J_BUCKET, counted from the cost J_ORIGIN, is the lowest that
# holds entries. J_BEST may hold the cost of a path that is known already.
(
    J_STARTED, J_ORIGIN, J_BUCKET, J_BEST, J_EXPANSIONS, J_STORAGE, J_GOAL, J_SCANS, J_TOP, J_SIZE,
) = range(10)  # fmt: skip


def bit_operation(generate: Callable[[Any, Any, Any], Any]) -> Any:
    """Return a function of an int64 that a few instructions of the processor compute.

    `generate` gets what makes them, the word, and what tells the processor that it is not 0.
    """

    def operation(_context: Any, _word: Any) -> Any:
        sure = ir.Constant(ir.IntType(1), 1)
        return types.int64(types.int64), lambda _, ops, __, words: generate(ops, words[0], sure)

    return operation if INTERPRETED else extending.intrinsic(operation)


# The numbers of the lowest and of the highest set bit of a word, not 0; how many bits are set.
lowest_bit = bit_operation(lambda builder, word, sure: builder.cttz(word, sure))
highest_bit = bit_operation(
    lambda builder, word, sure: builder.sub(word.type(63), builder.ctlz(word, sure))
)
count_bits = bit_operation(lambda builder, word, _: builder.ctpop(word))


@jit
def pack_lines(
    blocked: Bools, words: Int64s, base: int, lines: tuple[int, int], span: tuple[int, int]
) -> None:
    """Write where cells are blocked into the words `span` of the lines `lines`, both (first, end).

    `blocked` is [lines, cells along a line] and `base` the place of line 0.
    """
    width = blocked.shape[1]
    line_words = (width + 65) // 64
    for word in range(span[0], span[1]):
        first = 64 * word - 1
        begin, end = max(first, 0), min(first + 64, width)
        for line in range(lines[0], lines[1]):
            row = blocked[line - 1, begin:end]
            free = np.uint64(0)
            for cell in range(row.size):
                free |= np.uint64(not row[cell]) << np.uint64(begin - first + cell)
            words[base + PLANES * (line * line_words + word)] = np.int64(~free)


@jit
def mark_stops(
    words: Int64s, base: int, line_words: int, lines: tuple[int, int], span: tuple[int, int]
) -> None:
    """Write where scans stop in the words `span` of the lines `lines`; see `pack_lines`."""
    one = np.uint64(1)
    two = np.uint64(2)
    top = np.uint64(63)
    group = np.uint64(PLANES)
    stride = group * np.uint64(line_words)
    for line in range(lines[0], lines[1]):
        # Unsigned places: numba would test signed ones for a count from the end.
        here = np.uint64(base + PLANES * span[0]) + np.uint64(line) * stride
        for _ in range(span[0], span[1]):
            own = np.uint64(words[here])
            # Lines begin and end with blocked cells, so the words before and after need no care.
            rising = np.uint64(0)
            falling = np.uint64(0)
            for side in (here - stride, here + stride):
                wall = np.uint64(words[side])
                rising |= (wall << one | np.uint64(words[side - group]) >> top) & ~wall
                falling |= (wall >> one | np.uint64(words[side + group]) << top) & ~wall
            rising &= ~(own | own << one | np.uint64(words[here - group]) >> top)
            falling &= ~(own | own >> one | np.uint64(words[here + group]) << top)
            words[here + one] = np.int64(own | rising)
            words[here + two] = np.int64(own | falling)
            here += group


@jit
def count_window(
    words: Int64s, base: int, line_words: int, lines: tuple[int, int], span: tuple[int, int]
) -> tuple[int, int]:
    """Return the numbers of blocked cells and of jump points in words of lines.

    A jump point counts for each direction in which a scan stops at it.
    """
    blocked = jump_points = 0
    for line in range(lines[0], lines[1]):
        place = base + PLANES * (line * line_words + span[0])
        for _ in range(span[0], span[1]):
            wall = words[place]
            blocked += count_bits(wall)
            jump_points += count_bits(words[place + 1] & ~wall)
            jump_points += count_bits(words[place + 2] & ~wall)
            place += PLANES
    return blocked, jump_points


@jit
def pack_window(
    blocked: Bools, words: Int64s, base: int, window: tuple[int, int, int, int]
) -> tuple[int, int]:
    """Write a window of the map into the lines that begin at `base`, and where scans stop.

    `blocked` is [lines, cells along a line]. The window is half open: lines first to end, cells
    first to end. Returns by how much the numbers of blocked cells and of jump points rose.
    """
    top, bottom, left, right = window
    height, width = blocked.shape
    line_words = (width + 65) // 64
    # Stops depend on the cells around.
    near = (max(top, 1), min(bottom + 1, height) + 1)
    span = (left >> 6, min((right + 1 >> 6) + 1, line_words))
    before, jump_points = count_window(words, base, line_words, near, span)
    pack_lines(blocked, words, base, (top + 1, bottom + 1), (left + 1 >> 6, (right >> 6) + 1))
    mark_stops(words, base, line_words, near, span)
    now, now_jump_points = count_window(words, base, line_words, near, span)
    return now - before, now_jump_points - jump_points


@jit
def scan(words: Int64s, line: int, position: int, rising: bool) -> int:
    """Return where a scan from `position` along a line first stops, << 1 | whether blocked.

    `line` is the place of the line's first word.
    """
    # Places are unsigned: numba would test signed ones for a count from the end.
    group: Any
    here: Any
    if rising:
        group = np.uint64(position + 1) >> np.uint64(6)
        here = np.uint64(line + 1) + np.uint64(PLANES) * group
        stops = words[here] & (np.int64(-1) << ((position + 1) & 63))
        while stops == 0:
            here += np.uint64(PLANES)
            group += np.uint64(1)
            stops = words[here]
        bit = lowest_bit(stops)
        wall = words[here - np.uint64(1)]
    else:
        group = np.uint64(position) >> np.uint64(6)
        here = np.uint64(line + 2) + np.uint64(PLANES) * group
        stops = words[here] & ((np.int64(1) << (position & 63)) - 1)
        while stops == 0:
            here -= np.uint64(PLANES)
            group -= np.uint64(1)
            stops = words[here]
        bit = highest_bit(stops)
        wall = words[here - np.uint64(2)]
    return (np.int64(group) << 6 | bit) << 1 | (wall >> bit & 1)


@inlined
def scan_ahead(
    words: Int64s, line: int, position: int, step: int, to_goal: int
) -> tuple[int, int]:
    """Return how far a scan goes, at most to the goal, and 1 unless it ends at a blocked cell.

    `to_goal` is how many cells ahead the goal is, 0 or less where it is not.
    """
    place = scan(words, line, position, step > 0)
    length = abs((place >> 1) - position)
    is_goal = 0 < to_goal <= length
    return (to_goal if is_goal else length), (1 if is_goal else 1 - (place & 1))


@inlined
def add_candidate(pool: Int64s, entry: int, cell: int, g: int, move: int) -> None:
    """Write what a scan found behind the last entry."""
    pool[ENTRY * entry] = cell << 32
    pool[ENTRY * entry + 1] = g
    pool[ENTRY * entry + 2] = move


@jit
def jump_search(
    cells: Cells,
    words: Int64s,
    start: int,
    goal: int,
    landmark_distances: Int32s,
    active: Int64s,
    generation: int,
    records: Int32s,
    pool: Int64s,
    heads: Int32s,
    control: Int64s,
    quota: int,
) -> int:
    """Run or resume an exact jump point search; return how the call ended.

    A record is the g of a cell and its generation, with CLOSED once it is expanded: as in `astar`,
    so that its `add_expanded` reads it. After NEED_SPACE call again with a longer pool that begins
    the same. RUNNING: at least `quota` scans were made. Before the first call `control` is 0 but
    for J_BEST: only cheaper paths are looked for. EXHAUSTED: there is none. The least bucket is a
    lower bound.
    """
    moves, _, width, straight, diagonal = cells
    height = moves.size // width
    row_stride = PLANES * ((width + 65) // 64)
    column_stride = PLANES * ((height + 65) // 64)
    columns = PLANES + (height + 2) * row_stride
    goal_y = goal // width
    goal_x = goal - goal_y * width
    extra = diagonal - straight
    tag = generation << shared.TAG_BITS
    per_width = 1.0 / width
    # The most entries that one expansion can make.
    most = 8 * min(LONGEST_RUN, width, height) + 8
    far = heads.size - 1
    if control[J_STARTED] == 0:
        control[J_STARTED] = 1
        distance = octile(straight, extra, start % width - goal_x, start // width - goal_y)
        f: Any = estimate_to_goal(landmark_distances, active, start, distance)
        heads[:] = 0
        heads[0] = 1
        # Buckets begin at the estimate: where that is exact, the first path ends the search.
        control[J_ORIGIN] = f
        pool[0], pool[1], pool[2] = np.int64(start) << 32, 0, f << 3
        records[2 * start] = 0
        records[2 * start + 1] = tag
        control[J_TOP] = control[J_STORAGE] = 1
        if start == goal:
            control[J_BEST], control[J_GOAL] = 0, 1
    best, found, origin = control[J_BEST], control[J_GOAL], control[J_ORIGIN]
    expansions, storage = control[J_EXPANSIONS], control[J_STORAGE]
    top, bucket = control[J_TOP], control[J_BUCKET]
    scans = 0
    entry: Any
    status = shared.RUNNING
    while True:
        while bucket < far and heads[bucket] == 0:
            bucket += 1
        if bucket == far and heads[far]:
            # Move the window of buckets to the least f beyond it.
            entry = np.int64(heads[far])
            least = np.int64(shared.NO_PATH)
            while entry:
                least = min(least, pool[ENTRY * entry - 1] >> 3)
                entry = pool[ENTRY * entry - 3] & 0xFFFFFFFF
            entry = np.int64(heads[far])
            heads[far] = 0
            origin = least
            bucket = 0
            while entry:
                item = pool[ENTRY * entry - 3]
                slot = min((pool[ENTRY * entry - 1] >> 3) - origin >> BUCKET_BITS, far)
                pool[ENTRY * entry - 3] = item >> 32 << 32 | heads[slot]
                heads[slot] = entry
                entry = item & 0xFFFFFFFF
        if bucket == far or origin + (bucket << BUCKET_BITS) >= best:
            status = shared.FOUND if found else shared.EXHAUSTED
            break
        if scans >= quota:
            break
        if ENTRY * (top + most) > pool.size:
            status = shared.NEED_SPACE
            break
        entry = np.int64(heads[bucket])
        item = pool[ENTRY * entry - 3]
        heads[bucket] = item & 0xFFFFFFFF
        cell = item >> 32
        g = pool[ENTRY * entry - 2] >> 32
        if records[2 * cell] != g:
            continue
        records[2 * cell + 1] = tag | shared.CLOSED
        expansions += 1
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        rise = g + octile(straight, extra, x - goal_x, y - goal_y) + RISE
        row = shared.EVERY_MOVE if cell == start else (pool[ENTRY * entry - 1] & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | moves[cell]])
        # What the scans find is written behind the last entry: cell, g and move.
        last = top
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            step_x = STEP_X[move]
            step_y = STEP_Y[move]
            bit = 1 << move
            turn_x, turn_y = 1 - step_x, 2 - step_y
            at, at_x, at_y, at_g = cell, x, y, g
            run = 0
            while True:
                if move >= 4:
                    if moves[at] & bit == 0:
                        break
                    run += 1
                    at_x += step_x
                    at_y += step_y
                    at += step_y * width + step_x
                    at_g += diagonal
                    f = at_g + octile(straight, extra, at_x - goal_x, at_y - goal_y)
                    if f >= best:
                        break
                    if at == goal or run == LONGEST_RUN or f > rise:
                        add_candidate(pool, last, at, at_g, move)
                        last += 1
                        break
                if step_x:
                    scans += 1
                    ahead = (goal_x - at_x) * step_x if at_y == goal_y else 0
                    line = PLANES + (at_y + 1) * row_stride
                    length, is_stop = scan_ahead(words, line, at_x + 1, step_x, ahead)
                    other = at + length * step_x
                    add_candidate(pool, last, other, at_g + length * straight, turn_x)
                    last += is_stop
                if step_y:
                    scans += 1
                    ahead = (goal_y - at_y) * step_y if at_x == goal_x else 0
                    line = columns + (at_x + 1) * column_stride
                    length, is_stop = scan_ahead(words, line, at_y + 1, step_y, ahead)
                    other = at + length * step_y * width
                    add_candidate(pool, last, other, at_g + length * straight, turn_y)
                    last += is_stop
                if move < 4:
                    break
        # Keep what is new or cheaper than known.
        for candidate in range(top, last):
            other = pool[ENTRY * candidate] >> 32
            other_g = pool[ENTRY * candidate + 1]
            new = records[2 * other + 1] >> shared.TAG_BITS != generation
            if not new and other_g >= records[2 * other]:
                continue
            other_y = np.int64((other + 0.5) * per_width)
            other_x = other - other_y * width
            distance = octile(straight, extra, other_x - goal_x, other_y - goal_y)
            f = other_g + estimate_to_goal(landmark_distances, active, other, distance)
            if f >= best:
                continue
            if other_g > shared.LIMIT:
                status = shared.OVERFLOW
                break
            move = pool[ENTRY * candidate + 2]
            storage += new
            top += 1
            records[2 * other] = other_g
            records[2 * other + 1] = tag
            slot = far
            if other == goal:
                best, found = other_g, top
            else:
                slot = min(max(f - origin >> BUCKET_BITS, bucket), far)
            pool[ENTRY * top - 2] = other_g << 32 | entry
            pool[ENTRY * top - 1] = f << 3 | move
            pool[ENTRY * top - 3] = other << 32 | heads[slot]
            if other != goal:
                heads[slot] = top
        if status == shared.OVERFLOW:
            break
    control[J_BEST], control[J_GOAL], control[J_ORIGIN] = best, found, origin
    control[J_EXPANSIONS], control[J_STORAGE] = expansions, storage
    control[J_TOP], control[J_BUCKET] = top, bucket
    control[J_SCANS] += scans
    return status


@jit
def trace(width: int, found: int, pool: Int64s, path: Int32s) -> tuple[int, int]:
    """Write the cells (x, y) of the path to the entry `found` at the end of `path`.

    Returns their count and that of the diagonal moves. If `path` is too short it holds the last
    cells, and the count is the length needed. A jump is diagonal moves, then straight ones.
    """
    row = path.shape[0]
    entry = found
    diagonals = 0
    cell = pool[ENTRY * entry - 3] >> 32
    y = cell // width
    x = cell - y * width
    row -= 1
    if row >= 0:
        path[row, 0], path[row, 1] = x, y
    while True:
        entry = pool[ENTRY * entry - 2] & 0xFFFFFFFF
        if entry == 0:
            return path.shape[0] - row, diagonals
        cell = pool[ENTRY * entry - 3] >> 32
        from_y = cell // width
        from_x = cell - from_y * width
        while x != from_x or y != from_y:
            delta_x = from_x - x
            delta_y = from_y - y
            if abs(delta_x) >= abs(delta_y):
                x += 1 if delta_x > 0 else -1
            if abs(delta_y) >= abs(delta_x):
                y += 1 if delta_y > 0 else -1
            diagonals += abs(delta_x) == abs(delta_y)
            row -= 1
            if row >= 0:
                path[row, 0], path[row, 1] = x, y
