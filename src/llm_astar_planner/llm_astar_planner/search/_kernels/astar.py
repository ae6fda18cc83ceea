"""Compiled loops of the bucket-queue searches: the tables of moves, exact A*.

Cells are numbered row by row, `index = y * width + x`. A legal move is a bit of `moves[index]`:
bits 0 to 3 are +x, +y, -x, -y, bits 4 to 7 the diagonals +x+y, -x+y, -x-y, +x-y. Lengths are
whole numbers, `straight` and `diagonal` units per step. Each cell has a record of two int32:
its g, and a tag `generation << 12 | counted << 11 | target << 4 | closed << 3 | move that led
here`. A record of another generation counts as never seen, so a query clears nothing.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

STEP_X = np.array([1, 0, -1, 0, 1, -1, -1, 1], dtype=np.int64)
STEP_Y = np.array([0, 1, 0, -1, 1, 1, -1, -1], dtype=np.int64)
# The lowest set bit of a byte: the next move of a mask.
LOWEST = np.array([(mask & -mask).bit_length() - 1 for mask in range(256)], dtype=np.int64)


def ways_around(move: int, mask: int) -> dict[tuple[int, int], tuple[float, bool]]:
    """Return the shortest ways from the previous cell to each neighbour, around this cell.

    This cell is (0, 0), entered by `move`; `mask` holds its legal moves, which tell which
    neighbours are surely free. A way is (length, whether its last move is diagonal); among ways
    of equal length one that ends with a straight move is preferred.
    """
    steps = [(int(x), int(y)) for x, y in zip(STEP_X, STEP_Y)]
    before = (-steps[move][0], -steps[move][1])
    free = {step for bit, step in enumerate(steps) if mask >> bit & 1} | {before}
    ways = {before: (0.0, False)}
    known_before: dict[tuple[int, int], tuple[float, bool]] = {}
    while ways != known_before:
        known_before = dict(ways)
        for cell in known_before:
            for step_x, step_y in steps:
                x, y = cell[0] + step_x, cell[1] + step_y
                corners = {(x, cell[1]), (cell[0], y)} if step_x and step_y else {(x, y)}
                if (x, y) in free and corners <= free | {(0, 0)}:
                    way = (ways[cell][0] + math.hypot(step_x, step_y), bool(step_x and step_y))
                    known = ways.get((x, y), (math.inf, True))
                    if way[0] < known[0] - 1e-9 or (way[0] < known[0] + 1e-9 and way < known):
                        ways[x, y] = (min(way[0], known[0]), way[1])
    return ways


def canonical_successors(move: int, mask: int) -> int:
    """Return the moves of `mask` to try in a cell entered by `move`, on uniform costs.

    A move is dropped if the previous cell reaches the same neighbour around this cell by a
    shorter way, or by an equally long one whose last move is straight while the move is
    diagonal. Some shortest path remains (proof in docs/guided-search.md).
    """
    ways = ways_around(move, mask)
    length = 1.0 if move < 4 else math.sqrt(2.0)
    kept = 0
    for bit in range(8):
        if mask >> bit & 1:
            direct = length + (1.0 if bit < 4 else math.sqrt(2.0))
            around, ends_diagonal = ways.get(
                (int(STEP_X[bit]), int(STEP_Y[bit])), (math.inf, True)
            )
            shorter = around < direct - 1e-9
            equal = around < direct + 1e-9 and bit >= 4 and not ends_diagonal
            if not (shorter or equal):
                kept |= 1 << bit
    return kept


def turned(mask: int, turns: int) -> int:
    """Return a mask of moves after 0 to 3 quarter turns to the left."""
    straight, diagonal = (mask & 15) << turns, (mask >> 4) << turns
    return (straight | straight >> 4) & 15 | ((diagonal | diagonal >> 4) & 15) << 4


def successor_table() -> NDArray[np.uint8]:
    """Return `canonical_successors` of all moves and masks, and a last row that keeps all moves.

    Those of the moves +x and +x+y are computed, and the others turned from them.
    """
    table = np.zeros((9, 256), dtype=np.uint8)
    table[8] = np.arange(256)
    for first in (0, 4):
        for mask in range(256):
            kept = canonical_successors(first, mask)
            for turns in range(4):
                table[first + turns, turned(mask, turns)] = turned(kept, turns)
    return table.ravel()


# Indexed by move << 8 | legal moves; row 8 keeps all moves, for the start and graded costs.
EVERY_MOVE = 8 << 8
CANONICAL_SUCCESSORS = successor_table()

TAG_BITS = 12
CLOSED = 8
BUCKET_BITS = 6
POLL_MASK = 2047
LIMIT = 2**31 - 2**24  # a g above it may not fit an int32 after one more move
NO_PATH = 2**62

# How a call of a kernel ended.
RUNNING, FOUND, EXHAUSTED, STOPPED, NEED_SPACE, OVERFLOW = range(6)

# Slots of the control array of the exact search.
(
    A_STARTED, A_BASE, A_BUCKET, A_BEST, A_EXPANSIONS, A_STORAGE, A_FREE, A_TOP, A_LIVE, A_SIZE,
) = range(10)  # fmt: skip

_jit: Any = njit(cache=True, nogil=True)


@_jit
def choose_landmarks(
    landmark_distances: NDArray[np.int32],
    start: int,
    goal: int,
    octile: int,
    active: NDArray[np.int64],
) -> int:
    """Fill `active` [k, 2] with the landmarks that prove most for a query; return their number.

    A landmark is its row and its distance to the goal. Those that prove less than half of the
    octile distance are left out. Returns -1 if they prove that no path joins the cells.
    """
    count = 0
    most = active.shape[0]
    for row in range(landmark_distances.shape[0]):
        first = np.int64(landmark_distances[row, start])
        last = np.int64(landmark_distances[row, goal])
        if (first < 0) != (last < 0):
            return -1
        gap = abs(first - last)
        if first < 0 or 2 * gap <= octile:
            continue
        # Insertion into the list, the largest gap first.
        place = count
        while place > 0:
            before = active[place - 1]
            other = abs(np.int64(landmark_distances[before[0], start]) - before[1])
            if other >= gap:
                break
            if place < most:
                active[place, 0], active[place, 1] = before[0], before[1]
            place -= 1
        if place < most:
            active[place, 0] = row
            active[place, 1] = last
            count = min(count + 1, most)
    return count


@_jit
def astar(
    moves: NDArray[np.uint8],
    cell_surcharge: NDArray[np.uint16],
    width: int,
    straight: int,
    diagonal: int,
    start: int,
    goal: int,
    every_move: bool,
    landmark_distances: NDArray[np.int32],
    active: NDArray[np.int64],
    generation: int,
    records: NDArray[np.int32],
    pool: NDArray[np.int64],
    heads: NDArray[np.int32],
    control: NDArray[np.int64],
    quota: int,
) -> int:
    """Run or resume an exact A* for up to `quota` expansions; return how the call ended.

    The estimate is the octile distance or what the `active` landmarks prove: their rows in
    `landmark_distances` and their distances to the goal. `heads` is a ring of buckets, each
    1 << BUCKET_BITS units of f wide and last in, first out; entries live in `pool` as
    `cell << 32 | next entry + 1`. After NEED_SPACE call again with a longer pool that begins the
    same. `cell_surcharge` is empty, or the surcharge of each cell in 1/256: a move costs its
    length times 1 plus the mean of the surcharges at its two ends. `every_move` also tries the
    moves that uniform costs make pointless; graded costs need it. The caller may lower
    `control[A_BEST]` between calls to the cost of a path that it knows.
    """
    graded = cell_surcharge.size > 0
    ring = heads.size - 1
    goal_y = goal // width
    goal_x = goal - goal_y * width
    extra = diagonal - straight
    per_width = 1.0 / width
    tag = generation << TAG_BITS
    landmarks = active.shape[0]
    best: Any
    if control[A_STARTED] == 0:
        control[A_STARTED] = 1
        heads[:] = 0
        delta_x = abs(start % width - goal_x)
        delta_y = abs(start // width - goal_y)
        estimate: Any = straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)
        for number in range(landmarks):
            distance = np.int64(landmark_distances[active[number, 0], start])
            estimate = max(estimate, abs(distance - active[number, 1]))
        # Buckets begin at the estimate: where that is exact, the first path ends the search.
        base: Any = estimate
        bucket: Any = 0
        records[2 * start] = 0
        records[2 * start + 1] = tag
        pool[0] = np.int64(start) << 32
        heads[0] = 1
        best = control[A_BEST] if start != goal else 0
        expansions = 0
        storage = 1
        free: Any = 0
        top = 1
        live = 1
    else:
        base = control[A_BASE]
        bucket = control[A_BUCKET]
        best = control[A_BEST]
        expansions = control[A_EXPANSIONS]
        storage = control[A_STORAGE]
        free = control[A_FREE]
        top = control[A_TOP]
        live = control[A_LIVE]
    limit = expansions + quota
    entry: Any
    while True:
        while live > 0 and heads[bucket & ring] == 0:
            bucket += 1
        if live == 0 or base + (bucket << BUCKET_BITS) >= best:
            status = FOUND if best < NO_PATH else EXHAUSTED
            break
        if expansions >= limit:
            status = RUNNING
            break
        if top + 8 > pool.size:
            status = NEED_SPACE
            break
        slot = bucket & ring
        entry = heads[slot]
        item = pool[entry - 1]
        heads[slot] = item & 0xFFFFFFFF
        pool[entry - 1] = free
        free = entry
        live -= 1
        cell = item >> 32
        cell_tag = records[2 * cell + 1]
        if cell_tag & CLOSED:
            continue
        records[2 * cell + 1] = cell_tag | CLOSED
        expansions += 1
        g = np.int64(records[2 * cell])
        if g > LIMIT:
            status = OVERFLOW
            break
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        row = EVERY_MOVE if every_move or cell == start else (cell_tag & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | moves[cell]])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            step_x = STEP_X[move]
            step_y = STEP_Y[move]
            other = cell + step_y * width + step_x
            length = straight if move < 4 else diagonal
            other_g = g + length
            if graded:
                other_g += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[other]) >> 9
            other_tag = records[2 * other + 1]
            new = other_tag >> TAG_BITS != generation
            if new or other_g < records[2 * other]:
                delta_x = abs(x + step_x - goal_x)
                delta_y = abs(y + step_y - goal_y)
                estimate = straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)
                for number in range(landmarks):
                    distance = np.int64(landmark_distances[active[number, 0], other])
                    estimate = max(estimate, abs(distance - active[number, 1]))
                f = other_g + estimate
                if f < best:
                    storage += new
                    records[2 * other] = other_g
                    records[2 * other + 1] = tag | move
                    if other == goal:
                        best = other_g
                    else:
                        slot = (f - base >> BUCKET_BITS) & ring
                        if free:
                            entry = free
                            free = pool[entry - 1]
                        else:
                            top += 1
                            entry = top
                        pool[entry - 1] = other << 32 | heads[slot]
                        heads[slot] = entry
                        live += 1
    control[A_BASE] = base
    control[A_BUCKET] = bucket
    control[A_BEST] = best
    control[A_EXPANSIONS] = expansions
    control[A_STORAGE] = storage
    control[A_FREE] = free
    control[A_TOP] = top
    control[A_LIVE] = live
    return status


@_jit
def trace(
    width: int,
    straight: int,
    diagonal: int,
    cell_surcharge: NDArray[np.uint16],
    start: int,
    goal: int,
    records: NDArray[np.int32],
    path: NDArray[np.int32],
) -> tuple[int, int, int]:
    """Write the path's cells (x, y) at the end of `path`.

    Returns their count, the path's diagonal moves and its cost in units. If `path` is too short
    it holds the last cells, and the count is the length needed.
    """
    graded = cell_surcharge.size > 0
    count = 0
    diagonals = 0
    units = 0
    y = goal // width
    x = goal - y * width
    row = path.shape[0]
    cell = goal
    while True:
        count += 1
        row -= 1
        if row >= 0:
            path[row, 0] = x
            path[row, 1] = y
        if cell == start:
            return count, diagonals, units
        move = records[2 * cell + 1] & 7
        diagonals += move >= 4
        length = straight if move < 4 else diagonal
        units += length
        x -= STEP_X[move]
        y -= STEP_Y[move]
        before = y * width + x
        if graded:
            units += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[before]) >> 9
        cell = before


@_jit
def add_expanded(records: NDArray[np.int32], generation: int, expanded: NDArray[np.bool_]) -> None:
    """Set `expanded` [height, width] where a cell of this generation was expanded."""
    flat = expanded.reshape(-1)
    mask, wanted = -1 << TAG_BITS | CLOSED, generation << TAG_BITS | CLOSED
    for cell in range(flat.size):
        # Writing False elsewhere would make the system allocate every page of a large map.
        if records[2 * cell + 1] & mask == wanted:
            flat[cell] = True
