# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops that searches share: legal moves, queues of buckets, heaps; and exact A*.

Cells are numbered row by row, `index = y * width + x`. A legal move is a bit of `moves[index]`:
bits 0 to 3 are +x, +y, -x, -y, bits 4 to 7 the diagonals +x+y, -x+y, -x-y, +x-y. Lengths are
whole numbers, `straight` and `diagonal` units per step. Each cell has a record of two int32:
its g, and a tag `generation << 12 | counted << 11 | target << 4 | closed << 3 | move that led
here`. A record of another generation counts as never seen, so a query clears nothing.

What runs once for each move reads a record at once, as int64, and indexes by unsigned numbers,
which numba does not look at for negative ones.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int8s, Int32s, Int64s, Uint8s, Uint16s
from llm_astar_planner.search.kernel_cache import inlined, jit

STEP_X = np.array([1, 0, -1, 0, 1, -1, -1, 1], dtype=np.int64)
STEP_Y = np.array([0, 1, 0, -1, 1, 1, -1, -1], dtype=np.int64)
# The lowest set bit of a byte: the next move of a mask.
LOWEST = np.array([(mask & -mask).bit_length() - 1 for mask in range(256)], dtype=np.int64)


def canonical_successors(move: int, mask: int) -> int:
    """Return the moves of `mask` to try in a cell entered by `move`, on uniform costs.

    A move is dropped if the previous cell reaches the same neighbour around this cell by a
    shorter way, or by an equally long one whose last move is straight while the move is
    diagonal. Some shortest path remains (proof in docs/guided-search.md). So beside a straight
    move the cells obliquely behind decide, beside a diagonal one those straight behind.
    """
    first = move % 4
    left, back, right = (first + 1) % 4, (first + 2) % 4, (first + 3) % 4
    kept = 1 << move
    if move >= 4:
        kept |= 1 << first | 1 << left
        for straight, diagonal in ((right, 4 + right), (back, 4 + left)):
            if not mask >> straight & 1:
                kept |= 1 << diagonal
        return kept & mask
    for side, ahead, behind in ((left, move, left), (right, right, back)):
        if not mask >> 4 + behind & 1:
            kept |= 1 << side | 1 << 4 + ahead
        elif not mask >> side & 1:
            kept |= 1 << 4 + ahead
    return kept & mask


def forward_moves(move: int) -> int:
    """Return the moves to try, if they are legal, in a cell entered by `move` at any costs.

    Left out are the previous cell and those that it reaches by one straight move: that costs
    less than the way around, and it was tried when the previous cell was expanded. That needs
    moves which can be made back.
    """
    steps = [(int(x), int(y)) for x, y in zip(STEP_X + STEP_X[move], STEP_Y + STEP_Y[move])]
    return sum(1 << other for other in range(8) if sum(map(abs, steps[other])) > 1)


# Indexed by move << 8 | legal moves: those that uniform costs need, then from EVERY_MOVE on all,
# for the start, then from FORWARD on those that other costs need.
EVERY_MOVE, FORWARD = 8 << 8, 9 << 8
CANONICAL_SUCCESSORS = np.array(
    [canonical_successors(move, mask) for move in range(8) for mask in range(256)]
    + list(range(256))
    + [mask & moves for moves in map(forward_moves, range(8)) for mask in range(256)],
    dtype=np.uint8,
)

TAG_BITS = 12
CLOSED = 8
BUCKET_BITS = 6
# Entries of a block of a bucket; the first is the last entry of the block below.
BLOCK = 16
POLL_MASK = 2047
LIMIT = 2**31 - 2**24  # a g above it may not fit an int32 after one more move
NO_PATH = 2**62

# How a call of a kernel ended.
RUNNING, FOUND, EXHAUSTED, STOPPED, NEED_SPACE, OVERFLOW = range(6)

# Slots of the control array of the exact search.
(
    A_STARTED, A_BASE, A_BUCKET, A_BEST, A_EXPANSIONS, A_STORAGE, A_FREE, A_TOP, A_LIVE, A_SIZE,
) = range(10)  # fmt: skip


class Cells(NamedTuple):
    """The cells of a grid as the loops see them, and the lengths of moves in units.

    `cell_surcharge` is empty, or the surcharge of each cell in 1/256: a move costs its length
    times 1 plus the mean of the surcharges at its two ends.
    """

    moves: Uint8s  # [cells]
    cell_surcharge: Uint16s  # [cells] or empty
    width: int
    straight: int
    diagonal: int


@inlined
def octile(straight: int, extra: int, delta_x: int, delta_y: int) -> int:
    """Return the octile distance over so many columns and rows, in units."""
    delta_x, delta_y = abs(delta_x), abs(delta_y)
    return straight * max(delta_x, delta_y) + extra * min(delta_x, delta_y)


@inlined
def estimate_to_goal(landmark_distances: Int32s, active: Int64s, cell: int, distance: int) -> int:
    """Return a lower bound on a cell's cost to the goal: the octile `distance` or a landmark's."""
    for number in range(active.shape[0]):
        row = np.uint64(active[number, 0])
        gap = np.int64(landmark_distances[row, np.uint64(cell)]) - active[number, 1]
        distance = max(distance, abs(gap))
    return distance


@inlined
def push(
    pool: Int64s, heads: Int32s, slot: int, item: int, free: int, top: int
) -> tuple[int, int, int]:
    """Queue `item`, a number << 32, in a bucket; return the entry, the first free one, the top.

    Entries are numbered from 1 to `top`, in the pool as item | next entry; 0: no entry.
    """
    entry: Any = free
    if free:
        free = pool[np.uint64(entry - 1)]
    else:
        top += 1
        entry = top
    pool[np.uint64(entry - 1)] = item | heads[np.uint64(slot)]
    heads[np.uint64(slot)] = entry
    return entry, free, top


@inlined
def pop(pool: Int64s, heads: Int32s, slot: int, free: int) -> tuple[Any, Any]:
    """Take the last entry queued in a bucket; return its number and the first free entry."""
    entry = np.int64(heads[np.uint64(slot)])
    item = pool[np.uint64(entry - 1)]
    heads[np.uint64(slot)] = item & 0xFFFFFFFF
    pool[np.uint64(entry - 1)] = free
    return item >> 32, entry


@jit
def comes_before(keys: Any, nodes: Any, a: int, b: int, by_node: bool) -> bool:
    """Tell whether entry `a` is popped before entry `b`; of equal keys, perhaps `by_node`."""
    return keys[a] < keys[b] or (by_node and keys[a] == keys[b] and nodes[a] < nodes[b])


@jit
def swap(keys: Any, nodes: Any, a: int, b: int) -> None:
    """Swap two entries."""
    keys[a], keys[b] = keys[b], keys[a]
    nodes[a], nodes[b] = nodes[b], nodes[a]


@jit
def sift_down(keys: Any, nodes: Any, i: int, size: int, by_node: bool) -> None:
    """Move entry `i` of `size` entries down to its place."""
    while True:
        child = 2 * i + 1
        if child >= size:
            return
        if child + 1 < size and comes_before(keys, nodes, child + 1, child, by_node):
            child += 1
        if not comes_before(keys, nodes, child, i, by_node):
            return
        swap(keys, nodes, i, child)
        i = child


@jit
def heap_push(keys: Any, nodes: Any, size: int, key: Any, node: int, by_node: bool) -> None:
    """Add an entry to a heap of `size` entries."""
    keys[size], nodes[size] = key, node
    i = size
    while i > 0 and comes_before(keys, nodes, i, (i - 1) >> 1, by_node):
        swap(keys, nodes, i, (i - 1) >> 1)
        i = (i - 1) >> 1


@jit
def heap_pop(keys: Any, nodes: Any, size: int, by_node: bool) -> Any:
    """Remove the first entry from a heap of `size` entries; return its node."""
    node = nodes[0]
    keys[0], nodes[0] = keys[size - 1], nodes[size - 1]
    sift_down(keys, nodes, 0, size - 1, by_node)
    return node


@jit
def choose_landmarks(
    landmark_distances: Int32s, start: int, goal: int, octile: int, active: Int64s
) -> tuple[int, int]:
    """Fill `active` [k, 2] with the landmarks that prove most for a query.

    A landmark is its row and its distance to the goal. Those that prove less than half of the
    octile distance are left out. Returns their number, and what a path costs at least: NO_PATH if
    none joins the cells.
    """
    count = 0
    bound: Any = octile
    most = active.shape[0]
    for row in range(landmark_distances.shape[0]):
        first = np.int64(landmark_distances[row, start])
        last = np.int64(landmark_distances[row, goal])
        if (first < 0) != (last < 0):
            return 0, NO_PATH
        gap = abs(first - last)
        if first < 0 or 2 * gap <= octile:
            continue
        bound = max(bound, gap)
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
    return count, bound


@jit
def astar(
    cells: Cells,
    start: int,
    goal: int,
    successors: int,
    landmark_distances: Int32s,
    active: Int64s,
    generation: int,
    records: Int32s,
    pool: Int64s,
    heads: Int32s,
    control: Int64s,
    quota: int,
) -> int:
    """Run or resume an exact A* for up to `quota` expansions; return how the call ended.

    The estimate is the octile distance or what the `active` landmarks prove: their rows in
    `landmark_distances` and their distances to the goal. `heads` is a ring of buckets, each
    1 << BUCKET_BITS units of f wide and last in, first out: the place of its last entry in
    `pool`, 0 for none. Read as int32 this has the cells in blocks of BLOCK; free blocks are
    linked by their first entries. After NEED_SPACE call again with a longer pool that begins the
    same. `successors` is the first row of the moves to try in CANONICAL_SUCCESSORS: 0 on uniform
    costs, FORWARD on others, EVERY_MOVE where moves cannot be made back. The caller may lower
    `control[A_BEST]` between calls to the cost of a path that it knows.
    """
    moves, cell_surcharge, width, straight, diagonal = cells
    graded = cell_surcharge.size > 0
    ring = heads.size - 1
    goal_y = goal // width
    goal_x = goal - goal_y * width
    extra = diagonal - straight
    per_width = 1.0 / width
    offsets = STEP_Y * width + STEP_X
    lengths = np.array([straight] * 4 + [diagonal] * 4)
    states, entries = records.view(np.int64), pool.view(np.int32)
    tag = np.int64(generation) << 32 + TAG_BITS
    closed = np.int64(CLOSED) << 32
    if control[A_STARTED] == 0:
        control[A_STARTED] = 1
        heads[:] = 0
        distance = octile(straight, extra, start % width - goal_x, start // width - goal_y)
        # Buckets begin at the estimate: where that is exact, the first path ends the search.
        control[A_BASE] = estimate_to_goal(landmark_distances, active, start, distance)
        states[start] = tag
        entries[BLOCK], entries[BLOCK + 1] = 0, start
        heads[0] = BLOCK + 1
        control[A_TOP] = 2 * BLOCK
        control[A_LIVE] = control[A_STORAGE] = 1
        if start == goal:
            control[A_BEST] = 0
    base, bucket, best = control[A_BASE], control[A_BUCKET], control[A_BEST]
    expansions, storage = control[A_EXPANSIONS], control[A_STORAGE]
    free, top, live = control[A_FREE], control[A_TOP], control[A_LIVE]
    limit = expansions + quota
    while True:
        while live > 0 and heads[np.uint64(bucket & ring)] == 0:
            bucket += 1
        if live == 0 or base + (bucket << BUCKET_BITS) >= best:
            status = FOUND if best < NO_PATH else EXHAUSTED
            break
        if expansions >= limit:
            status = RUNNING
            break
        if top + 8 * BLOCK > entries.size:
            status = NEED_SPACE
            break
        slot = np.uint64(bucket & ring)
        place = np.int64(heads[slot])
        cell = np.int64(entries[np.uint64(place)])
        if place & BLOCK - 1 == 1:
            place -= 1
            heads[slot] = entries[np.uint64(place)]
            entries[np.uint64(place)] = free
            free = place
        else:
            heads[slot] = place - 1
        live -= 1
        state = states[np.uint64(cell)]
        if state & closed:
            continue
        states[np.uint64(cell)] = state | closed
        expansions += 1
        g = state & 0xFFFFFFFF
        if g > LIMIT:
            status = OVERFLOW
            break
        y = np.int64((cell + 0.5) * per_width)
        from_goal_x, from_goal_y = cell - y * width - goal_x, y - goal_y
        row = successors + ((state >> 32 & 7) << 8)
        if cell == start or successors == EVERY_MOVE:
            row = np.int64(EVERY_MOVE)
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
            new = known >> 32 + TAG_BITS != generation
            if not new and other_g >= known & 0xFFFFFFFF:
                continue
            distance = octile(
                straight, extra, from_goal_x + STEP_X[move], from_goal_y + STEP_Y[move]
            )
            f = other_g + estimate_to_goal(landmark_distances, active, other, distance)
            if f >= best:
                continue
            storage += new
            states[other] = tag | np.int64(move) << 32 | other_g
            if np.int64(other) == goal:
                best = other_g
                continue
            slot = np.uint64(f - base >> BUCKET_BITS & ring)
            place = np.int64(heads[slot]) + 1
            if place & BLOCK - 1 <= 1:
                block, below = free, place - 1
                if block:
                    free = np.int64(entries[np.uint64(block)])
                else:
                    block = top
                    top += BLOCK
                entries[np.uint64(block)] = below
                place = block + 1
            entries[np.uint64(place)] = np.int64(other)
            heads[slot] = place
            live += 1
    control[A_BASE], control[A_BUCKET], control[A_BEST] = base, bucket, best
    control[A_EXPANSIONS], control[A_STORAGE] = expansions, storage
    control[A_FREE], control[A_TOP], control[A_LIVE] = free, top, live
    return status


@jit
def trace(
    cells: Cells, start: int, goal: int, records: Int32s, path: Int32s
) -> tuple[int, int, int]:
    """Write the path's cells (x, y) at the end of `path`.

    Returns their count, the path's diagonal moves and its cost in units. If `path` is too short
    it holds the last cells, and the count is the length needed.
    """
    _, cell_surcharge, width, straight, diagonal = cells
    graded = cell_surcharge.size > 0
    count = diagonals = units = 0
    y = goal // width
    x = goal - y * width
    row = path.shape[0]
    cell = goal
    while True:
        count += 1
        row -= 1
        if row >= 0:
            path[row, 0], path[row, 1] = x, y
        if cell == start:
            return count, diagonals, units
        move = records[2 * cell + 1] & 7
        diagonals += move >= 4
        x -= STEP_X[move]
        y -= STEP_Y[move]
        before = y * width + x
        length = straight if move < 4 else diagonal
        units += length
        if graded:
            units += length * (np.int64(cell_surcharge[cell]) + cell_surcharge[before]) >> 9
        cell = before


@jit
def add_expanded(records: Int32s, generation: int, expanded: Bools) -> None:
    """Set `expanded` [height, width] where a cell of this generation was expanded."""
    flat = expanded.reshape(-1)
    mask, wanted = -1 << TAG_BITS | CLOSED, generation << TAG_BITS | CLOSED
    for cell in range(flat.size):
        # Writing False elsewhere would make the system allocate every page of a large map.
        if records[2 * cell + 1] & mask == wanted:
            flat[cell] = True


@jit
def reach(moves: Uint8s, width: int, first: int) -> Bools:
    """Return which cells moves lead to from the cell `first`, that included: bool [cells]."""
    reached = np.zeros(moves.size, dtype=np.bool_)
    stack = np.empty(moves.size, dtype=np.int32)
    stack[0], reached[first], count = first, True, 1
    while count:
        count -= 1
        cell = np.int64(stack[count])
        for move in range(8):
            other = cell + STEP_Y[move] * width + STEP_X[move]
            if moves[cell] >> move & 1 and not reached[other]:
                reached[other] = True
                stack[count] = other
                count += 1
    return reached


@jit
def build_moves(blocked: Bools, corner_cutting: bool, windows: Int64s, moves: Uint8s) -> None:
    """Fill `moves` [height * width] with the legal moves of each free cell, 0 where blocked.

    A diagonal needs both adjacent cardinal cells free unless `corner_cutting`. Bits without
    branches, so that the compiler handles many cells at once.
    """
    height, width = blocked.shape
    cutting = 1 if corner_cutting else 0
    for n in range(len(windows)):
        top, bottom, left, right = windows[n]
        size = right - left
        first, last = max(left - 1, 0), min(right + 1, width)
        # Whether cells are free, in three rows and with a column more on either side.
        free = np.zeros((3, size + 2), dtype=np.uint8)
        for y in range(top - 1, bottom + 1):
            above = free[(y + 3) % 3]
            above[:] = 0
            if 0 <= y < height:
                row = blocked[y, first:last]
                inner = above[first - left + 1 : last - left + 1]
                for x in range(row.size):
                    inner[x] = not row[x]
            if y <= top:
                continue
            here, below = free[(y + 2) % 3], free[(y + 1) % 3]
            start = (y - 1) * width + left
            out = moves[start : start + size]
            for x in range(size):
                east, west, up, down = here[x + 2], here[x], above[x + 1], below[x + 1]
                mask = east | up << 1 | west << 2 | down << 3
                mask |= (above[x + 2] & (east & up | cutting)) << 4
                mask |= (above[x] & (west & up | cutting)) << 5
                mask |= (below[x] & (west & down | cutting)) << 6
                mask |= (below[x + 2] & (east & down | cutting)) << 7
                out[x] = mask * here[x + 1]


@jit
def fill_surcharges(cost: Int8s, table: Uint16s, windows: Int64s, surcharges: Uint16s) -> None:
    """Fill `surcharges` [height * width] from `cost` [height, width] by a table of 256."""
    width = cost.shape[1]
    for n in range(len(windows)):
        top, bottom, left, right = windows[n]
        for y in range(top, bottom):
            row = cost[y, left:right]
            out = surcharges[y * width + left : y * width + right]
            for x in range(row.size):
                out[x] = table[np.uint8(row[x])]
