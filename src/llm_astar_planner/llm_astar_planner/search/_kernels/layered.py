"""Compiled loops of the layered search: an exact A* over pairs of a cell and a layer.

See `_kernels/astar` for the layout of cells and moves. A layer says which regions a path has
visited; what follows first knows visits, rules, prices and bounds, then comes the search.
Costs are float64 in the grid's units of length: whole numbers without prices, so that lengths
are exact. A layer gets a slot, room for one state per cell, when it is first entered.

The queue has LEVELS rows of 1 << DIGIT_BITS buckets, last in first out (a multi-level bucket
queue: Denardo and Fox, Operations Research 1979). A key is f >> BUCKET_BITS; the row of an entry
is the highest digit in which its key differs from the last key taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import STEP_X, STEP_Y, Cells, octile, pop, push
from llm_astar_planner.search.kernel_cache import jit

CANONICAL_SUCCESSORS, LOWEST = shared.CANONICAL_SUCCESSORS, shared.LOWEST
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
# Bits of `Tables.cell_bits`: regions are bits 0 to 15, then the goal cells.
MAX_REGIONS = 16
GOAL_BIT = 1 << 16
# A cost above all real ones, for cells in pockets.
UNREACHED = 1e300
# The number of slopes in `Tables`, a constant so that the compiler unrolls the loop over them.
SLOPES = 16


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


class Rules(NamedTuple):
    """The rules `before`: entering `firsts[i]` ends the `prices[i]` of the cells of `seconds[i]`.

    `first_mask` and `second_mask` have one element each, the set of these regions.
    """

    firsts: NDArray[np.int64]  # [n]
    seconds: NDArray[np.int64]  # [n]
    prices: NDArray[np.float64]  # [n]
    first_mask: NDArray[np.int64]
    second_mask: NDArray[np.int64]


class Tables(NamedTuple):
    """What a query does not change: the grid and what the layers mean.

    A layer is a base layer and the set of `firsts` entered. The least cost from cell (x, y) to
    the goal by way of candidate i is at least the maximum over d of
    slopes[0, d] * x + slopes[1, d] * y + offsets[i, d].
    """

    grid: Cells
    price: NDArray[np.float32]  # [cells] or empty
    cell_bits: NDArray[np.uint32]  # [cells]
    groups: Groups
    rules: Rules
    boxes: NDArray[np.int64]  # [MAX_REGIONS + 1, 4]: x0, x1, y0, y1 of the regions and the goals
    slopes: NDArray[np.float64]  # [2, SLOPES]
    offsets: NDArray[np.float64]  # [candidates, SLOPES]


class States(NamedTuple):
    """What is known of each pair of a slot and a cell, slot by slot."""

    costs: NDArray[np.float64]  # [slots * cells]
    tags: NDArray[np.uint8]  # [slots * cells], 0: never seen


class Layers(NamedTuple):
    """The layers that have a slot, room for one state per cell."""

    slots: NDArray[np.int32]  # [bases << number of firsts], -1: none
    base: NDArray[np.int64]  # [slots]
    entered: NDArray[np.int64]  # [slots]
    pending: NDArray[np.int64]  # [slots]: regions that lead from here to another layer
    reached: NDArray[np.int64]  # [slots]: pending regions that were entered
    expansions: NDArray[np.int64]  # [slots]
    measured: NDArray[np.int64]  # [slots]: expansions when its caps were measured
    # [slots, MAX_REGIONS]: no path that enters a pending region at such a cost is needed
    caps: NDArray[np.float64]


class Queue(NamedTuple):
    """The open states: `heads` [LEVELS << DIGIT_BITS] and a pool of linked entries."""

    heads: NDArray[np.int32]
    keys: NDArray[np.int64]
    entries: NDArray[np.int64]  # state << 32 | next entry + 1


class Search(NamedTuple):
    """A search: what it is for, and what it keeps from call to call."""

    tables: Tables
    layers: Layers
    states: States
    queue: Queue
    control: NDArray[np.int64]  # [C_SIZE]
    best: NDArray[np.float64]  # the cost of the best path, inf without one; one element


@jit
def pack(bits: int, mask: int) -> int:
    """Return the bits of `bits` at the places set in `mask`, moved together."""
    packed = 0
    place = 0
    for region in range(MAX_REGIONS):
        if mask >> region & 1:
            packed |= (bits >> region & 1) << place
            place += 1
    return packed


@jit
def advance_base(groups: Groups, group: int, visited: int, bits: int) -> int:
    """Return the base layer after entering a cell of the regions `bits`."""
    while group < groups.masks.size:
        visited |= bits & groups.masks[group]
        if visited != groups.masks[group]:
            return groups.first_base[group] + pack(visited, groups.masks[group])
        group += 1
        visited = 0
    return groups.first_base[group]


@jit
def layer_after(tables: Tables, layers: Layers, slot: int, bits: int) -> tuple[int, int]:
    """Return base layer and entered regions after entering a cell of the regions `bits`."""
    groups = tables.groups
    base = layers.base[slot]
    entered = layers.entered[slot] | bits & tables.rules.first_mask[0]
    base = advance_base(groups, groups.base_group[base], groups.base_visited[base], bits)
    return base, entered


@jit
def layer_number(tables: Tables, base: int, entered: int) -> int:
    """Return the index in `Layers.slots` of a base layer with the regions `entered`."""
    return pack(entered, tables.rules.first_mask[0]) * tables.groups.base_group.size + base


@jit
def slot_of(tables: Tables, layers: Layers, base: int, entered: int, slots: int) -> int:
    """Return the slot of a layer: the next one, number `slots`, if it has none yet."""
    layer = layer_number(tables, base, entered)
    if layers.slots[layer] >= 0:
        return int(layers.slots[layer])
    layers.slots[layer] = slots
    group = tables.groups.base_group[base]
    pending = tables.rules.first_mask[0] & ~entered
    if group < tables.groups.masks.size:
        pending |= tables.groups.masks[group] & ~tables.groups.base_visited[base]
    layers.base[slots] = base
    layers.entered[slots] = entered
    layers.pending[slots] = pending
    layers.caps[slots, :] = np.inf
    return slots


@jit
def rule_price(rules: Rules, bits: int, entered: int) -> float:
    """Return the price by the rules of a cell of the regions `bits`; inf if it is forbidden."""
    price = 0.0
    for index in range(rules.firsts.size):
        if bits >> rules.seconds[index] & 1 and not entered >> rules.firsts[index] & 1:
            price += rules.prices[index]
    return price


@jit
def price_of(tables: Tables, cell: int, entered: int) -> float:
    """Return the price of a cell while the regions `entered` were entered; inf if forbidden."""
    price = np.float64(tables.price[cell]) if tables.price.size else 0.0
    return price + rule_price(tables.rules, np.int64(tables.cell_bits[cell]), entered)


@jit
def move_cost(
    tables: Tables, cell: int, other: int, length: int, entered: int, now_entered: int
) -> float:
    """Return the cost of a move of `length` units, by the regions entered at its two ends."""
    units = length
    if tables.grid.cell_surcharge.size:
        surcharge = np.int64(tables.grid.cell_surcharge[cell]) + tables.grid.cell_surcharge[other]
        units += length * surcharge >> 9
    prices = price_of(tables, cell, entered) + price_of(tables, other, now_entered)
    return units + 0.5 * length * prices


@jit
def spread(
    tables: Tables,
    window: NDArray[np.int64],
    costs: NDArray[np.float64],
    ring: NDArray[np.int64],
    queued: NDArray[np.bool_],
    count: int,
) -> bool:
    """Lower the costs in a window to those of paths inside it: a label-correcting search.

    The window is x0, x1, y0, y1; `costs`, `queued` and `ring` (one longer) have an element per
    cell of it, and the first `count` elements of `ring` are the queue. Prices are those before
    any region was entered, the highest. Returns whether paths may leave the window, or enter
    cells that are forbidden at first.
    """
    moves, _, width, straight, diagonal = tables.grid
    columns = window[1] - window[0] + 1
    size = costs.size
    head, tail = 0, count
    leaves = False
    while head != tail:
        near = ring[head]
        head = head + 1 if head < size else 0
        queued[near] = False
        y = window[2] + near // columns
        x = window[0] + near % columns
        cell = y * width + x
        mask = np.int64(moves[cell])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            if not (window[0] <= other_x <= window[1] and window[2] <= other_y <= window[3]):
                leaves = True
                continue
            length = straight if move < 4 else diagonal
            other_cell = other_y * width + other_x
            cost = costs[near] + move_cost(tables, cell, other_cell, length, 0, 0)
            leaves |= cost == np.inf
            other = near + STEP_Y[move] * columns + STEP_X[move]
            if cost < costs[other]:
                costs[other] = cost
                if not queued[other]:
                    queued[other] = True
                    ring[tail] = other
                    tail = tail + 1 if tail < size else 0
    return leaves


@jit
def region_cap(search: Search, slot: int, region: int, margin: int) -> float:
    """Return a cost at which entering a pending region from a layer is of no use any more.

    By then every cell of the region is reached by way of the cells entered so far and of paths
    that leave the region's bounding box by at most `margin` cells. Cells in a pocket do not
    count, since no path reaches them. inf if other cells are not reached.
    """
    tables, layers, states = search.tables, search.layers, search.states
    width, cells = tables.grid.width, tables.grid.moves.size
    box = tables.boxes[region]
    window = box.copy()
    window[::2] = np.maximum(box[::2] - margin, 0)
    window[1] = min(box[1] + margin, width - 1)
    window[3] = min(box[3] + margin, cells // width - 1)
    columns = window[1] - window[0] + 1
    size = columns * (window[3] - window[2] + 1)
    costs = np.full(size, np.inf)
    ring = np.empty(size + 1, dtype=np.int64)
    queued = np.zeros(size, dtype=np.bool_)
    inside = np.empty((size, 2), dtype=np.int64)
    count = 0
    queue = 0
    for y in range(box[2], box[3] + 1):
        for x in range(box[0], box[1] + 1):
            cell = y * width + x
            bits = np.int64(tables.cell_bits[cell])
            if bits >> region & 1:
                near = (y - window[2]) * columns + x - window[0]
                inside[count] = near, cell
                count += 1
                base, entered = layer_after(tables, layers, slot, bits)
                after = np.int64(layers.slots[layer_number(tables, base, entered)])
                if after >= 0 and states.tags[after * cells + cell]:
                    costs[near] = states.costs[after * cells + cell]
                    ring[queue] = near
                    queued[near] = True
                    queue += 1
    spread(tables, window, costs, ring, queued, queue)
    cap = 0.0
    for index in range(count):
        near = inside[index, 0]
        if costs[near] == np.inf:
            costs[near] = UNREACHED
            ring[0] = near
            if spread(tables, window, costs, ring, queued, 1):
                return np.inf
        elif costs[near] < UNREACHED:
            cap = max(cap, costs[near])
    return cap


@jit
def measure_caps(search: Search, margin: int, patience: int) -> None:
    """Measure the caps of layers whose search went on for `patience` times the work of that."""
    tables, layers = search.tables, search.layers
    for slot in range(search.control[C_SLOTS]):
        fresh = layers.expansions[slot] - layers.measured[slot]
        work = 0
        for region in range(MAX_REGIONS):
            if layers.reached[slot] >> region & 1:
                box = tables.boxes[region]
                work += (box[1] - box[0] + 2 * margin) * (box[3] - box[2] + 2 * margin)
        if work and fresh >= patience * work:
            layers.measured[slot] = layers.expansions[slot]
            for region in range(MAX_REGIONS):
                if layers.reached[slot] >> region & 1:
                    cap = region_cap(search, slot, region, margin)
                    layers.caps[slot, region] = min(layers.caps[slot, region], cap)


@jit
def fill_offsets(tables: Tables) -> None:
    """Fill `tables.offsets`, from the last base layer to the first.

    The least octile length of a chain through boxes is a linear program. Its dual has one slope
    for each stretch, and an optimum in which their coordinates are among the few values that
    `tables.slopes` combines. So the maximum over these is the least length on an empty plane,
    but for a goal that is a box, where it may be less; walls only make paths longer.
    """
    slopes = tables.slopes
    groups = tables.groups
    for base in range(groups.base_group.size - 1, -1, -1):
        for row in range(groups.candidate_begin[base], groups.candidate_begin[base + 1]):
            region = groups.candidates[row]
            x0, x1, y0, y1 = tables.boxes[region]
            if region == MAX_REGIONS:
                for one in range(SLOPES):
                    a_x, a_y = -slopes[0, one], -slopes[1, one]
                    tables.offsets[row, one] = min(a_x * x0, a_x * x1) + min(a_y * y0, a_y * y1)
                continue
            group = groups.base_group[base]
            after = advance_base(groups, group, groups.base_visited[base], 1 << region)
            tables.offsets[row, :] = np.inf
            for one in range(SLOPES):
                for next_row in range(
                    groups.candidate_begin[after], groups.candidate_begin[after + 1]
                ):
                    highest = -np.inf
                    for other in range(SLOPES):
                        a_x = slopes[0, other] - slopes[0, one]
                        a_y = slopes[1, other] - slopes[1, one]
                        inside = min(a_x * x0, a_x * x1) + min(a_y * y0, a_y * y1)
                        highest = max(highest, inside + tables.offsets[next_row, other])
                    tables.offsets[row, one] = min(tables.offsets[row, one], highest)


@jit
def estimate(
    slopes: NDArray[np.float64],
    offsets: NDArray[np.float64],
    first_row: int,
    last_row: int,
    x: int,
    y: int,
) -> float:
    """Return a lower bound on the cost from a cell to the goal by way of candidates.

    These are the rows of `offsets` from the first to before the last. Takes the maximum over the
    first EVALUATED slopes, written out for speed; the others only matter on the way.
    """
    straight_x, straight_y = slopes[0, 0] * x, slopes[0, 0] * y
    extra_x, extra_y = slopes[1, 0] * x, slopes[1, 0] * y
    least = np.inf
    for row in range(first_row, last_row):
        east = straight_x + max(extra_y + offsets[row, 0], offsets[row, 1] - extra_y)
        west = max(extra_y + offsets[row, 2], offsets[row, 3] - extra_y) - straight_x
        up = straight_y + max(extra_x + offsets[row, 4], offsets[row, 5] - extra_x)
        down = max(extra_x + offsets[row, 6], offsets[row, 7] - extra_x) - straight_y
        level = max(straight_x + offsets[row, 8], offsets[row, 9] - straight_x)
        plumb = max(straight_y + offsets[row, 10], offsets[row, 11] - straight_y)
        least = min(least, max(east, west, up, down, level, plumb, 0.0))
    return least


@jit
def box_distance(tables: Tables, region: int, x: int, y: int) -> int:
    """Return the octile distance in units from a cell to the bounding box of a region."""
    boxes, straight, diagonal = tables.boxes, tables.grid.straight, tables.grid.diagonal
    delta_x = max(boxes[region, 0] - x, x - boxes[region, 1], 0)
    delta_y = max(boxes[region, 2] - y, y - boxes[region, 3], 0)
    return octile(straight, diagonal - straight, delta_x, delta_y)


@jit
def estimate_below_caps(
    tables: Tables, layers: Layers, slot: int, cost: float, x: int, y: int
) -> float:
    """Return a lower bound on the cost to the goal of the paths from a cell that are needed.

    These enter a pending region below its cap; `cost` is that of the cell. inf: none is needed.
    """
    base = layers.base[slot]
    others = layers.pending[slot]
    least = np.inf
    for row in range(tables.groups.candidate_begin[base], tables.groups.candidate_begin[base + 1]):
        region = tables.groups.candidates[row]
        others &= ~(1 << region)
        if cost + box_distance(tables, region, x, y) < layers.caps[slot, region]:
            bound = estimate(tables.slopes, tables.offsets, row, row + 1, x, y)
            least = min(least, bound)
    # A path may enter these to end a rule, before it enters one of the others.
    for region in range(MAX_REGIONS):
        if others >> region & 1:
            way = box_distance(tables, region, x, y)
            if cost + way < layers.caps[slot, region]:
                return 0.0
    return least


@jit
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


@jit
def begin(search: Search, start: int) -> None:
    """Put the start on the queue."""
    tables, layers, states, queue, control, best = search
    control[:] = 0
    best[0] = np.inf
    bits = np.int64(tables.cell_bits[start])
    entered = bits & tables.rules.first_mask[0]
    base = advance_base(tables.groups, 0, 0, bits)
    slot_of(tables, layers, base, entered, 0)
    control[C_SLOTS] = 1
    if price_of(tables, start, entered) == np.inf:
        return
    states.costs[start] = 0.0
    states.tags[start] = SEEN | ENTERED
    control[C_STORAGE] = 1
    if bits & GOAL_BIT and base == tables.groups.base_group.size - 1:
        best[0] = 0.0
        control[C_GOAL] = start
        return
    rows = tables.groups.candidate_begin[base], tables.groups.candidate_begin[base + 1]
    x, y = start % tables.grid.width, start // tables.grid.width
    key = np.int64(estimate(tables.slopes, tables.offsets, *rows, x, y)) >> shared.BUCKET_BITS
    control[C_LAST] = key
    queue.entries[0] = np.int64(start) << 32
    queue.keys[0] = key
    queue.heads[bucket_of(key, key)] = 1
    control[C_TOP] = control[C_LIVE] = 1


@jit
def allowed_moves(tables: Tables, entered: int, cell: int, mask: int) -> int:
    """Return the moves of `mask` that no rule forbids."""
    allowed = 0
    while mask:
        move = LOWEST[mask]
        mask &= mask - 1
        other = cell + STEP_Y[move] * tables.grid.width + STEP_X[move]
        bits = np.int64(tables.cell_bits[other])
        now_entered = entered | bits & tables.rules.first_mask[0]
        if not bits & tables.rules.second_mask[0] or price_of(tables, other, now_entered) < np.inf:
            allowed |= 1 << move
    return allowed


@jit
def advance(
    tables: Tables,
    layers: Layers,
    states: States,
    queue: Queue,
    control: NDArray[np.int64],
    best: NDArray[np.float64],
    every_move: bool,
    quota: int,
    stop: NDArray[np.uint8],
) -> int:
    """Expand up to `quota` states; return how the call ended.

    `every_move` also tries the moves that uniform costs make pointless; graded costs and prices
    need it. NEED_SPACE: call again with a longer pool of entries, NEED_SLOT: with room for more
    layers; all must begin as before.
    """
    # Taken out of the tuples once: numba counts references at each access.
    moves, cell_surcharge, width, straight, diagonal = tables.grid
    costs, tags = states
    price = tables.price
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
    last, top, live = control[C_LAST], control[C_TOP], control[C_LIVE]
    free: Any = control[C_FREE]
    expansions, storage, slots = control[C_EXPANSIONS], control[C_STORAGE], control[C_SLOTS]
    limit = expansions + quota
    least: Any = best[0]
    status = shared.RUNNING
    while status == shared.RUNNING:
        while live > 0 and heads[last & digits] == 0:
            digit = last & digits
            while digit < digits and heads[digit] == 0:
                digit += 1
            last = refill(queue, last) if heads[digit] == 0 else last & ~digits | digit
        if live == 0 or last << shared.BUCKET_BITS >= least:
            status = shared.FOUND if least < np.inf else shared.EXHAUSTED
            break
        if expansions >= limit:
            break
        if top + 8 > keys.size:
            status = shared.NEED_SPACE
            break
        if slots + 8 > capacity and capacity < layers.slots.size:
            status = NEED_SLOT
            break
        state, free = pop(entries, heads, last & digits, free)
        live -= 1
        tag = tags[state]
        if tag & shared.CLOSED:
            continue
        tags[state] = tag | shared.CLOSED
        cost = costs[state]
        slot = np.int64((state + 0.5) * per_cells)
        cell = state - slot * cells
        y = np.int64((cell + 0.5) * per_width)
        x = cell - y * width
        base = slot_base[slot]
        pending = slot_pending[slot]
        if base != final and slot_measured[slot]:
            f = cost + estimate_below_caps(tables, layers, slot, cost, x, y)
            if f >= least:
                continue
            key = np.int64(f) >> shared.BUCKET_BITS
            if key > last:
                tags[state] = tag
                bucket = bucket_of(key, last)
                entry, free, top = push(entries, heads, bucket, state << 32, free, top)
                keys[entry - 1] = key
                live += 1
                continue
        tags[state] = tag | shared.CLOSED | EXPANDED
        expansions += 1
        slot_expansions[slot] += 1
        if expansions & shared.POLL_MASK == 0 and stop[0] != 0:
            status = shared.STOPPED
        entered = slot_entered[slot]
        mask = np.int64(moves[cell])
        cell_price = np.float64(price[cell]) if priced else 0.0
        if second_mask:
            cell_price += rule_price(tables.rules, np.int64(cell_bits[cell]), entered)
            mask = np.int64(allowed_moves(tables, entered, cell, mask))
        row = shared.EVERY_MOVE if every_move or tag & ENTERED else np.int64(tag & 7) << 8
        mask = np.int64(CANONICAL_SUCCESSORS[row | mask])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            other = other_y * width + other_x
            length = straight if move < 4 else diagonal
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
                    key = max(np.int64(f) >> shared.BUCKET_BITS, last)
                    bucket = bucket_of(key, last)
                    entry, free, top = push(entries, heads, bucket, other_state << 32, free, top)
                    keys[entry - 1] = key
                    live += 1
    control[C_LAST], control[C_TOP], control[C_LIVE], control[C_FREE] = last, top, live, free
    control[C_EXPANSIONS], control[C_STORAGE], control[C_SLOTS] = expansions, storage, slots
    best[0] = least
    return status


@jit
def parent_slot(search: Search, slot: int, cell: int, parent: int, length: int) -> int:
    """Return the slot in which the path was at the cell `parent` before it changed to `slot`."""
    tables, layers, states = search.tables, search.layers, search.states
    bits = np.int64(tables.cell_bits[cell])
    chosen = -1
    least = np.inf
    for one in range(search.control[C_SLOTS]):
        state = one * tables.grid.moves.size + parent
        if states.tags[state] and one != slot and bits & layers.pending[one]:
            base, entered = layer_after(tables, layers, one, bits)
            if base == layers.base[slot] and entered == layers.entered[slot]:
                cost = states.costs[state] + move_cost(
                    tables, parent, cell, length, layers.entered[one], layers.entered[slot]
                )
                if cost < least:
                    least = cost
                    chosen = one
    return chosen


@jit
def trace(search: Search, start: int, path: NDArray[np.int32]) -> tuple[int]:
    """Write the best path's cells (x, y) at the end of `path`; return their count.

    If `path` is too short it holds the last cells, and the count is the length needed.
    """
    moves, _, width, straight, diagonal = search.tables.grid
    tags, control = search.states.tags, search.control
    cell, slot = control[C_GOAL], control[C_GOAL_SLOT]
    count = 0
    row = len(path)
    while True:
        count += 1
        row -= 1
        y = cell // width
        x = cell - y * width
        if row >= 0:
            path[row, 0], path[row, 1] = x, y
        if cell == start and slot == 0:
            return (count,)
        tag = tags[slot * moves.size + cell]
        move = np.int64(tag & 7)
        parent = (y - STEP_Y[move]) * width + x - STEP_X[move]
        if tag & ENTERED:
            length = straight if move < 4 else diagonal
            slot = parent_slot(search, slot, cell, parent, length)
        cell = parent
