"""Compiled loops of the layered search: an exact A* over pairs of a cell and a layer.

See `_kernels/astar` for the layout of cells and moves and `_kernels/layers` for what a layer is.
Costs are float64 in the grid's units of length: whole numbers without prices, so that lengths
are exact. A layer gets a slot, room for one state per cell, when it is first entered.

The queue has LEVELS rows of 1 << DIGIT_BITS buckets, last in first out (a multi-level bucket
queue: Denardo and Fox, Operations Research 1979). A key is f >> BUCKET_BITS; the row of an entry
is the highest digit in which its key differs from the last key taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from llm_astar_planner.search._kernels.astar import (
    BUCKET_BITS,
    CANONICAL_SUCCESSORS,
    CLOSED,
    EVERY_MOVE,
    EXHAUSTED,
    FOUND,
    LOWEST,
    NEED_SPACE,
    POLL_MASK,
    RUNNING,
    STEP_X,
    STEP_Y,
    STOPPED,
)
from llm_astar_planner.search._kernels.layers import (
    GOAL_BIT,
    Layers,
    Tables,
    advance_base,
    estimate,
    estimate_below_caps,
    layer_after,
    move_cost,
    price_of,
    rule_price,
    slot_of,
)

# One more way a call can end: a layer was entered for which there is no slot.
NEED_SLOT = 6
DIGIT_BITS = 10
LEVELS = 6
# Bits of a state's tag, above CLOSED and the move that led here. ENTERED: the layer changed on
# entering the cell, or it is the start.
SEEN = 16
ENTERED = 32
EXPANDED = 64

# Slots of the control array. C_SLOTS: the number of layers that have a slot.
(C_LAST, C_TOP, C_FREE, C_LIVE, C_EXPANSIONS, C_STORAGE, C_SLOTS, C_GOAL, C_GOAL_SLOT, C_SIZE) = (
    range(10)
)

_jit: Any = njit(cache=True, nogil=True)


class Queue(NamedTuple):
    """The open states: `heads` [LEVELS << DIGIT_BITS] and a pool of linked entries."""

    heads: NDArray[np.int32]
    keys: NDArray[np.int64]
    entries: NDArray[np.int64]  # state << 32 | next entry + 1


@_jit
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


@_jit
def refill(queue: Queue, last: int) -> int:
    """Spread the lowest bucket of the rows above the empty first one; return the new last key."""
    size = 1 << DIGIT_BITS
    for level in range(1, LEVELS):
        shift = DIGIT_BITS * level
        for digit in range((last >> shift & (size - 1)) + 1, size):
            entry = np.int64(queue.heads[level * size + digit])
            if entry:
                queue.heads[level * size + digit] = 0
                last = last >> (shift + DIGIT_BITS) << (shift + DIGIT_BITS) | digit << shift
                while entry:
                    item = queue.entries[entry - 1]
                    bucket = bucket_of(queue.keys[entry - 1], last)
                    queue.entries[entry - 1] = item >> 32 << 32 | queue.heads[bucket]
                    queue.heads[bucket] = entry
                    entry = item & 0xFFFFFFFF
                return last
    return last


@_jit
def begin(
    tables: Tables,
    layers: Layers,
    queue: Queue,
    costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    width: int,
    start: int,
    control: NDArray[np.int64],
    best: NDArray[np.float64],
) -> None:
    """Put the start on the queue. `best[0]` is the cost of the best path, inf without one."""
    control[:] = 0
    best[0] = np.inf
    bits = np.int64(tables.cell_bits[start])
    entered = bits & tables.rules.first_mask[0]
    base = advance_base(tables.groups, 0, 0, bits)
    slot_of(tables, layers, base, entered, 0)
    control[C_SLOTS] = 1
    if price_of(tables, start, entered) == np.inf:
        return
    costs[start] = 0.0
    tags[start] = SEEN | ENTERED
    control[C_STORAGE] = 1
    if bits & GOAL_BIT and base == tables.groups.base_group.size - 1:
        best[0] = 0.0
        control[C_GOAL] = start
        return
    rows = tables.groups.candidate_begin[base], tables.groups.candidate_begin[base + 1]
    x, y = start % width, start // width
    key = np.int64(estimate(tables.slopes, tables.offsets, *rows, x, y)) >> BUCKET_BITS
    control[C_LAST] = key
    queue.entries[0] = np.int64(start) << 32
    queue.keys[0] = key
    queue.heads[bucket_of(key, key)] = 1
    control[C_TOP] = 1
    control[C_LIVE] = 1


@_jit
def allowed_moves(tables: Tables, entered: int, width: int, cell: int, mask: int) -> int:
    """Return the moves of `mask` that no rule forbids."""
    allowed = 0
    while mask:
        move = LOWEST[mask]
        mask &= mask - 1
        other = cell + STEP_Y[move] * width + STEP_X[move]
        bits = np.int64(tables.cell_bits[other])
        now_entered = entered | bits & tables.rules.first_mask[0]
        if not bits & tables.rules.second_mask[0] or price_of(tables, other, now_entered) < np.inf:
            allowed |= 1 << move
    return allowed


@_jit
def advance(
    tables: Tables,
    layers: Layers,
    queue: Queue,
    costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    width: int,
    units: tuple[int, int],
    every_move: bool,
    control: NDArray[np.int64],
    best: NDArray[np.float64],
    quota: int,
    stop: NDArray[np.uint8],
) -> int:
    """Expand up to `quota` states; return how the call ended.

    `costs` and `tags` are [slots * cells], `units` the lengths of a straight and a diagonal move.
    `every_move` also tries the moves that uniform costs make pointless; graded costs and prices
    need it. NEED_SPACE: call again with a longer pool of entries, NEED_SLOT: with room for more
    layers; all must begin as before.
    """
    # Taken out of the tuples once: numba counts references at each access.
    moves, cell_surcharge, price = tables.moves, tables.cell_surcharge, tables.price
    cell_bits, slopes, offsets = tables.cell_bits, tables.slopes, tables.offsets
    candidate_begin = tables.groups.candidate_begin
    slot_base, slot_entered, slot_pending = layers.base, layers.entered, layers.pending
    slot_expansions, slot_measured = layers.expansions, layers.measured
    heads, keys, entries = queue.heads, queue.keys, queue.entries
    second_mask = tables.rules.second_mask[0]
    cells = moves.size
    graded = cell_surcharge.size > 0
    priced = price.size > 0
    capacity = min(tags.size // cells, layers.base.size)
    final = tables.groups.base_group.size - 1
    digits = (1 << DIGIT_BITS) - 1
    per_width = 1.0 / width
    per_cells = 1.0 / cells
    last = control[C_LAST]
    top = control[C_TOP]
    free: Any = control[C_FREE]
    live = control[C_LIVE]
    expansions = control[C_EXPANSIONS]
    storage = control[C_STORAGE]
    slots = control[C_SLOTS]
    limit = expansions + quota
    least: Any = best[0]
    status = RUNNING
    while status == RUNNING:
        while live > 0 and heads[last & digits] == 0:
            digit = last & digits
            while digit < digits and heads[digit] == 0:
                digit += 1
            last = refill(queue, last) if heads[digit] == 0 else last & ~digits | digit
        if live == 0 or last << BUCKET_BITS >= least:
            status = FOUND if least < np.inf else EXHAUSTED
            break
        if expansions >= limit:
            break
        if top + 8 > keys.size:
            status = NEED_SPACE
            break
        if slots + 8 > capacity and capacity < layers.slots.size:
            status = NEED_SLOT
            break
        bucket = last & digits
        entry: Any = np.int64(heads[bucket])
        item = entries[entry - 1]
        heads[bucket] = item & 0xFFFFFFFF
        entries[entry - 1] = free
        free = entry
        live -= 1
        state = item >> 32
        tag = tags[state]
        if tag & CLOSED:
            continue
        tags[state] = tag | CLOSED
        cost = costs[state]
        slot = np.int64((state + 0.5) * per_cells)
        cell = state - slot * cells
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        base = slot_base[slot]
        pending = slot_pending[slot]
        if base != final and slot_measured[slot]:
            f = cost + estimate_below_caps(tables, layers, slot, cost, x, y, units)
            if f >= least:
                continue
            key = np.int64(f) >> BUCKET_BITS
            if key > last:
                tags[state] = tag
                bucket = bucket_of(key, last)
                entry = free
                free = entries[entry - 1]
                entries[entry - 1] = state << 32 | heads[bucket]
                keys[entry - 1] = key
                heads[bucket] = entry
                live += 1
                continue
        tags[state] = tag | CLOSED | EXPANDED
        expansions += 1
        slot_expansions[slot] += 1
        if expansions & POLL_MASK == 0 and stop[0] != 0:
            status = STOPPED
        entered = slot_entered[slot]
        mask = np.int64(moves[cell])
        cell_price = np.float64(price[cell]) if priced else 0.0
        if second_mask:
            cell_price += rule_price(tables.rules, np.int64(cell_bits[cell]), entered)
            mask = np.int64(allowed_moves(tables, entered, width, cell, mask))
        row = EVERY_MOVE if every_move or tag & ENTERED else np.int64(tag & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | mask])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            other = other_y * width + other_x
            length = units[0] if move < 4 else units[1]
            other_units = length
            if graded:
                surcharge = np.int64(cell_surcharge[cell]) + cell_surcharge[other]
                other_units += length * surcharge >> 9
            other_cost = cost + other_units
            bits = np.int64(cell_bits[other])
            other_slot = slot
            other_base = base
            if bits & pending:
                other_base, other_entered = layer_after(tables, layers, slot, bits)
                other_slot = slot_of(tables, layers, other_base, other_entered, slots)
                slots = max(slots, other_slot + 1)
                layers.reached[slot] |= bits & pending
            if priced:
                other_cost += 0.5 * length * (cell_price + price[other])
            elif second_mask:
                other_cost += 0.5 * length * cell_price
            if bits & second_mask:
                rate = rule_price(tables.rules, bits, slot_entered[other_slot])
                other_cost += 0.5 * length * rate
            other_state = state - cell + other
            if other_slot != slot:
                other_state = other_slot * cells + other
            other_tag = tags[other_state]
            if other_tag == 0 or other_cost < costs[other_state]:
                first_row, last_row = candidate_begin[other_base], candidate_begin[other_base + 1]
                f = other_cost + estimate(slopes, offsets, first_row, last_row, other_x, other_y)
                if f < least:
                    storage += other_tag == 0
                    costs[other_state] = other_cost
                    tags[other_state] = SEEN | move | (ENTERED if other_slot != slot else 0)
                    if bits & GOAL_BIT and other_base == final:
                        least = other_cost
                        control[C_GOAL] = other
                        control[C_GOAL_SLOT] = other_slot
                        continue
                    key = max(np.int64(f) >> BUCKET_BITS, last)
                    bucket = bucket_of(key, last)
                    if free:
                        entry = free
                        free = entries[entry - 1]
                    else:
                        top += 1
                        entry = top
                    entries[entry - 1] = other_state << 32 | heads[bucket]
                    keys[entry - 1] = key
                    heads[bucket] = entry
                    live += 1
    control[C_LAST] = last
    control[C_TOP] = top
    control[C_FREE] = free
    control[C_LIVE] = live
    control[C_EXPANSIONS] = expansions
    control[C_STORAGE] = storage
    control[C_SLOTS] = slots
    best[0] = least
    return status


@_jit
def parent_slot(
    tables: Tables,
    layers: Layers,
    costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    slots: int,
    slot: int,
    cell: int,
    parent: int,
    length: int,
) -> int:
    """Return the slot in which the path was at the cell `parent` before it changed to `slot`."""
    bits = np.int64(tables.cell_bits[cell])
    chosen = -1
    least = np.inf
    for one in range(slots):
        state = one * tables.moves.size + parent
        if tags[state] and one != slot and bits & layers.pending[one]:
            base, entered = layer_after(tables, layers, one, bits)
            if base == layers.base[slot] and entered == layers.entered[slot]:
                cost = costs[state] + move_cost(
                    tables, parent, cell, length, layers.entered[one], layers.entered[slot]
                )
                if cost < least:
                    least = cost
                    chosen = one
    return chosen


@_jit
def trace(
    tables: Tables,
    layers: Layers,
    costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    width: int,
    units: tuple[int, int],
    start: int,
    control: NDArray[np.int64],
    path: NDArray[np.int32],
) -> int:
    """Write the best path's cells (x, y) at the end of `path`; return their count.

    If `path` is too short it holds the last cells, and the count is the length needed.
    """
    cell = control[C_GOAL]
    slot = control[C_GOAL_SLOT]
    count = 0
    row = len(path)
    while True:
        count += 1
        row -= 1
        y = cell // width
        x = cell - y * width
        if row >= 0:
            path[row, 0] = x
            path[row, 1] = y
        if cell == start and slot == 0:
            return count
        tag = tags[slot * tables.moves.size + cell]
        move = np.int64(tag & 7)
        parent = (y - STEP_Y[move]) * width + x - STEP_X[move]
        if tag & ENTERED:
            length = units[0] if move < 4 else units[1]
            slot = parent_slot(
                tables, layers, costs, tags, control[C_SLOTS], slot, cell, parent, length
            )
        cell = parent
