"""Compiled loops of the layered search: an exact A* over pairs of a cell and a layer.

A layer says which regions the path has visited. See `_kernels/astar` for the layout of cells and
moves. Costs are float64 in the grid's units of length: whole numbers without prices, so that
lengths are exact. A layer gets a slot, room for one state per cell, when it is first entered.

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

# One more way a call can end: a layer was entered for which there is no slot.
NEED_SLOT = 6
DIGIT_BITS = 10
LEVELS = 6
# Bits of a state's tag, above CLOSED and the move that led here. ENTERED: the layer changed on
# entering the cell, or it is the start.
SEEN = 16
ENTERED = 32
# Bits of `Tables.cell_bits`: regions are bits 0 to 15, then the goal cells and the cells of the
# second region of a `before`.
MAX_REGIONS = 16
GOAL_BIT = 1 << 16
SECOND_BIT = 1 << 17

# Slots of the control array. C_SLOTS: the number of layers that have a slot.
(C_LAST, C_TOP, C_FREE, C_LIVE, C_EXPANSIONS, C_STORAGE, C_SLOTS, C_GOAL, C_GOAL_SLOT, C_SIZE) = (
    range(10)
)

_jit: Any = njit(cache=True, nogil=True)


class Groups(NamedTuple):
    """The base layers: each is a group of visits and the set of regions visited of it.

    Sets of regions are masks of bits. The base layers of a group follow each other; the last
    base layer of all has every visit done. `candidates` lists the regions that may be visited
    next (MAX_REGIONS: the goal), for a base layer from `candidate_begin[base]` to the next.
    """

    masks: NDArray[np.int64]  # [groups]
    first_base: NDArray[np.int64]  # [groups + 1]
    base_group: NDArray[np.int64]  # [bases]
    base_visited: NDArray[np.int64]  # [bases]
    candidate_begin: NDArray[np.int64]  # [bases + 1]
    candidates: NDArray[np.int64]  # [n]


class Tables(NamedTuple):
    """What a query does not change: the grid and the rules of the layers.

    A layer is a base layer and the set of entered `first` regions of `before`. The least cost
    from cell (x, y) to the goal by way of candidate i is at least the maximum over d of
    slopes[d] . (x, y) + offsets[i, d].
    """

    moves: NDArray[np.uint8]  # [cells]
    cell_surcharge: NDArray[np.uint16]  # [cells] or empty
    price: NDArray[np.float32]  # [cells] or empty
    cell_bits: NDArray[np.uint32]  # [cells]
    seconds: NDArray[np.uint32]  # [cells] or empty: bit i: in the second region of before[i]
    before_first: NDArray[np.int64]  # [n]: the region that ends before[i]
    before_price: NDArray[np.float64]  # [n]
    first_mask: NDArray[np.int64]  # [1]: all `first` regions
    groups: Groups
    slopes: NDArray[np.float64]  # [directions, 2]
    offsets: NDArray[np.float64]  # [n, directions]


class Layers(NamedTuple):
    """The layers that have a slot."""

    slots: NDArray[np.int32]  # [bases << number of firsts], -1: none
    base: NDArray[np.int64]  # [slots]
    entered: NDArray[np.int64]  # [slots]
    pending: NDArray[np.int64]  # [slots]: regions that lead from here to another layer


class Queue(NamedTuple):
    """The open states: `heads` [LEVELS << DIGIT_BITS] and a pool of linked entries."""

    heads: NDArray[np.int32]
    keys: NDArray[np.int64]
    states: NDArray[np.int64]  # slot << 32 | cell
    following: NDArray[np.int32]


@_jit
def mark_region(
    mask: NDArray[np.bool_],
    blocked: NDArray[np.bool_],
    bit: int,
    cell_bits: NDArray[np.uint32],
    box: NDArray[np.int64],
) -> int:
    """Set a bit in the free cells of a region; return their number.

    Writes their bounding box: the lowest and highest x, the lowest and highest y.
    """
    height, width = mask.shape
    box[0], box[1], box[2], box[3] = width, -1, height, -1
    count = 0
    for y in range(height):
        for x in range(width):
            if mask[y, x] and not blocked[y, x]:
                cell_bits[y * width + x] |= np.uint32(bit)
                count += 1
                box[0] = min(box[0], x)
                box[1] = max(box[1], x)
                box[2] = min(box[2], y)
                box[3] = y
    return count


@_jit
def pack(bits: int, mask: int) -> int:
    """Return the bits of `bits` at the places set in `mask`, moved together."""
    packed = 0
    place = 0
    for region in range(MAX_REGIONS):
        if mask >> region & 1:
            packed |= (bits >> region & 1) << place
            place += 1
    return packed


@_jit
def fill_bases(groups: Groups) -> None:
    """Write the group and the visited regions of each base layer."""
    for group in range(groups.masks.size):
        for packed in range(groups.first_base[group + 1] - groups.first_base[group]):
            base = groups.first_base[group] + packed
            groups.base_group[base] = group
            place = 0
            for region in range(MAX_REGIONS):
                if groups.masks[group] >> region & 1:
                    groups.base_visited[base] |= (packed >> place & 1) << region
                    place += 1
    groups.base_group[-1] = groups.masks.size


@_jit
def advance_base(tables: Tables, group: int, visited: int, bits: int) -> int:
    """Return the base layer after entering a cell of the regions `bits`."""
    groups = tables.groups.masks.size
    while group < groups:
        visited |= bits & tables.groups.masks[group]
        if visited != tables.groups.masks[group]:
            return tables.groups.first_base[group] + pack(visited, tables.groups.masks[group])
        group += 1
        visited = 0
    return tables.groups.first_base[groups]


@_jit
def layer_after(tables: Tables, layers: Layers, slot: int, bits: int) -> tuple[int, int]:
    """Return base layer and entered regions after entering a cell of the regions `bits`."""
    base = layers.base[slot]
    group = tables.groups.base_group[base]
    entered = layers.entered[slot] | bits & tables.first_mask[0]
    return advance_base(tables, group, tables.groups.base_visited[base], bits), entered


@_jit
def slot_of(tables: Tables, layers: Layers, base: int, entered: int, slots: int) -> int:
    """Return the slot of a layer: the next one, number `slots`, if it has none yet."""
    first_mask = tables.first_mask[0]
    places = 0
    for region in range(MAX_REGIONS):
        places += first_mask >> region & 1
    layer = base << places | pack(entered, first_mask)
    if layers.slots[layer] >= 0:
        return int(layers.slots[layer])
    layers.slots[layer] = slots
    group = tables.groups.base_group[base]
    pending = first_mask & ~entered
    if group < tables.groups.masks.size:
        pending |= tables.groups.masks[group] & ~tables.groups.base_visited[base]
    layers.base[slots] = base
    layers.entered[slots] = entered
    layers.pending[slots] = pending
    return slots


@_jit
def price_of(tables: Tables, cell: int, entered: int) -> float:
    """Return the price of a cell while the regions `entered` were entered; inf if forbidden."""
    price = np.float64(tables.price[cell]) if tables.price.size else 0.0
    if tables.seconds.size:
        clauses = tables.seconds[cell]
        for index in range(tables.before_first.size):
            if clauses >> index & 1 and not entered >> tables.before_first[index] & 1:
                price += tables.before_price[index]
    return price


@_jit
def fill_offsets(tables: Tables, boxes: NDArray[np.float64]) -> None:
    """Fill `tables.offsets` from the bounding boxes [regions + goal, 4] of the regions.

    The octile length of the shortest chain through boxes is a linear program. Its dual variables,
    one slope for each stretch, have coordinates of a few values only (those of `slopes`), so the
    maximum over these is exact for boxes on an empty plane; walls only make paths longer.
    """
    slopes = tables.slopes
    count = len(slopes)
    for base in range(tables.groups.base_group.size - 1, -1, -1):
        for row in range(
            tables.groups.candidate_begin[base], tables.groups.candidate_begin[base + 1]
        ):
            region = tables.groups.candidates[row]
            x0, x1, y0, y1 = boxes[region]
            if region == MAX_REGIONS:
                for one in range(count):
                    a_x, a_y = -slopes[one, 0], -slopes[one, 1]
                    tables.offsets[row, one] = min(a_x * x0, a_x * x1) + min(a_y * y0, a_y * y1)
                continue
            group = tables.groups.base_group[base]
            after = advance_base(tables, group, tables.groups.base_visited[base], 1 << region)
            tables.offsets[row, :] = np.inf
            for next_row in range(
                tables.groups.candidate_begin[after], tables.groups.candidate_begin[after + 1]
            ):
                for one in range(count):
                    highest = -np.inf
                    for other in range(count):
                        a_x = slopes[other, 0] - slopes[one, 0]
                        a_y = slopes[other, 1] - slopes[one, 1]
                        inside = min(a_x * x0, a_x * x1) + min(a_y * y0, a_y * y1)
                        highest = max(highest, inside + tables.offsets[next_row, other])
                    tables.offsets[row, one] = min(tables.offsets[row, one], highest)


@_jit
def estimate(tables: Tables, base: int, x: int, y: int) -> float:
    """Return a lower bound on the cost from a cell in a base layer to the goal."""
    least = np.inf
    for row in range(tables.groups.candidate_begin[base], tables.groups.candidate_begin[base + 1]):
        most = 0.0
        for one in range(len(tables.slopes)):
            bound = (
                tables.slopes[one, 0] * x + tables.slopes[one, 1] * y + tables.offsets[row, one]
            )
            most = max(most, bound)
        least = min(least, most)
    return least


@_jit
def bucket_of(key: int, last: int) -> int:
    """Return the bucket of a key, not below `last`, the last key taken."""
    level = 0
    while (key ^ last) >> (DIGIT_BITS * (level + 1)):
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
                    following = np.int64(queue.following[entry - 1])
                    bucket = bucket_of(queue.keys[entry - 1], last)
                    queue.following[entry - 1] = queue.heads[bucket]
                    queue.heads[bucket] = entry
                    entry = following
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
    bits = tables.cell_bits[start]
    entered = np.int64(bits) & tables.first_mask[0]
    base = advance_base(tables, 0, 0, np.int64(bits))
    slot_of(tables, layers, base, entered, 0)
    control[C_SLOTS] = 1
    if price_of(tables, start, entered) == np.inf:
        return
    costs[start] = 0.0
    tags[start] = SEEN | ENTERED
    control[C_STORAGE] = 1
    if bits & GOAL_BIT and tables.groups.base_group[base] == tables.groups.masks.size:
        best[0] = 0.0
        control[C_GOAL] = start
        return
    key = np.int64(estimate(tables, base, start % width, start // width)) >> BUCKET_BITS
    control[C_LAST] = key
    queue.states[0] = start
    queue.keys[0] = key
    queue.following[0] = 0
    queue.heads[bucket_of(key, key)] = 1
    control[C_TOP] = 1
    control[C_LIVE] = 1


@_jit
def advance(
    tables: Tables,
    layers: Layers,
    queue: Queue,
    costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    width: int,
    straight: int,
    diagonal: int,
    every_move: bool,
    control: NDArray[np.int64],
    best: NDArray[np.float64],
    quota: int,
    stop: NDArray[np.uint8],
) -> int:
    """Expand up to `quota` states; return how the call ended.

    `costs` and `tags` are [slots * cells]. `every_move` also tries the moves that uniform costs
    make pointless; graded costs and prices need it. NEED_SPACE: call again with a longer pool of
    entries, NEED_SLOT: with room for more layers; all must begin as before.
    """
    cells = tables.moves.size
    graded = tables.cell_surcharge.size > 0
    ruled = tables.seconds.size > 0
    priced = tables.price.size > 0 or ruled
    groups = tables.groups.masks.size
    capacity = costs.size // cells
    digits = (1 << DIGIT_BITS) - 1
    per_width = 1.0 / width
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
        while live > 0 and queue.heads[last & digits] == 0:
            digit = last & digits
            while digit < digits and queue.heads[digit] == 0:
                digit += 1
            last = refill(queue, last) if queue.heads[digit] == 0 else last & ~digits | digit
        if live == 0 or last << BUCKET_BITS >= least:
            status = FOUND if least < np.inf else EXHAUSTED
            break
        if expansions >= limit:
            break
        if top + 8 > queue.keys.size:
            status = NEED_SPACE
            break
        if slots + 8 > capacity and capacity < layers.slots.size:
            status = NEED_SLOT
            break
        bucket = last & digits
        entry: Any = np.int64(queue.heads[bucket])
        queue.heads[bucket] = queue.following[entry - 1]
        queue.following[entry - 1] = free
        free = entry
        live -= 1
        slot = queue.states[entry - 1] >> 32
        cell = queue.states[entry - 1] & 0xFFFFFFFF
        state = slot * cells + cell
        tag = tags[state]
        if tag & CLOSED:
            continue
        tags[state] = tag | CLOSED
        expansions += 1
        if expansions & POLL_MASK == 0 and stop[0] != 0:
            status = STOPPED
        cost = costs[state]
        base = layers.base[slot]
        entered = layers.entered[slot]
        pending = layers.pending[slot]
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        price = price_of(tables, cell, entered) if priced else 0.0
        mask = np.int64(tables.moves[cell])
        if ruled:
            allowed = 0
            while mask:
                move = LOWEST[mask]
                mask &= mask - 1
                other = cell + STEP_Y[move] * width + STEP_X[move]
                bits = np.int64(tables.cell_bits[other])
                now = entered | bits & tables.first_mask[0]
                if not bits & SECOND_BIT or price_of(tables, other, now) < np.inf:
                    allowed |= 1 << move
            mask = np.int64(allowed)
        row = EVERY_MOVE if every_move or tag & ENTERED else np.int64(tag & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | mask])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            other = other_y * width + other_x
            bits = np.int64(tables.cell_bits[other])
            other_slot = slot
            other_base = base
            if bits & pending:
                other_base, now_entered = layer_after(tables, layers, slot, bits)
                other_slot = slot_of(tables, layers, other_base, now_entered, slots)
                slots = max(slots, other_slot + 1)
            length = straight if move < 4 else diagonal
            units = length
            if graded:
                surcharge = np.int64(tables.cell_surcharge[cell]) + tables.cell_surcharge[other]
                units += length * surcharge >> 9
            other_cost = cost + units
            if priced:
                other_price = price_of(tables, other, layers.entered[other_slot])
                other_cost += length * 0.5 * (price + other_price)
            other_state = other_slot * cells + other
            new = tags[other_state] == 0
            if new or other_cost < costs[other_state]:
                f = other_cost + estimate(tables, other_base, other_x, other_y)
                if f < least:
                    storage += new
                    costs[other_state] = other_cost
                    tags[other_state] = SEEN | move | (ENTERED if other_slot != slot else 0)
                    if bits & GOAL_BIT and tables.groups.base_group[other_base] == groups:
                        least = other_cost
                        control[C_GOAL] = other
                        control[C_GOAL_SLOT] = other_slot
                        continue
                    key = max(np.int64(f) >> BUCKET_BITS, last)
                    bucket = bucket_of(key, last)
                    if free:
                        entry = free
                        free = np.int64(queue.following[entry - 1])
                    else:
                        top += 1
                        entry = top
                    queue.states[entry - 1] = other_slot << 32 | other
                    queue.keys[entry - 1] = key
                    queue.following[entry - 1] = queue.heads[bucket]
                    queue.heads[bucket] = entry
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
def move_cost(
    tables: Tables, cell: int, other: int, length: int, entered: int, now_entered: int
) -> float:
    """Return the cost of a move between the layers of two sets of entered regions."""
    units = length
    if tables.cell_surcharge.size:
        surcharge = np.int64(tables.cell_surcharge[cell]) + tables.cell_surcharge[other]
        units += length * surcharge >> 9
    prices = price_of(tables, cell, entered) + price_of(tables, other, now_entered)
    return units + length * 0.5 * prices


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
    straight: int,
    diagonal: int,
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
            length = straight if move < 4 else diagonal
            slot = parent_slot(
                tables, layers, costs, tags, control[C_SLOTS], slot, cell, parent, length
            )
        cell = parent


@_jit
def add_expanded(tags: NDArray[np.uint8], slots: int, expanded: NDArray[np.bool_]) -> None:
    """Set `expanded` [height, width] where a state of any layer was expanded."""
    flat = expanded.reshape(-1)
    for slot in range(slots):
        for cell in range(flat.size):
            if tags[slot * flat.size + cell] & CLOSED:
                flat[cell] = True
