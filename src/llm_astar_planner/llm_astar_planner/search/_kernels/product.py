# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of the product search: an exact A* over pairs of a cell and a product state.

See `_kernels/astar` for the layout of cells and moves. A product state is a tuple of the states of
automata; it gets a number, its slot, when a path first enters it. A letter is a set of regions
that some cells are in; automata read the letter of each cell. Costs are float64 in the grid's
units of length: whole numbers without prices, so that lengths are exact. States are kept in
blocks of BLOCK x BLOCK cells of one slot, which are made when the search comes there.

The queue has LEVELS rows of 1 << DIGIT_BITS buckets, last in first out (a multi-level bucket
queue: Denardo and Fox, Operations Research 1979). A key is f >> BUCKET_BITS; the row of an entry
is the highest digit in which its key differs from the last key taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import STEP_X, STEP_Y, Cells, octile, pop, push
from llm_astar_planner.search.arrays import (
    Bools,
    Float32s,
    Float64s,
    Int32s,
    Int64s,
    Uint8s,
    Uint16s,
)
from llm_astar_planner.search.kernel_cache import inlined, jit

CANONICAL_SUCCESSORS, LOWEST = shared.CANONICAL_SUCCESSORS, shared.LOWEST
DIGIT_BITS = 10
LEVELS = 6
# Bits of a state's tag, above CLOSED and the move that led here. ENTERED: the slot changed on
# entering the cell, or it is the start.
SEEN, ENTERED, EXPANDED = 16, 32, 64
# Slots of the control array. C_BLOCKS and C_SLOTS: the number of blocks and of slots.
(C_LAST, C_TOP, C_FREE, C_LIVE, C_EXPANSIONS, C_STORAGE, C_BLOCKS, C_SLOTS, C_GOAL, C_SIZE) = (
    range(10)
)
# Bits of `Tables.letters` above the letter: a neighbour has another letter; a goal cell.
BORDER, GOAL = 1 << 15, 1 << 14
LETTER = GOAL - 1
BLOCK_BITS = 4
BLOCK = 1 << BLOCK_BITS
BLOCK_STATES = BLOCK * BLOCK
# A block's origin holds its slot and the row and column of its first cell, so many bits each.
ORIGIN_BITS = 20
ORIGIN_MASK = (1 << ORIGIN_BITS) - 1
# In `Layers.after`, besides 0, not asked yet, and slots + 1: no path that may end goes there.
DEAD = -1
# Rows of distances that one search uses, a constant so that the compiler unrolls loops over them.
ACTIVE = 8


class Tables(NamedTuple):
    """What a query does not change: the grid, and what the automata say of each letter.

    The entry of automaton a for a state and a letter is at offsets[a] + state * letters + letter.
    """

    grid: Cells
    price: Float32s  # [cells] or empty
    letters: Uint16s  # [cells]
    offsets: Int64s  # [automata]
    after: Int32s  # the state after the letter, -1 if no path may end from there
    rates: Float64s  # what a cell of the letter costs more while in the state
    accepting: Bools  # [states of all automata], those of a from offsets[a] / letters


class Guide(NamedTuple):
    """Lower bounds on the cost to go, by the places where the product state may change next.

    A place is a tile of the cells of a letter; place 0 is the start and the last one the goal.
    The way from a cell to a place is bounded by its octile distance from a box and by the
    distances of both from ACTIVE sets of cells, none if `rows` is empty. What proves something on
    the way between places proves as much on its parts, so that bounds never fall along a path.
    """

    boxes: Int64s  # [places, 4]: x0, x1, y0, y1
    rows: Int32s  # [n, cells]: distances of every cell from n sets of cells
    active: Int64s  # [ACTIVE]: the rows used
    low: Int32s  # [places, ACTIVE]: the least of the distances of the place's cells
    high: Int32s  # [places, ACTIVE]: the greatest
    radix: Int64s  # [automata]: times their states, added: the row of `rest`
    rest: Float64s  # [guided, places]: the cost to go from the place, inf: none


class Layers(NamedTuple):
    """What is known of each slot; capacity for as many as the arrays are long."""

    states: Int32s  # [slots, automata]
    is_final: Bools  # [slots]: whether a path may end
    after: Int32s  # [slots, letters]: the slot after the letter + 1, 0: unknown
    rates: Float64s  # [slots, letters]: what a cell of the letter costs more
    pages: Int32s  # [slots, blocks of the map]: a block's number + 1, 0: none yet
    options: Int64s  # [slots]: the number of places that the way may lead to next
    places: Int32s  # [slots, places]: these, the most promising first
    rest: Float64s  # [slots, places]: the cost to go from each


class States(NamedTuple):
    """What is known of each pair of a slot and a cell, block by block."""

    origins: Int64s  # [blocks]
    costs: Float64s  # [blocks, BLOCK_STATES]
    tags: Uint8s  # [blocks, BLOCK_STATES], 0: never seen
    came: Int32s  # [blocks, BLOCK_STATES]: the slot before, of tags with ENTERED


class Queue(NamedTuple):
    """The open states: a pool of linked entries, of the heads of LEVELS << DIGIT_BITS lists."""

    keys: Int64s
    entries: Int64s  # state << 32 | next entry + 1


class Search(NamedTuple):
    """A search: what it is for, and what it keeps from call to call."""

    tables: Tables
    guide: Guide
    layers: Layers
    states: States
    queue: Queue
    heads: Int32s
    slots: Int32s  # a hash table of slot + 1 by product state
    control: Int64s  # [C_SIZE]
    best: Float64s  # the cost of the best path, inf without one; one element


@jit
def add_region(
    region: int, cells: Int64s, blocked: Bools, letters: Uint16s, sets: Int64s, used: int
) -> int:
    """Add a region to the letters of its free cells; `sets` are those of the `used` letters.

    Returns the number of letters then, over LETTER if there are too many.
    """
    with_region = np.zeros(sets.size, dtype=np.int64)
    for cell in cells:
        if not blocked[cell]:
            letter = letters[cell]
            if with_region[letter] == 0:
                if used == sets.size:
                    return used + 1
                sets[used] = sets[letter] | np.int64(1) << region
                with_region[letter] = used
                used += 1
            letters[cell] = with_region[letter]
    return used


@jit
def mark_borders(cells: Int64s, moves: Uint8s, width: int, letters: Uint16s) -> None:
    """Mark each of the `cells` that has a neighbour with another letter, and that neighbour."""
    height = moves.size // width
    for cell in cells:
        y = cell // width
        x = cell - y * width
        for move in range(8 if letters[cell] & LETTER else 0):
            other_x, other_y = x + STEP_X[move], y + STEP_Y[move]
            if 0 <= other_x < width and 0 <= other_y < height:
                other = other_y * width + other_x
                if moves[other] and (letters[other] ^ letters[cell]) & LETTER:
                    letters[other] |= BORDER
                    letters[cell] |= BORDER


@inlined
def gap(low: int, high: int, other_low: int, other_high: int) -> int:
    """Return how far apart two intervals are, 0 where they overlap."""
    return max(other_low - high, low - other_high, 0)


@jit
def fill_rest(
    between: Float64s, letters: Int64s, after: Int64s, accepting: Bools, rest: Float64s
) -> None:
    """Fill `rest` with the least costs to go from each place, by value iteration.

    `letters` are those of the places and `after` [guided, letters] are product states, -1: none.
    A change of state outside of all regions takes no way: wherever it is, the way goes on to a
    place after it.
    """
    goal = letters.size - 1
    rest[accepting, goal] = 0.0
    changed = True
    while changed:
        changed = False
        for state in range(len(after) - 1, -1, -1):
            outside = after[state, 0]
            for place in range(1, letters.size):
                least = rest[state, place]
                following = after[state, letters[place]]
                if place < goal and following >= 0 and following != state:
                    for other in range(1, letters.size):
                        least = min(least, between[place, other] + rest[following, other])
                if outside >= 0:
                    least = min(least, rest[outside, place])
                if least < rest[state, place]:
                    rest[state, place] = least
                    changed = True


@jit
def fill_options(tables: Tables, guide: Guide, layers: Layers, slot: int, cell: int) -> None:
    """Note the places that the way from `slot`, entered at `cell`, may lead to next.

    The most promising ones come first, since what is found early saves work.
    """
    _, _, width, straight, diagonal = tables.grid
    y = cell // width
    x = cell - y * width
    state = 0
    for automaton in range(guide.radix.size):
        state += guide.radix[automaton] * layers.states[slot, automaton]
    rest = guide.rest[state]
    promise = rest.copy()
    for place in range(rest.size):
        box = guide.boxes[place]
        delta_x, delta_y = gap(x, x, box[0], box[1]), gap(y, y, box[2], box[3])
        promise[place] += octile(straight, diagonal - straight, delta_x, delta_y)
    count = 0
    for place in np.argsort(promise):
        if rest[place] < np.inf:
            layers.places[slot, count] = place
            layers.rest[slot, count] = rest[place]
            count += 1
    layers.options[slot] = count


@jit
def slot_after(
    tables: Tables, guide: Guide, layers: Layers, table: Int32s, slot: int, slots: int, cell: int
) -> int:
    """Return the slot in which a path is that goes from `slot` to `cell`; DEAD: none.

    It is number `slots` if it is new. Notes what it finds in `layers`.
    """
    letters = layers.after.shape[1]
    letter = np.int64(tables.letters[cell]) & LETTER
    mixed = 0
    rate = 0.0
    final = True
    state: Any
    for automaton in range(tables.offsets.size):
        first = tables.offsets[automaton]
        state = tables.after[first + layers.states[slot, automaton] * letters + letter]
        if state < 0:
            layers.after[slot, letter] = DEAD
            return DEAD
        layers.states[slots, automaton] = state
        rate += tables.rates[first + state * letters + letter]
        final &= tables.accepting[first // letters + state]
        mixed = (mixed + state + 1) * 0x9E3779B1 & 0xFFFFFFFF
        mixed ^= mixed >> 15
    place = mixed & table.size - 1
    found: Any = slots
    while table[place]:
        other = table[place] - 1
        if (layers.states[other] == layers.states[slots]).all():
            found = np.int64(other)
            break
        place = (place + 1) & table.size - 1
    if found == slots:
        table[place] = slots + 1
        fill_options(tables, guide, layers, slots, cell)
    layers.is_final[found] = final
    layers.after[slot, letter] = found + 1
    layers.rates[found, letter] = rate
    return found


@inlined
def bucket_of(key: int, last: int) -> int:
    """Return the bucket of a key, not below `last`, the last key taken."""
    difference = (key ^ last) >> DIGIT_BITS
    if difference == 0:
        return key & ((1 << DIGIT_BITS) - 1)
    level = 1
    while difference >> DIGIT_BITS:
        difference >>= DIGIT_BITS
        level += 1
    digit = key >> (DIGIT_BITS * level) & ((1 << DIGIT_BITS) - 1)
    return level << DIGIT_BITS | digit


@jit
def refill(queue: Queue, heads: Int32s, last: int) -> int:
    """Spread the lowest bucket of the rows above the empty first one; return the new last key."""
    size = 1 << DIGIT_BITS
    for level in range(1, LEVELS):
        shift = DIGIT_BITS * level
        for digit in range((last >> shift & (size - 1)) + 1, size):
            entry = np.int64(heads[level * size + digit])
            if entry:
                heads[level * size + digit] = 0
                last = last >> (shift + DIGIT_BITS) << (shift + DIGIT_BITS) | digit << shift
                while entry:
                    item = queue.entries[entry - 1]
                    bucket = bucket_of(queue.keys[entry - 1], last)
                    queue.entries[entry - 1] = item >> 32 << 32 | heads[bucket]
                    heads[bucket] = entry
                    entry = item & 0xFFFFFFFF
                return last
    return last


@jit
def begin(search: Search, start: int) -> None:
    """Put the start on the queue, if a path from it may end somewhere."""
    tables, guide, layers, states, queue, heads, table, control, best = search
    width = tables.grid.width
    best[0] = np.inf
    # Slot 0 is before the start.
    mixed = 0
    for _ in range(tables.offsets.size):
        mixed = (mixed + 1) * 0x9E3779B1 & 0xFFFFFFFF
        mixed ^= mixed >> 15
    table[mixed & table.size - 1] = 1
    fill_options(tables, guide, layers, 0, start)
    control[C_SLOTS] = 1
    slot = slot_after(tables, guide, layers, table, 0, 1, start)
    if slot == DEAD:
        return
    control[C_SLOTS] = slot + 1
    y = start // width
    x = start - y * width
    states.origins[0] = origin_of(slot, x, y)
    layers.pages[slot, page_of(width, x, y)] = control[C_BLOCKS] = 1
    state = (y & BLOCK - 1) << BLOCK_BITS | x & BLOCK - 1
    states.costs[0] = np.inf
    states.costs[0, state] = 0.0
    states.tags[0, state] = SEEN | ENTERED
    states.came[0, state] = -1
    control[C_STORAGE] = 1
    if tables.letters[start] & GOAL and layers.is_final[slot]:
        best[0] = 0.0
        control[C_GOAL] = state
        return
    if layers.options[slot]:
        queue.entries[0] = np.int64(state) << 32
        heads[0] = control[C_TOP] = control[C_LIVE] = 1


@inlined
def origin_of(slot: int, x: int, y: int) -> int:
    """Return the origin of the block of a cell in a slot."""
    row = y >> BLOCK_BITS << BLOCK_BITS
    return (slot << ORIGIN_BITS | row) << ORIGIN_BITS | x >> BLOCK_BITS << BLOCK_BITS


@inlined
def page_of(width: int, x: int, y: int) -> int:
    """Return which of a map's blocks a cell is in."""
    return (y >> BLOCK_BITS) * (width + BLOCK - 1 >> BLOCK_BITS) + (x >> BLOCK_BITS)


@jit
def advance(search: Search, every_move: bool, priced: bool, quota: int, stop: Uint8s) -> int:
    """Expand up to `quota` states; return how the call ended.

    `every_move` also tries the moves that uniform costs make pointless; graded costs and prices
    of cells need it. `priced`: there are prices of cells or of automata. After NEED_SPACE call
    again with longer arrays that begin as before.
    """
    # Taken out of the tuples once: numba counts references at each access.
    tables, guide, layers, states, queue, heads, table, control, best = search
    moves, cell_surcharge, width, straight, diagonal = tables.grid
    price, letters = tables.price, tables.letters
    boxes, rows, active, low, high = guide.boxes, guide.rows, guide.active, guide.low, guide.high
    distances = np.empty(ACTIVE, dtype=np.int32)
    has_rows = rows.shape[0] > 0
    is_final, slots_after, rates, pages = layers.is_final, layers.after, layers.rates, layers.pages
    options, places, rest = layers.options, layers.places, layers.rest
    origins, came = states.origins, states.came.reshape(-1)
    costs, tags = states.costs.reshape(-1), states.tags.reshape(-1)
    keys, entries = queue.keys, queue.entries
    graded = cell_surcharge.size > 0
    has_price = price.size > 0
    digits = (1 << DIGIT_BITS) - 1
    last, top, live = control[C_LAST], control[C_TOP], control[C_LIVE]
    free: Any = control[C_FREE]
    expansions, storage = control[C_EXPANSIONS], control[C_STORAGE]
    blocks, slots = control[C_BLOCKS], control[C_SLOTS]
    limit = expansions + quota
    least: Any = best[0]
    status = shared.RUNNING
    while status == shared.RUNNING:
        while live > 0 and heads[last & digits] == 0:
            digit = last & digits
            while digit < digits and heads[digit] == 0:
                digit += 1
            last = refill(queue, heads, last) if heads[digit] == 0 else last & ~digits | digit
        if live == 0 or last << shared.BUCKET_BITS >= least:
            status = shared.FOUND if least < np.inf else shared.EXHAUSTED
            break
        if expansions >= limit:
            break
        if top + 8 > keys.size or blocks + 8 > origins.size or slots + 8 > is_final.size:
            status = shared.NEED_SPACE
            break
        state, free = pop(entries, heads, last & digits, free)
        live -= 1
        tag = tags[state]
        if tag & shared.CLOSED:
            continue
        tags[state] = tag | shared.CLOSED | EXPANDED
        expansions += 1
        if expansions & shared.POLL_MASK == 0 and stop[0] != 0:
            status = shared.STOPPED
        cost = costs[state]
        origin = origins[state >> 2 * BLOCK_BITS]
        slot = origin >> 2 * ORIGIN_BITS
        x = (origin & ORIGIN_MASK) + (state & BLOCK - 1)
        y = (origin >> ORIGIN_BITS & ORIGIN_MASK) + (state >> BLOCK_BITS & BLOCK - 1)
        cell = y * width + x
        letter = np.int64(letters[cell])
        rate = 0.0
        if priced:
            rate = rates[slot, letter & LETTER] + (np.float64(price[cell]) if has_price else 0.0)
        # Pointless moves are so only where no move changes what is known of the path.
        every = every_move or tag & ENTERED or letter & BORDER
        row = shared.EVERY_MOVE if every else np.int64(tag & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | moves[cell]])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            other = other_y * width + other_x
            other_letter = np.int64(letters[other])
            other_slot = np.int64(slots_after[slot, other_letter & LETTER]) - 1
            if other_slot < 0:
                if other_slot == -1:
                    other_slot = slot_after(tables, guide, layers, table, slot, slots, other)
                    slots = max(slots, other_slot + 1)
                if other_slot < 0:
                    continue
            length = straight if move < 4 else diagonal
            other_units = length
            if graded:
                surcharge = np.int64(cell_surcharge[cell]) + cell_surcharge[other]
                other_units += length * surcharge >> 9
            other_cost = cost + other_units
            if priced:
                other_rate = rates[other_slot, other_letter & LETTER]
                if has_price:
                    other_rate += price[other]
                other_cost += 0.5 * length * (rate + other_rate)
            page = page_of(width, other_x, other_y)
            block = pages[other_slot, page] - 1
            if block < 0:
                block = blocks
                blocks += 1
                pages[other_slot, page] = blocks
                origins[block] = origin_of(other_slot, other_x, other_y)
                for within in range(block * BLOCK_STATES, blocks * BLOCK_STATES):
                    costs[within] = np.inf
            within = (other_y & BLOCK - 1) << BLOCK_BITS | other_x & BLOCK - 1
            other_state = np.int64(block) << 2 * BLOCK_BITS | within
            if other_cost < costs[other_state]:
                # The estimate stands here, as a function it would count references to arrays.
                if has_rows:
                    for index in range(ACTIVE):
                        distances[index] = rows[active[index], other]
                to_go = np.inf
                for option in range(options[other_slot]):
                    place = places[other_slot, option]
                    delta_x = gap(other_x, other_x, boxes[place, 0], boxes[place, 1])
                    delta_y = gap(other_y, other_y, boxes[place, 2], boxes[place, 3])
                    way = octile(straight, diagonal - straight, delta_x, delta_y)
                    if has_rows and rest[other_slot, option] + way < to_go:
                        for index in range(ACTIVE):
                            distance = distances[index]
                            nearer, farther = low[place, index], high[place, index]
                            way = max(way, nearer - distance, distance - farther)
                    to_go = min(to_go, rest[other_slot, option] + way)
                f = other_cost + to_go
                if f < least:
                    storage += tags[other_state] == 0
                    costs[other_state] = other_cost
                    tags[other_state] = SEEN | move
                    if other_slot != slot:
                        tags[other_state] = SEEN | move | ENTERED
                        came[other_state] = slot
                    if other_letter & GOAL and is_final[other_slot]:
                        least = other_cost
                        control[C_GOAL] = other_state
                        continue
                    key = max(np.int64(f) >> shared.BUCKET_BITS, last)
                    bucket = bucket_of(key, last)
                    entry, free, top = push(entries, heads, bucket, other_state << 32, free, top)
                    keys[entry - 1] = key
                    live += 1
    control[C_LAST], control[C_TOP], control[C_LIVE], control[C_FREE] = last, top, live, free
    control[C_EXPANSIONS], control[C_STORAGE] = expansions, storage
    control[C_BLOCKS], control[C_SLOTS] = blocks, slots
    best[0] = least
    return status


@jit
def trace(search: Search, path: Int32s) -> tuple[int]:
    """Write the best path's cells (x, y) at the end of `path`; return their count.

    If `path` is too short it holds the last cells, and the count is the length needed.
    """
    states, width = search.states, search.tables.grid.width
    block, within = divmod(search.control[C_GOAL], BLOCK_STATES)
    count = 0
    row = len(path)
    while True:
        count += 1
        row -= 1
        origin = states.origins[block]
        slot = origin >> 2 * ORIGIN_BITS
        x = (origin & ORIGIN_MASK) + (within & BLOCK - 1)
        y = (origin >> ORIGIN_BITS & ORIGIN_MASK) + (within >> BLOCK_BITS)
        if row >= 0:
            path[row, 0], path[row, 1] = x, y
        tag = states.tags[block, within]
        if tag & ENTERED:
            slot = np.int64(states.came[block, within])
            if slot < 0:
                return (count,)
        x -= STEP_X[tag & 7]
        y -= STEP_Y[tag & 7]
        block = np.int64(search.layers.pages[slot, page_of(width, x, y)]) - 1
        within = (y & BLOCK - 1) << BLOCK_BITS | x & BLOCK - 1


@jit
def add_expanded(states: States, blocks: int, expanded: Bools) -> None:
    """Set `expanded` [height, width] where a state of the first `blocks` was expanded."""
    for block in range(blocks):
        left = states.origins[block] & ORIGIN_MASK
        top = states.origins[block] >> ORIGIN_BITS & ORIGIN_MASK
        for within in range(BLOCK_STATES):
            if states.tags[block, within] & EXPANDED:
                expanded[top + (within >> BLOCK_BITS), left + (within & BLOCK - 1)] = True
