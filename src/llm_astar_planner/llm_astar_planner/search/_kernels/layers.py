"""Compiled parts of the layered search that know what a layer is: visits, rules, prices, bounds.

A layer says which regions a path has visited. See `_kernels/layered` for the search itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from llm_astar_planner.search._kernels.astar import LOWEST, STEP_X, STEP_Y

# Bits of `Tables.cell_bits`: regions are bits 0 to 15, then the goal cells.
MAX_REGIONS = 16
GOAL_BIT = 1 << 16
# A cost above all real ones, for cells in pockets.
UNREACHED = 1e300
# The number of slopes in `Tables`, a constant so that the compiler unrolls the loop over them.
SLOPES = 16

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

    moves: NDArray[np.uint8]  # [cells]
    cell_surcharge: NDArray[np.uint16]  # [cells] or empty
    price: NDArray[np.float32]  # [cells] or empty
    cell_bits: NDArray[np.uint32]  # [cells]
    groups: Groups
    rules: Rules
    boxes: NDArray[np.int64]  # [MAX_REGIONS + 1, 4]: x0, x1, y0, y1 of the regions and the goals
    slopes: NDArray[np.float64]  # [2, SLOPES]
    offsets: NDArray[np.float64]  # [candidates, SLOPES]


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


@_jit
def mark_region(
    mask: NDArray[np.bool_],
    blocked: NDArray[np.bool_],
    bit: int,
    cell_bits: NDArray[np.uint32],
    box: NDArray[np.int64],
) -> int:
    """Set a bit in the free cells of a region that lie in the rows `box[2]` to `box[3]`.

    Returns their number and writes their bounding box: x0, x1, y0, y1.
    """
    width = mask.shape[1]
    first_row, last_row = box[2], box[3]
    box[0], box[1], box[2], box[3] = width, -1, last_row, -1
    count = 0
    for y in range(first_row, last_row + 1):
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
def advance_base(groups: Groups, group: int, visited: int, bits: int) -> int:
    """Return the base layer after entering a cell of the regions `bits`."""
    while group < groups.masks.size:
        visited |= bits & groups.masks[group]
        if visited != groups.masks[group]:
            return groups.first_base[group] + pack(visited, groups.masks[group])
        group += 1
        visited = 0
    return groups.first_base[group]


@_jit
def layer_after(tables: Tables, layers: Layers, slot: int, bits: int) -> tuple[int, int]:
    """Return base layer and entered regions after entering a cell of the regions `bits`."""
    groups = tables.groups
    base = layers.base[slot]
    entered = layers.entered[slot] | bits & tables.rules.first_mask[0]
    base = advance_base(groups, groups.base_group[base], groups.base_visited[base], bits)
    return base, entered


@_jit
def layer_number(tables: Tables, base: int, entered: int) -> int:
    """Return the index in `Layers.slots` of a base layer with the regions `entered`."""
    first_mask = tables.rules.first_mask[0]
    firsts = 0
    for region in range(MAX_REGIONS):
        firsts += first_mask >> region & 1
    return base << firsts | pack(entered, first_mask)


@_jit
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


@_jit
def rule_price(rules: Rules, bits: int, entered: int) -> float:
    """Return the price by the rules of a cell of the regions `bits`; inf if it is forbidden."""
    price = 0.0
    for index in range(rules.firsts.size):
        if bits >> rules.seconds[index] & 1 and not entered >> rules.firsts[index] & 1:
            price += rules.prices[index]
    return price


@_jit
def price_of(tables: Tables, cell: int, entered: int) -> float:
    """Return the price of a cell while the regions `entered` were entered; inf if forbidden."""
    price = np.float64(tables.price[cell]) if tables.price.size else 0.0
    return price + rule_price(tables.rules, np.int64(tables.cell_bits[cell]), entered)


@_jit
def move_cost(
    tables: Tables, cell: int, other: int, length: int, entered: int, now_entered: int
) -> float:
    """Return the cost of a move of `length` units, by the regions entered at its two ends."""
    units = length
    if tables.cell_surcharge.size:
        surcharge = np.int64(tables.cell_surcharge[cell]) + tables.cell_surcharge[other]
        units += length * surcharge >> 9
    prices = price_of(tables, cell, entered) + price_of(tables, other, now_entered)
    return units + 0.5 * length * prices


@_jit
def spread(
    tables: Tables,
    window: NDArray[np.int64],
    width: int,
    units: tuple[int, int],
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
        mask = np.int64(tables.moves[cell])
        while mask:
            move = LOWEST[mask]
            mask &= mask - 1
            other_x = x + STEP_X[move]
            other_y = y + STEP_Y[move]
            if not (window[0] <= other_x <= window[1] and window[2] <= other_y <= window[3]):
                leaves = True
                continue
            length = units[0] if move < 4 else units[1]
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


@_jit
def region_cap(
    tables: Tables,
    layers: Layers,
    state_costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    slot: int,
    region: int,
    width: int,
    units: tuple[int, int],
    margin: int,
) -> float:
    """Return a cost at which entering a pending region from a layer is of no use any more.

    By then every cell of the region is reached by way of the cells entered so far and of paths
    that leave the region's bounding box by at most `margin` cells. Cells in a pocket do not
    count, since no path reaches them. inf if other cells are not reached.
    """
    cells = tables.moves.size
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
                if after >= 0 and tags[after * cells + cell]:
                    costs[near] = state_costs[after * cells + cell]
                    ring[queue] = near
                    queued[near] = True
                    queue += 1
    spread(tables, window, width, units, costs, ring, queued, queue)
    cap = 0.0
    for index in range(count):
        near = inside[index, 0]
        if costs[near] == np.inf:
            costs[near] = UNREACHED
            ring[0] = near
            if spread(tables, window, width, units, costs, ring, queued, 1):
                return np.inf
        elif costs[near] < UNREACHED:
            cap = max(cap, costs[near])
    return cap


@_jit
def measure_caps(
    tables: Tables,
    layers: Layers,
    costs: NDArray[np.float64],
    tags: NDArray[np.uint8],
    slots: int,
    width: int,
    units: tuple[int, int],
    margin: int,
    patience: int,
) -> None:
    """Measure the caps of layers whose search went on for `patience` times the work of that."""
    for slot in range(slots):
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
                    cap = region_cap(
                        tables, layers, costs, tags, slot, region, width, units, margin
                    )
                    layers.caps[slot, region] = min(layers.caps[slot, region], cap)


@_jit
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


@_jit
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


@_jit
def box_distance(
    boxes: NDArray[np.int64], region: int, x: int, y: int, units: tuple[int, int]
) -> int:
    """Return the octile distance in units from a cell to the bounding box of a region."""
    delta_x = max(boxes[region, 0] - x, x - boxes[region, 1], 0)
    delta_y = max(boxes[region, 2] - y, y - boxes[region, 3], 0)
    return units[0] * abs(delta_x - delta_y) + units[1] * min(delta_x, delta_y)


@_jit
def estimate_below_caps(
    tables: Tables, layers: Layers, slot: int, cost: float, x: int, y: int, units: tuple[int, int]
) -> float:
    """Return a lower bound on the cost to the goal of the paths from a cell that are needed.

    These enter a pending region below its cap; `cost` is that of the cell and `units` are those
    of a straight and a diagonal move. inf: none is needed.
    """
    base = layers.base[slot]
    others = layers.pending[slot]
    least = np.inf
    for row in range(tables.groups.candidate_begin[base], tables.groups.candidate_begin[base + 1]):
        region = tables.groups.candidates[row]
        others &= ~(1 << region)
        if cost + box_distance(tables.boxes, region, x, y, units) < layers.caps[slot, region]:
            bound = estimate(tables.slopes, tables.offsets, row, row + 1, x, y)
            least = min(least, bound)
    # A path may enter these to end a rule, before it enters one of the others.
    for region in range(MAX_REGIONS):
        if others >> region & 1:
            way = box_distance(tables.boxes, region, x, y, units)
            if cost + way < layers.caps[slot, region]:
                return 0.0
    return least
