"""Compiled loops of the jump point search: packed lines, scans by words, the search, its path.

Cells, moves and generations are those of `_kernels/astar`. `words` holds the map as bits, 64
cells a word, once along the rows and once along the columns, with a border of blocked cells:
cell (x, y) is bit x + 1 of row line y + 1 and bit y + 1 of column line x + 1. Each group of 64
cells has three words: where it is blocked, and where a scan with rising or with falling
positions must stop. It stops at blocked cells and at jump points: cells beside which an obstacle
has just ended (Harabor and Grastien, ICAPS 2014; here without corner cutting).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from llm_astar_planner.search._kernels.astar import (
    CANONICAL_SUCCESSORS,
    CLOSED,
    EVERY_MOVE,
    EXHAUSTED,
    FOUND,
    LIMIT,
    LOWEST,
    NEED_SPACE,
    NO_PATH,
    OVERFLOW,
    RUNNING,
    STEP_X,
    STEP_Y,
    TAG_BITS,
)

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
    J_STARTED, J_BEST, J_EXPANSIONS, J_STORAGE, J_TOP, J_ORIGIN, J_BUCKET, J_GOAL, J_SCANS, J_SIZE,
) = range(10)  # fmt: skip

_jit: Any = njit(cache=True, nogil=True)
_intrinsic: Any = intrinsic


@_intrinsic
def lowest_bit(_context: Any, _word: Any) -> Any:
    """Return the number of the lowest set bit of an int64 that is not 0: one instruction."""

    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate


@_intrinsic
def highest_bit(_context: Any, _word: Any) -> Any:
    """Return the number of the highest set bit of an int64 that is not 0: one instruction."""

    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        zeros = builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 1))
        return builder.sub(ir.Constant(ir.IntType(64), 63), zeros)

    return types.int64(types.int64), generate


@_intrinsic
def count_bits(_context: Any, _word: Any) -> Any:
    """Return the number of set bits of an int64: one instruction."""

    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.int64(types.int64), generate


@_jit
def pack_rows(
    bits: NDArray[np.uint64],
    width: int,
    words: NDArray[np.int64],
    window: tuple[int, int, int, int],
) -> None:
    """Write where the cells of a window are blocked into the words along the rows.

    `window` is top, bottom, left, right, half open. `bits` holds its rows in their whole width,
    one row after another, then at least one word more.
    """
    top, bottom, left, right = window
    row_words = (width + 65) // 64
    ones = np.uint64(0xFFFFFFFFFFFFFFFF)
    for y in range(top, bottom):
        for word in range((left + 1) >> 6, (right >> 6) + 1):
            begin = max(left + 1 - 64 * word, 0)
            end = min(right + 1 - 64 * word, 64)
            mask = ones << np.uint64(begin) & ones >> np.uint64(64 - end)
            first = (y - top) * width + 64 * word - 1
            packed = np.uint64(0) if first < 0 else bits[first >> 6] >> np.uint64(first & 63)
            if first & 63:
                packed |= bits[(first >> 6) + 1] << np.uint64(64 - (first & 63))
            place = PLANES * (1 + (y + 1) * row_words + word)
            words[place] = np.int64(np.uint64(words[place]) & ~mask | packed & mask)


@_jit
def transpose(
    height: int,
    width: int,
    words: NDArray[np.int64],
    lines: tuple[int, int],
    span: tuple[int, int],
) -> None:
    """Copy where cells are blocked from the words `span` of the row lines `lines` to the columns.

    In squares of 64 x 64 bits, whose halves are swapped, then the halves of those and so on.
    """
    row_words = (width + 65) // 64
    column_words = (height + 65) // 64
    columns = PLANES * (1 + (height + 2) * row_words)
    square = np.empty(64, dtype=np.uint64)
    for top in range(lines[0] // 64 * 64, lines[1], 64):
        for word in range(span[0], span[1]):
            for line in range(64):
                square[line] = np.uint64(0xFFFFFFFFFFFFFFFF)
            for line in range(min(64, height + 2 - top)):
                place = PLANES * (1 + (top + line) * row_words + word)
                square[line] = np.uint64(words[place])
            mask = np.uint64(0xFFFFFFFF)
            half = 32
            while half:
                shift = np.uint64(half)
                for start in range(0, 64, 2 * half):
                    for line in range(start, start + half):
                        swap = ((square[line] >> shift) ^ square[line + half]) & mask
                        square[line + half] ^= swap
                        square[line] ^= swap << shift
                half >>= 1
                mask ^= mask << np.uint64(half)
            for bit in range(min(64, width + 2 - 64 * word)):
                column = (64 * word + bit) * column_words + top // 64
                words[columns + PLANES * column] = np.int64(square[bit])


@_jit
def mark_stops(
    words: NDArray[np.int64],
    base: int,
    line_words: int,
    lines: tuple[int, int],
    span: tuple[int, int],
) -> int:
    """Write where scans stop in the words `span` of the lines `lines`, both (first, end).

    `base` is the place of line 0. Returns the number of jump points there, each counted for each
    direction in which a scan stops at it.
    """
    one = np.uint64(1)
    two = np.uint64(2)
    top = np.uint64(63)
    group = np.uint64(PLANES)
    stride = group * np.uint64(line_words)
    count = 0
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
            count += count_bits(np.int64(rising)) + count_bits(np.int64(falling))
            words[here + one] = np.int64(own | rising)
            words[here + two] = np.int64(own | falling)
            here += group
    return count


@_jit
def count_window(
    words: NDArray[np.int64],
    base: int,
    line_words: int,
    lines: tuple[int, int],
    span: tuple[int, int],
) -> tuple[int, int]:
    """Return the blocked cells and the jump points in words of lines, as `mark_stops` has them."""
    blocked = 0
    jump_points = 0
    for line in range(lines[0], lines[1]):
        place = base + PLANES * (line * line_words + span[0])
        for _ in range(span[0], span[1]):
            wall = words[place]
            blocked += count_bits(wall)
            jump_points += count_bits(words[place + 1] & ~wall)
            jump_points += count_bits(words[place + 2] & ~wall)
            place += PLANES
    return blocked, jump_points


@_jit
def pack_window(
    bits: NDArray[np.uint64],
    height: int,
    width: int,
    words: NDArray[np.int64],
    window: tuple[int, int, int, int],
) -> tuple[int, int]:
    """Write a window of the map into `words`: rows top to bottom, columns left to right.

    The window is half open. `bits` holds its rows in their whole width, as `pack_rows` needs
    them. Returns by how much the numbers of blocked cells and of jump points rose.
    """
    top, bottom, left, right = window
    row_words = (width + 65) // 64
    column_words = (height + 65) // 64
    # With its type, or numba compiles what takes it once for this value and once for any.
    rows = np.int64(PLANES)
    columns = PLANES * (1 + (height + 2) * row_words)
    lines = (top + 1, bottom + 1)
    span = ((left + 1) >> 6, (right >> 6) + 1)
    # Stops depend on the cells around.
    rows_near = (max(top, 1), min(bottom + 1, height) + 1)
    span_near = (left >> 6, min((right + 1 >> 6) + 1, row_words))
    columns_near = (max(left, 1), min(right + 1, width) + 1)
    column_span = (top >> 6, min((bottom + 1 >> 6) + 1, column_words))
    blocked, jump_points = count_window(words, rows, row_words, rows_near, span_near)
    jump_points += count_window(words, columns, column_words, columns_near, column_span)[1]
    pack_rows(bits, width, words, window)
    transpose(height, width, words, lines, span)
    now = mark_stops(words, rows, row_words, rows_near, span_near)
    now += mark_stops(words, columns, column_words, columns_near, column_span)
    now_blocked, _ = count_window(words, rows, row_words, rows_near, span_near)
    return now_blocked - blocked, now - jump_points


@_jit
def scan(words: NDArray[np.int64], line: int, position: int, rising: bool) -> int:
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


@_jit
def jump_search(
    moves: NDArray[np.uint8],
    words: NDArray[np.int64],
    width: int,
    straight: int,
    diagonal: int,
    start: int,
    goal: int,
    landmark_distances: NDArray[np.int32],
    active: NDArray[np.int64],
    generation: int,
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    heads: NDArray[np.int32],
    control: NDArray[np.int64],
    quota: int,
) -> int:
    """Run or resume an exact jump point search; return how the call ended.

    A record is the g of a cell and its generation, with CLOSED once it is expanded: as in `astar`,
    so that its `add_expanded` reads it. After NEED_SPACE call again with a longer pool that begins
    the same. RUNNING: at least `quota` scans were made. Before the first call `control` is 0 but
    for J_BEST: only cheaper paths are looked for. EXHAUSTED: there is none. The least bucket is a
    lower bound.
    """
    height = moves.size // width
    row_stride = PLANES * ((width + 65) // 64)
    column_stride = PLANES * ((height + 65) // 64)
    columns = PLANES + (height + 2) * row_stride
    goal_y = goal // width
    goal_x = goal - goal_y * width
    extra = diagonal - straight
    tag = generation << TAG_BITS
    per_width = 1.0 / width
    # The most entries that one expansion can make.
    most = 8 * min(LONGEST_RUN, width, height) + 8
    far = heads.size - 1
    best = control[J_BEST]
    expansions = control[J_EXPANSIONS]
    storage = control[J_STORAGE]
    top = control[J_TOP]
    origin = control[J_ORIGIN]
    bucket = control[J_BUCKET]
    found = control[J_GOAL]
    scans = 0
    if control[J_STARTED] == 0:
        control[J_STARTED] = 1
        delta_x = abs(start % width - goal_x)
        delta_y = abs(start // width - goal_y)
        f: Any = straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)
        for landmark in range(active.shape[0]):
            distance = np.int64(landmark_distances[active[landmark, 0], start])
            f = max(f, abs(distance - active[landmark, 1]))
        for slot in range(heads.size):
            heads[slot] = 0
        heads[0] = 1
        # Buckets begin at the estimate: where that is exact, the first path ends the search.
        origin = f
        bucket = 0
        pool[0] = np.int64(start) << 32
        pool[1] = 0
        pool[2] = f << 3
        records[2 * start] = 0
        records[2 * start + 1] = tag
        top = 1
        storage = 1
        if start == goal:
            best = 0
            found = 1
    entry: Any
    status = RUNNING
    while True:
        while bucket < far and heads[bucket] == 0:
            bucket += 1
        if bucket == far and heads[far]:
            # Move the window of buckets to the least f beyond it.
            entry = np.int64(heads[far])
            least = np.int64(NO_PATH)
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
            status = FOUND if found else EXHAUSTED
            break
        if scans >= quota:
            break
        if ENTRY * (top + most) > pool.size:
            status = NEED_SPACE
            break
        entry = np.int64(heads[bucket])
        item = pool[ENTRY * entry - 3]
        heads[bucket] = item & 0xFFFFFFFF
        cell = item >> 32
        g = pool[ENTRY * entry - 2] >> 32
        if records[2 * cell] != g:
            continue
        records[2 * cell + 1] = tag | CLOSED
        expansions += 1
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        delta_x = abs(int(x) - goal_x)
        delta_y = abs(int(y) - goal_y)
        rise = g + straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y) + RISE
        row = EVERY_MOVE if cell == start else (pool[ENTRY * entry - 1] & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | moves[cell]])
        # What the scans find is written behind the last entry: cell, g and move.
        last = top
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            step_x = STEP_X[move]
            step_y = STEP_Y[move]
            bit = 1 << move
            turn_x = 1 - step_x
            turn_y = 2 - step_y
            at = cell
            at_x = x
            at_y = y
            at_g = g
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
                    delta_x = abs(at_x - goal_x)
                    delta_y = abs(at_y - goal_y)
                    f = at_g + straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)
                    if f >= best:
                        break
                    if at == goal or run == LONGEST_RUN or f > rise:
                        pool[ENTRY * last] = at << 32
                        pool[ENTRY * last + 1] = at_g
                        pool[ENTRY * last + 2] = move
                        last += 1
                        break
                if step_x:
                    scans += 1
                    place = scan(words, PLANES + (at_y + 1) * row_stride, at_x + 1, step_x > 0)
                    length = abs((place >> 1) - 1 - at_x)
                    ahead = (goal_x - at_x) * step_x
                    if at_y == goal_y and 0 < ahead <= length:
                        length = ahead
                        place = 0
                    pool[ENTRY * last] = at + length * step_x << 32
                    pool[ENTRY * last + 1] = at_g + length * straight
                    pool[ENTRY * last + 2] = turn_x
                    last += 1 - (place & 1)
                if step_y:
                    scans += 1
                    place = scan(words, columns + (at_x + 1) * column_stride, at_y + 1, step_y > 0)
                    length = abs((place >> 1) - 1 - at_y)
                    ahead = (goal_y - at_y) * step_y
                    if at_x == goal_x and 0 < ahead <= length:
                        length = ahead
                        place = 0
                    pool[ENTRY * last] = at + length * step_y * width << 32
                    pool[ENTRY * last + 1] = at_g + length * straight
                    pool[ENTRY * last + 2] = turn_y
                    last += 1 - (place & 1)
                if move < 4:
                    break
        # Keep what is new or cheaper than known.
        for candidate in range(top, last):
            other = pool[ENTRY * candidate] >> 32
            other_g = pool[ENTRY * candidate + 1]
            new = records[2 * other + 1] >> TAG_BITS != generation
            if not new and other_g >= records[2 * other]:
                continue
            other_y = np.int64((other + 0.5) * per_width)
            delta_x = abs(int(other - other_y * width) - goal_x)
            delta_y = abs(int(other_y) - goal_y)
            estimate = straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)
            for landmark in range(active.shape[0]):
                distance = np.int64(landmark_distances[active[landmark, 0], other])
                estimate = max(estimate, abs(distance - active[landmark, 1]))
            f = other_g + estimate
            if f >= best:
                continue
            if other_g > LIMIT:
                status = OVERFLOW
                break
            move = pool[ENTRY * candidate + 2]
            storage += new
            top += 1
            records[2 * other] = other_g
            records[2 * other + 1] = tag
            slot = far
            if other == goal:
                best = other_g
                found = top
            else:
                slot = min(max(f - origin >> BUCKET_BITS, bucket), far)
            pool[ENTRY * top - 2] = other_g << 32 | entry
            pool[ENTRY * top - 1] = f << 3 | move
            pool[ENTRY * top - 3] = other << 32 | heads[slot]
            if other != goal:
                heads[slot] = top
        if status == OVERFLOW:
            break
    control[J_BEST] = best
    control[J_EXPANSIONS] = expansions
    control[J_STORAGE] = storage
    control[J_TOP] = top
    control[J_ORIGIN] = origin
    control[J_BUCKET] = bucket
    control[J_GOAL] = found
    control[J_SCANS] += scans
    return status


@_jit
def trace(
    width: int, found: int, pool: NDArray[np.int64], path: NDArray[np.int32]
) -> tuple[int, int]:
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
        path[row, 0] = x
        path[row, 1] = y
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
                path[row, 0] = x
                path[row, 1] = y
