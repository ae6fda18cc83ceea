# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops over the borders of large tiles: distances between their parts, and routes.

Tiles have SIDE cells a side and share the cells of their borders. Tile t, numbered row by row,
has border 2 t above it and border 2 t + 1 to its left; those at the edge of the grid are not
used. A border is divided into PARTS parts, short ones near its ends. `rows[b, p]` has the
distances from part p of border b within the two tiles at b to the parts of the six borders
around both, in steps of STEP units, rounded down; FAR where there is no way.
"""

from __future__ import annotations

import numpy as np

from llm_astar_planner.search._kernels.astar import Cells, octile
from llm_astar_planner.search.arrays import Bools, Float32s, Int32s, Int64s, Uint16s
from llm_astar_planner.search.kernel_cache import jit

SIDE_BITS = 6
SIDE = 1 << SIDE_BITS
_HALF = (1, 1, 1, 2, 2, 3, 3, 3, 4, 4, 4, 4)
# A multiple of eight, for the processor's vectors.
PARTS = 2 * len(_HALF)
_CUTS = np.cumsum((0, *_HALF, *_HALF[::-1]))
# The first and the last cell of each part, along a border; both its ends belong to parts.
FIRST, LAST = _CUTS[:-1], _CUTS[1:] - (_CUTS[1:] < SIDE)
STEP_BITS = 7
FAR = 65535
# The cells of a line of the frame that two tiles are measured in, with one more on either side.
LINE = 2 * SIDE + 3
NOWHERE = np.float32(1e9)
# The bits of a part's number; more steps than a path may cost, and the way of no such cost.
PART_BITS = 5
UNKNOWN = 1 << 25
NO_WAY = UNKNOWN << PART_BITS
# The ring of buckets of a route, each 1 << BUCKET_BITS steps wide: twice the longest way.
BUCKETS, BUCKET_BITS = 1 << 12, 5
UNSEEN = 1 << 40


@jit
def around(border: int, columns: int, count: int, found: Int64s) -> None:
    """Write the six borders around the two tiles at a border, -1 for those that are not used."""
    upright, tile = border & 1, border >> 1
    row, column = tile // columns, tile % columns
    # Along the border, then beside its first tile and beside its second one.
    over, along = (column, row) if upright else (row, column)
    step, aside = (1, columns) if upright else (columns, 1)
    overs = columns if upright else count // columns
    alongs = count // columns if upright else columns
    for side in range(6):
        other = tile + (step if side == 1 else 0) - (step if side in (0, 2, 3) else 0)
        kind = upright if side < 2 else 1 - upright
        used = over > 1 if side == 0 else over + 1 < overs if side == 1 else True
        if side >= 2:
            used = along > 0 if side % 2 == 0 else along + 1 < alongs
            other += aside if side % 2 else 0
        found[side] = 2 * other + kind if used else -1


@jit
def relax(
    frame: Float32s, costs: Float32s, cell: int, count: int, step: int, gain: Float32s
) -> None:
    """Lower the distances of a line of cells over the four neighbours already visited.

    `step` is 1 on the way down, where these are to the left and above, and -1 on the way up.
    """
    back, lanes = 0 if step < 0 else 1, gain.size
    for _ in range(count):
        by_left, by_above = costs[cell - back, 0], costs[cell - back * LINE, 1]
        by_one = costs[cell - back * (LINE + 1), 2]
        by_other = costs[cell - back * (LINE - 1), 3]
        if min(by_left, by_above, by_one, by_other) < NOWHERE:
            at, left = np.uint64(cell * lanes), np.uint64((cell - step) * lanes)
            above = np.uint64((cell - step * LINE) * lanes)
            one = np.uint64((cell - step * (LINE + 1)) * lanes)
            other = np.uint64((cell - step * (LINE - 1)) * lanes)
            for number in range(lanes):
                part = np.uint64(number)
                first = min(frame[left + part] + by_left, frame[above + part] + by_above)
                second = min(frame[one + part] + by_one, frame[other + part] + by_other)
                before = frame[at + part]
                least = min(before, first, second)
                gain[part] += before - least
                frame[at + part] = least
        cell += step


@jit
def relax_behind(
    frame: Float32s, costs: Float32s, cell: int, count: int, step: int, gain: Float32s
) -> None:
    """Lower the distances of a line of cells over the neighbour behind, against `relax`."""
    lanes = gain.size
    for _ in range(count):
        cost = costs[cell if step > 0 else cell - 1, 0]
        if cost < NOWHERE:
            at, behind = np.uint64(cell * lanes), np.uint64((cell + step) * lanes)
            for number in range(lanes):
                part = np.uint64(number)
                frame[at + part] = min(frame[at + part], frame[behind + part] + cost)
        cell -= step


@jit
def settle(frame: Float32s, costs: Float32s, height: int, width: int, lanes: int) -> None:
    """Make the distances of a frame [LINE * LINE * lanes] final, by lines down and up."""
    gain = np.empty(lanes, dtype=np.float32)
    begun = False
    while True:
        gain[:] = 0.0
        for y in range(1, height + 1):
            relax(frame, costs, y * LINE + 1, width, 1, gain)
            relax_behind(frame, costs, y * LINE + width - 1, width - 1, 1, gain)
        if begun and gain.max() == 0.0:
            break
        gain[:] = 0.0
        for y in range(height, 0, -1):
            relax(frame, costs, y * LINE + width, width, -1, gain)
            relax_behind(frame, costs, y * LINE + 2, width - 1, -1, gain)
        if gain.max() == 0.0:
            break
        begun = True


@jit
def load(
    cells: Cells, window: tuple[int, int, int, int], frame: Float32s, costs: Float32s
) -> None:
    """Take the moves within a window, (top, left, height, width), into an empty frame."""
    moves, cell_surcharge, width, straight, diagonal = cells
    top, left, lines, places = window
    offsets = np.array([1, width, width + 1, width - 1])
    lengths = np.array([straight, straight, diagonal, diagonal])
    bits = np.array([0, 1, 4, 5])
    frame[:] = NOWHERE
    costs[: (lines + 2) * LINE] = NOWHERE
    for y in range(lines):
        for x in range(places):
            cell = (top + y) * width + left + x
            mask = np.int64(moves[cell])
            for kind in range(4):
                inside = kind == 1 or (x > 0 if kind == 3 else x + 1 < places)
                if mask >> bits[kind] & 1 and inside and (kind == 0 or y + 1 < lines):
                    price = np.int64(cell_surcharge[cell]) + cell_surcharge[cell + offsets[kind]]
                    cost = lengths[kind] + (lengths[kind] * price >> 9)
                    costs[(y + 1) * LINE + x + 1, kind] = cost


@jit
def measure(cells: Cells, borders: Int64s, rows: Uint16s) -> None:
    """Measure from the parts of each of some borders: fill in `rows[border]`."""
    moves, width = cells.moves, cells.width
    height = moves.size // width
    columns = (width + SIDE - 1) >> SIDE_BITS
    frame = np.empty(LINE * LINE * PARTS, dtype=np.float32)
    costs = np.empty((LINE * LINE, 4), dtype=np.float32)
    nearest = np.empty(PARTS, dtype=np.float32)
    for border in borders:
        upright = border & 1
        top = ((border >> 1) // columns - (1 - upright)) << SIDE_BITS
        left = ((border >> 1) % columns - upright) << SIDE_BITS
        lines = min((SIDE << 1 - upright) + 1, height - top)
        places = min((SIDE << upright) + 1, width - left)
        load(cells, (top, left, lines, places), frame, costs)
        for part in range(PARTS):
            for place in range(FIRST[part], LAST[part] + 1):
                y, x = (place, SIDE) if upright else (SIDE, place)
                if y < lines and x < places and moves[(top + y) * width + left + x]:
                    frame[((y + 1) * LINE + x + 1) * PARTS + part] = 0.0
        settle(frame, costs, lines, places, PARTS)
        for side in range(6):
            for part in range(PARTS):
                nearest[:] = NOWHERE
                for place in range(FIRST[part], LAST[part] + 1):
                    across, along = 2 * SIDE * side, place
                    if side >= 2:
                        across, along = place + SIDE * (side // 4), SIDE * (side % 2)
                    y, x = (along, across) if upright else (across, along)
                    if y < lines and x < places:
                        at = ((y + 1) * LINE + x + 1) * PARTS
                        nearest = np.minimum(nearest, frame[at : at + PARTS])
                for source in range(PARTS):
                    steps = int(nearest[source]) >> STEP_BITS
                    is_far = nearest[source] >= NOWHERE
                    rows[border, source, side * PARTS + part] = (
                        FAR if is_far else min(steps, FAR - 1)
                    )


@jit
def reach_borders(cells: Cells, cell: int, found: Int64s) -> None:
    """Measure from a cell within its tile to the parts of the tile's borders.

    Writes units to `found` [4, PARTS]: above, below, to the left and to the right.
    """
    moves, width = cells.moves, cells.width
    top, left = cell // width >> SIDE_BITS << SIDE_BITS, cell % width >> SIDE_BITS << SIDE_BITS
    lines, places = min(SIDE + 1, moves.size // width - top), min(SIDE + 1, width - left)
    frame = np.empty((lines + 2) * LINE, dtype=np.float32)
    costs = np.empty((LINE * LINE, 4), dtype=np.float32)
    load(cells, (top, left, lines, places), frame, costs)
    frame[(cell // width - top + 1) * LINE + cell % width - left + 1] = 0.0
    settle(frame, costs, lines, places, 1)
    for side in range(4):
        for part in range(PARTS):
            found[side, part] = UNSEEN
            for place in range(FIRST[part], LAST[part] + 1):
                across = SIDE * (side % 2)
                y, x = (across, place) if side < 2 else (place, across)
                if y < lines and x < places:
                    distance = frame[(y + 1) * LINE + x + 1]
                    # As the steps of `rows`: larger ones than a float counts are cut off.
                    if distance < NOWHERE:
                        distance = min(int(distance), FAR - 1 << STEP_BITS)
                        found[side, part] = min(found[side, part], int(distance))


@jit
def close_ends(distances: Int64s, straight: int) -> None:
    """Let the last way of a route leave the start's tile and come back over the same border."""
    for side in range(4):
        before = distances[side].copy()
        for part in range(PARTS):
            for other in range(PARTS):
                gap = max(FIRST[part] - LAST[other], FIRST[other] - LAST[part], 0)
                distances[side, part] = min(distances[side, part], before[other] + gap * straight)


@jit
def borders_of(tile: int, columns: int, count: int, found: Int64s) -> None:
    """Write the upper, lower, left and right border of a tile, -1 for those that are not used."""
    row, column = tile // columns, tile % columns
    found[:] = -1
    if row > 0:
        found[0] = 2 * tile
    if row + 1 < count // columns:
        found[1] = 2 * (tile + columns)
    if column > 0:
        found[2] = 2 * tile + 1
    if column + 1 < columns:
        found[3] = 2 * tile + 3


@jit
def leave(costs: Int32s, rows: Uint16s, is_open: Bools, ways: Int32s) -> None:
    """Write the cheapest ways from the open parts of a border to those around; close these.

    A way is its cost in steps << PART_BITS | the part that it comes from, so that many are
    compared at once.
    """
    ways[:] = NO_WAY
    for source in range(PARTS):
        if is_open[source]:
            is_open[source] = False
            begin = costs[source] << PART_BITS | np.int32(source)
            steps = rows[source]
            for number in range(ways.size):
                place = np.uint64(number)
                step = np.int32(steps[place])
                way = np.int32(begin + (step << PART_BITS)) if step != FAR else np.int32(NO_WAY)
                ways[place] = min(ways[place], way)


@jit
def any_is_nearer(ways: Int32s, costs: Int32s) -> bool:
    """Tell whether a way to any part of a border costs less than the cheapest one known."""
    nearer = False
    for number in range(PARTS):
        part = np.uint64(number)
        nearer |= ways[part] >> PART_BITS < costs[part]
    return nearer


@jit
def route(
    cells: Cells,
    rows: Uint16s,
    start: int,
    goal: int,
    to_start: Int64s,
    from_goal: Int64s,
    costs: Int32s,
    parents: Int32s,
) -> tuple[int, int]:
    """Find the cheapest route from the goal to the start over the parts of borders.

    `to_start` and `from_goal` are what `reach_borders` and `close_ends` have made. Returns a cost
    in steps, or NO_WAY, and the last part of the route or -1. No path that leaves the goal's tile
    costs less: some part on it is queued, by no more than it costs, until the search ends. Parts
    are numbered border * PARTS + part; for those seen the steps from the goal and the part
    before, -1 at first, are written to `costs` and `parents` [borders, PARTS]. A border is
    queued, with all its open parts, by the least of their estimates.
    """
    _, _, width, straight, diagonal = cells
    extra = diagonal - straight
    columns, count = (width + SIDE - 1) >> SIDE_BITS, len(rows) // 2
    start_x, start_y = start % width, start // width
    start_row, start_column = start_y >> SIDE_BITS, start_x >> SIDE_BITS
    costs[:] = UNKNOWN
    is_open = np.zeros(costs.shape, dtype=np.bool_)
    dues = np.full(len(rows), NO_WAY, dtype=np.int64)
    heads = np.zeros(BUCKETS, dtype=np.int32)
    pool = np.empty((1 << 13, 2), dtype=np.int32)
    top, live, bucket = np.int64(1), np.int64(0), np.int64(0)
    best, last = np.int64(NO_WAY), np.int64(-1)
    ways = np.full(6 * PARTS, NO_WAY, dtype=np.int32)
    for number in range(from_goal.size):
        ways[number] = min(from_goal.ravel()[number] >> STEP_BITS << PART_BITS, NO_WAY)
    found = np.empty(6, dtype=np.int64)
    borders_of(
        (goal // width >> SIDE_BITS) * columns + (goal % width >> SIDE_BITS), columns, count, found
    )
    border = np.int64(-1)
    while True:
        for side in range(6):
            other = found[side]
            to_side = ways[side * PARTS : (side + 1) * PARTS]
            if other < 0 or not any_is_nearer(to_side, costs[other]):
                continue
            row, column = (other >> 1) // columns, (other >> 1) % columns
            upright = other & 1
            # Which border of the start's tile it is, if any.
            at_start = -1
            if 0 <= row - start_row <= 1 - upright and 0 <= column - start_column <= upright:
                at_start = 2 + column - start_column if upright else row - start_row
            # From the start to the border's first cell.
            along, across = (column << SIDE_BITS) - start_x, (row << SIDE_BITS) - start_y
            if upright:
                along, across = across, along
            least = np.int64(NO_WAY)
            for part in range(PARTS):
                cost = np.int64(to_side[part] >> PART_BITS)
                aside = max(0, along + FIRST[part], -along - LAST[part])
                estimate = cost + (octile(straight, extra, aside, across) >> STEP_BITS)
                if cost >= costs[other, part] or estimate >= best:
                    continue
                source = border * PARTS + (to_side[part] & (1 << PART_BITS) - 1)
                costs[other, part], parents[other, part] = cost, max(source, -1)
                is_open[other, part] = True
                least = min(least, estimate)
                if at_start >= 0 and cost + (to_start[at_start, part] >> STEP_BITS) < best:
                    best = cost + (to_start[at_start, part] >> STEP_BITS)
                    last = other * PARTS + part
            due = least >> BUCKET_BITS
            if due < dues[other]:
                dues[other] = due
                if top == len(pool):
                    pool = np.concatenate((pool, np.empty_like(pool)))
                bucket = min(bucket, due) if live else due
                pool[top, 0], pool[top, 1] = other, heads[due & BUCKETS - 1]
                heads[due & BUCKETS - 1] = top
                top += 1
                live += 1
        border = np.int64(-1)
        while live > 0 and border < 0:
            while heads[bucket & BUCKETS - 1] == 0:
                bucket += 1
            if bucket << BUCKET_BITS >= best:
                break
            entry = heads[bucket & BUCKETS - 1]
            heads[bucket & BUCKETS - 1] = pool[entry, 1]
            live -= 1
            # Entries of a border that was queued again for less are passed over.
            border = np.int64(pool[entry, 0]) if dues[pool[entry, 0]] == bucket else border
        if border < 0:
            return int(best), int(last)
        dues[border] = NO_WAY
        around(border, columns, count, found)
        leave(costs[border], rows[border], is_open[border], ways)


@jit
def route_targets(
    cells: Cells, goal: int, last: int, costs: Int32s, parents: Int32s, most: int
) -> Int64s:
    """Return where a route crosses borders, from the start on, and the goal: int64 [n, 4].

    These are x, y, what the route costs from there to the goal and the least from the one before,
    in units. Of more than `most` as many are left out, evenly.
    """
    _, _, width, straight, diagonal = cells
    columns = (width + SIDE - 1) >> SIDE_BITS
    count, node = 0, last
    while node >= 0:
        count, node = count + 1, parents[node // PARTS, node % PARTS]
    every = count // most + 1
    targets = np.zeros((count // every + 1, 4), dtype=np.int64)
    node = last
    for number in range(count // every * every):
        border, part = node // PARTS, node % PARTS
        middle = (FIRST[part] + LAST[part]) // 2
        upright, tile = border & 1, border >> 1
        target = targets[number // every]
        target[0] = (tile % columns << SIDE_BITS) + (0 if upright else middle)
        target[1] = (tile // columns << SIDE_BITS) + (middle if upright else 0)
        target[2] = np.int64(costs[border, part]) << STEP_BITS
        node = parents[border, part]
    targets[-1, 0], targets[-1, 1] = goal % width, goal // width
    for number in range(1, len(targets)):
        delta_x = targets[number, 0] - targets[number - 1, 0]
        delta_y = targets[number, 1] - targets[number - 1, 1]
        targets[number, 3] = octile(straight, diagonal - straight, delta_x, delta_y)
    return targets
