# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of the coarse route: A* over the components of tiles, and taut waypoints.

A node is a local component of a tile (`_kernels.tiles`), at the free cell nearest to its centroid.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import tiles as tiling
from llm_astar_planner.search._kernels.astar import STEP_X, STEP_Y, octile
from llm_astar_planner.search._kernels.line_of_sight import Rules, line_cost
from llm_astar_planner.search._kernels.tiles import TileTables, tile_window
from llm_astar_planner.search.kernel_cache import jit

# How much longer a diagonal move is than a straight one, and half of its length, in cells.
DIAGONAL = math.sqrt(2.0) - 1.0
HALF_DIAGONAL = math.sqrt(0.5)
# How a search ended: without a route, with one, or before either.
NO_ROUTE, ROUTE, OUT_OF_WORK = range(3)
# Halvings of the stretch along which a turn is moved.
HALVINGS = 4


class Workspace(NamedTuple):
    """What one running query writes for each node; `route` describes it."""

    costs: NDArray[np.float64]
    parents: NDArray[np.int32]
    stamps: NDArray[np.int64]


@jit
def describe_nodes(
    tiles: TileTables,
    cell_surcharge: NDArray[np.uint16],
    places: NDArray[np.int64],
    prices: NDArray[np.float32],
    is_open: NDArray[np.bool_],
) -> None:
    """Fill in the middle of each node, and with graded costs the mean price of its cells.

    The middle is the free cell nearest to the mean of the cells, y << 32 | x in `places`; a price
    is the cost of a length of 1, and `prices` is empty on uniform costs. `is_open` [rows, columns]
    becomes true for a tile that is free with all eight around it, none of them cut off by the
    edge of the grid.
    """
    labels, shift, counts, nodes = tiles.labels, tiles.shift, tiles.counts, tiles.nodes
    width = labels.shape[1]
    rows, columns = counts.shape
    graded = cell_surcharge.size > 0
    is_free = np.zeros((rows, columns), dtype=np.bool_)
    sums = np.zeros((counts.max() + 1, 4), dtype=np.int64)
    nearest = np.zeros(len(sums), dtype=np.int64)
    for row in range(rows):
        for column in range(columns):
            top, bottom, left, right = tile_window(labels, shift, row, column)
            count = counts[row, column]
            first = nodes[row * columns + column]
            sums[: count + 1] = 0
            for y in range(top, bottom):
                for x in range(left, right):
                    number = labels[y, x]
                    sums[number, 0] += 1
                    sums[number, 1] += x
                    sums[number, 2] += y
                    if graded:
                        sums[number, 3] += cell_surcharge[y * width + x]
            is_free[row, column] = count > 0 and sums[1, 0] == 1 << 2 * shift
            is_done = True
            for number in range(1, count + 1):
                if graded:
                    prices[first + number] = 1.0 + sums[number, 3] / sums[number, 0] / 256.0
                x = round(sums[number, 1] / sums[number, 0])
                y = round(sums[number, 2] / sums[number, 0])
                sums[number, 1] = x
                sums[number, 2] = y
                places[first + number] = y << 32 | x
                nearest[number] = 0 if labels[y, x] == number else 2**62
                is_done &= labels[y, x] == number
            if is_done:
                continue
            for y in range(top, bottom):
                for x in range(left, right):
                    number = labels[y, x]
                    off = (x - sums[number, 1]) ** 2 + (y - sums[number, 2]) ** 2
                    if number and off < nearest[number]:
                        nearest[number] = off
                        places[first + number] = y << 32 | x
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            is_open[row, column] = is_free[row - 1 : row + 2, column - 1 : column + 2].all()


@jit
def add_row(found: NDArray[np.int32], count: int, row: tuple[int, ...]) -> int:
    """Write a row of whole numbers behind the first `count`; return how many there are then."""
    for column in range(len(row)):
        found[count, column] = row[column]
    return count + 1


@jit
def neighbours(
    tiles: TileTables, number: int, row: int, column: int, found: NDArray[np.int32]
) -> int:
    """Write the neighbours of local component `number` of a tile to `found`; return how many.

    A row is a node, the least and the greatest x and y of the cells at which one may leave to it,
    and the step in x and y there.
    """
    labels, shift, corner_cutting, counts, nodes, starts, contacts = tiles
    height, width = labels.shape
    columns = counts.shape[1]
    tile = row * columns + column
    top, bottom, left, right = tile_window(labels, shift, row, column)
    count = 0
    for side in range(3):
        # Contacts are kept with the tile to the left or above.
        if (side == 1 and column == 0) or (side == 2 and row == 0):
            continue
        other_tile = tile - (0, 1, columns)[side]
        for index in range(starts[other_tile], starts[other_tile + 1]):
            contact = np.int64(contacts[index])
            kind = (contact >> tiling.SIDE_SHIFT) & 3
            inner = contact & tiling.NUMBER_MASK
            outer = (contact >> tiling.NUMBER_BITS) & tiling.NUMBER_MASK
            first = (contact >> tiling.FIRST_SHIFT) & 31
            last = (contact >> tiling.LAST_SHIFT) & 31
            if side == 0:
                if inner != number or kind > tiling.SOUTH:
                    continue
                node = nodes[tile + (1 if kind == tiling.EAST else columns)] + outer
            else:
                if outer != number or kind != (tiling.EAST if side == 1 else tiling.SOUTH):
                    continue
                node = nodes[other_tile] + inner
            is_east = kind == tiling.EAST
            step = 1 if side == 0 else -1
            corner, limit = (top, bottom) if is_east else (left, right)
            near, far = (left, right) if is_east else (top, bottom)
            border = far - 1 if side == 0 else near
            begin, end = corner + first, corner + last
            aside: Any = 0
            if corner_cutting and first == last:
                # The contact may be diagonal; its place is that in the tile it is kept with.
                seen = border + step if side == 0 else border
                for shifted in (begin + 1, begin - 1, begin):
                    if corner <= shifted < limit:
                        label = labels[shifted, seen] if is_east else labels[seen, shifted]
                        if label == outer:
                            aside = shifted - begin
                if side != 0:
                    begin += aside
                    end = begin
                    aside = -aside
            if is_east:
                count = add_row(found, count, (node, border, border, begin, end, step, aside))
            else:
                count = add_row(found, count, (node, begin, end, border, border, aside, step))
    for step_y in (-1, 1):
        y = top if step_y < 0 else bottom - 1
        if not 0 <= y + step_y < height:
            continue
        for step_x in (-1, 1):
            x = left if step_x < 0 else right - 1
            if not 0 <= x + step_x < width or labels[y, x] != number:
                continue
            other = labels[y + step_y, x + step_x]
            is_wide = labels[y, x + step_x] != 0 and labels[y + step_y, x] != 0
            if other != 0 and (is_wide or corner_cutting):
                node = nodes[tile + step_y * columns + step_x] + other
                count = add_row(found, count, (node, x, x, y, y, step_x, step_y))
    return count


@jit
def open_neighbours(
    tiles: TileTables, row: int, column: int, move_x: int, move_y: int, found: NDArray[np.int32]
) -> int:
    """Write the neighbours of an open tile to `found`, as `neighbours` does; return how many.

    Reached by a move between open tiles, which is not 0, only the neighbours are tried that the
    tile before does not reach as cheaply without this one, diagonal moves first.
    """
    shift, nodes, columns = tiles.shift, tiles.nodes, tiles.counts.shape[1]
    count = 0
    for step_y in (-1, 0, 1):
        for step_x in (-1, 0, 1):
            if step_x == 0 and step_y == 0:
                continue
            if move_x != 0 and move_y != 0:
                if step_x == -move_x or step_y == -move_y:
                    continue
            elif (move_x != 0 or move_y != 0) and (step_x != move_x or step_y != move_y):
                continue
            node = nodes[(row + step_y) * columns + column + step_x] + 1
            least_x = (column + (step_x > 0) << shift) - (step_x > 0)
            most_x = (column + (step_x >= 0) << shift) - (step_x >= 0)
            least_y = (row + (step_y > 0) << shift) - (step_y > 0)
            most_y = (row + (step_y >= 0) << shift) - (step_y >= 0)
            row_found = node, least_x, most_x, least_y, most_y, step_x, step_y
            count = add_row(found, count, row_found)
    return count


@jit
def route(
    tiles: TileTables,
    is_open: NDArray[np.bool_],
    places: NDArray[np.int64],
    prices: NDArray[np.float32],
    highest: float,
    start: tuple[int, int],
    goal: tuple[int, int],
    generation: int,
    workspace: Workspace,
    most: int,
) -> tuple[int, int]:
    """Find a cheapest route between two free cells (x, y) over the nodes.

    Returns how that ended and the goal's node; at most `most` nodes are expanded. Written are, of
    the nodes reached, their cost, in `parents` [nodes, 3] the node before and the cell (x, y) on
    which the route enters, and in `stamps` generation << 1 | expanded. A node with the stamp of
    another generation counts as never seen. `highest` is the highest price.
    """
    labels, shift, nodes = tiles.labels, tiles.shift, tiles.nodes
    costs, parents, stamps = workspace
    columns = is_open.shape[1]
    start_x, start_y = start
    goal_x, goal_y = goal
    goal_row = goal_y >> shift
    goal_column = goal_x >> shift
    start_node = nodes[(start_y >> shift) * columns + (start_x >> shift)]
    start_node += labels[start_y, start_x]
    goal_node = nodes[goal_row * columns + goal_column] + labels[goal_y, goal_x]
    graded = prices.size > 0
    price = 1.0
    other_price = 1.0
    # A bucket holds the nodes whose f is within a quarter of a tile's side.
    per_width = 4.0 / (1 << shift)
    size = 64
    while size < 64.0 * highest:
        size *= 2
    heads = np.zeros(size, dtype=np.int32)
    pool = np.empty((1024, 2), dtype=np.int32)
    found = np.empty(((12 << shift) + 4, 7), dtype=np.int32)
    lowest = octile(1.0, DIAGONAL, start_x - goal_x, start_y - goal_y)
    costs[start_node] = 0.0
    parents[start_node, 0] = -1
    stamps[start_node] = generation << 1
    pool[0, 0], pool[0, 1] = start_node, 0
    heads[0] = 1
    top = live = 1
    bucket = expanded = 0
    best = math.inf if start_node != goal_node else 0.0
    while live > 0:
        entry = heads[bucket & (size - 1)] - 1
        if entry < 0:
            bucket += 1
            continue
        if lowest + bucket / per_width >= best:
            break
        node = pool[entry, 0]
        heads[bucket & (size - 1)] = pool[entry, 1]
        live -= 1
        if stamps[node] & 1:
            continue
        stamps[node] |= 1
        expanded += 1
        if expanded > most:
            return OUT_OF_WORK, goal_node
        if node == start_node:
            x, y = start_x, start_y
        else:
            x, y = places[node] & 0xFFFFFFFF, places[node] >> 32
        row = y >> shift
        column = x >> shift
        if is_open[row, column]:
            move_x = move_y = 0
            near_goal = abs(row - goal_row) <= 1 and abs(column - goal_column) <= 1
            before = parents[node, 0]
            if not (graded or near_goal or node == start_node or before == start_node):
                move_x = column - ((places[before] & 0xFFFFFFFF) >> shift)
                move_y = row - (places[before] >> 32 + shift)
            count = open_neighbours(tiles, row, column, move_x, move_y, found)
        else:
            number = node - nodes[row * columns + column]
            count = neighbours(tiles, number, row, column, found)
        cost_here = costs[node]
        if graded:
            price = prices[node]
        for index in range(count):
            other = found[index, 0]
            if other == goal_node:
                to_x, to_y = goal_x, goal_y
            else:
                to_x, to_y = places[other] & 0xFFFFFFFF, places[other] >> 32
            if graded:
                other_price = prices[other]
            is_new = stamps[other] >> 1 != generation
            least = cost_here + octile(1.0, DIAGONAL, x - to_x, y - to_y) * min(price, other_price)
            if not is_new and costs[other] <= least:
                continue
            leave_x = min(max((x + to_x) >> 1, found[index, 1]), found[index, 2])
            leave_y = min(max((y + to_y) >> 1, found[index, 3]), found[index, 4])
            enter_x = leave_x + found[index, 5]
            enter_y = leave_y + found[index, 6]
            half = 0.5 if found[index, 5] == 0 or found[index, 6] == 0 else HALF_DIAGONAL
            cost = (
                cost_here
                + price * (octile(1.0, DIAGONAL, x - leave_x, y - leave_y) + half)
                + other_price * (octile(1.0, DIAGONAL, enter_x - to_x, enter_y - to_y) + half)
            )
            f = cost + octile(1.0, DIAGONAL, to_x - goal_x, to_y - goal_y)
            if f >= best or (not is_new and costs[other] <= cost):
                continue
            costs[other] = cost
            parents[other, 0], parents[other, 1], parents[other, 2] = node, enter_x, enter_y
            stamps[other] = generation << 1
            if other == goal_node:
                best = cost
                continue
            pool = with_room(pool, top)
            slot = max(int((f - lowest) * per_width), bucket) & (size - 1)
            pool[top, 0], pool[top, 1] = other, heads[slot]
            top += 1
            heads[slot] = top
            live += 1
    return (ROUTE if best < math.inf else NO_ROUTE), goal_node


@jit
def trace(
    start: tuple[int, int],
    goal: tuple[int, int],
    goal_node: int,
    places: NDArray[np.int64],
    parents: NDArray[np.int32],
) -> NDArray[np.int64]:
    """Return the cells (x, y) of a route, int64 [n, 2]: of its nodes, and where it enters them."""
    count = 1
    node = goal_node
    while parents[node, 0] >= 0:
        node = parents[node, 0]
        count += 2
    points = np.empty((count, 2), dtype=np.int64)
    node = goal_node
    for index in range(count - 1, 0, -2):
        points[index] = places[node] & 0xFFFFFFFF, places[node] >> 32
        points[index - 1] = parents[node, 1], parents[node, 2]
        node = parents[node, 0]
    points[count - 1] = goal
    points[0] = start
    return points


@jit
def taut(rules: Rules, shift: int, points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the turns [n, 2] of a route pulled taut, without its ends."""
    points = fill_in(rules, shift, points)
    points = pull(rules, points)
    tighten(rules, points)
    points = pull(rules, points)
    return points[1 : len(points) - 1].copy()


@jit
def with_room(rows: NDArray[Any], count: int) -> NDArray[Any]:
    """Return an array whose first `count` rows are used, or one twice as long if it is full."""
    return rows if count < len(rows) else np.concatenate((rows, np.empty_like(rows)))


@jit
def fill_in(rules: Rules, shift: int, points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a route [n, 2] with a path of single moves wherever two points do not see another.

    Two successive points are connected within the square of tiles around both.
    """
    blocked, _, corner_cutting = rules
    height, width = blocked.shape
    side = 2 << shift
    onward = np.empty((side, side), dtype=np.int8)
    queue = np.empty((side * side, 2), dtype=np.int64)
    filled = np.empty((2 * len(points) + 64, 2), dtype=np.int64)
    filled[0] = points[0]
    count = 1
    for index in range(1, len(points)):
        from_x, from_y = points[index - 1]
        x, y = points[index]
        if line_cost(*rules, from_x, from_y, x, y) < 0.0:
            left = min(from_x, x) >> shift << shift
            top = min(from_y, y) >> shift << shift
            right = min(left + side, width)
            bottom = min(top + side, height)
            # Breadth first from the later point; `onward` is the move towards it.
            onward[:] = -1
            onward[y - top, x - left] = 8
            queue[0] = x, y
            last = 1
            for first in range(side * side):
                if onward[from_y - top, from_x - left] >= 0:
                    break
                at_x, at_y = queue[first]
                for move in range(8):
                    to_x = at_x - STEP_X[move]
                    to_y = at_y - STEP_Y[move]
                    if not (left <= to_x < right and top <= to_y < bottom):
                        continue
                    if onward[to_y - top, to_x - left] >= 0 or blocked[to_y, to_x]:
                        continue
                    if not corner_cutting and (blocked[at_y, to_x] or blocked[to_y, at_x]):
                        continue
                    onward[to_y - top, to_x - left] = move
                    queue[last] = to_x, to_y
                    last += 1
            while from_x != x or from_y != y:
                move = onward[from_y - top, from_x - left]
                from_x += STEP_X[move]
                from_y += STEP_Y[move]
                filled = with_room(filled, count)
                filled[count] = from_x, from_y
                count += 1
        else:
            filled = with_room(filled, count)
            filled[count] = x, y
            count += 1
    return filled[:count]


@jit
def pull(rules: Rules, points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the points [n, 2] at which a route has to turn, with its ends.

    From each point kept the route goes straight to a far one, as long as the line is free and
    costs no more than the way along the points, of which each sees the next; the steps that are
    tried double, then halve.
    """
    count = points.shape[0]
    along = np.zeros(count)
    for index in range(1, count):
        x, y = points[index - 1]
        to_x, to_y = points[index]
        cost = line_cost(*rules, x, y, to_x, to_y)
        along[index] = along[index - 1] + cost
    kept = np.empty_like(points)
    kept[0] = points[0]
    found = 1
    index = 0
    while index < count - 1:
        x, y = points[index]
        step = 1
        far = index + 1  # the farthest known to be seen
        grows = True
        while step > 0:
            probe = min(far + step, count - 1)
            is_better = False
            if probe > far:
                to_x, to_y = points[probe]
                cost = line_cost(*rules, x, y, to_x, to_y)
                is_better = 0.0 <= cost <= along[probe] - along[index] + 1e-6
            if is_better:
                far = probe
            else:
                grows = False
            step = step * 2 if grows else step // 2
        kept[found] = points[far]
        found += 1
        index = far
    return kept[:found]


@jit
def tighten(rules: Rules, points: NDArray[np.int64]) -> None:
    """Move each turn of a route towards the line between its neighbours while that is cheaper.

    It stays in sight of both.
    """
    for index in range(1, points.shape[0] - 1):
        x, y = points[index]
        from_x, from_y = points[index - 1]
        to_x, to_y = points[index + 1]
        cost = through(rules, from_x, from_y, x, y, to_x, to_y)
        delta_x = to_x - from_x
        delta_y = to_y - from_y
        length = delta_x * delta_x + delta_y * delta_y
        if length == 0:
            continue
        share = ((x - from_x) * delta_x + (y - from_y) * delta_y) / length
        share = min(max(share, 0.0), 1.0)
        aim_x = from_x + share * delta_x
        aim_y = from_y + share * delta_y
        step = 0.5
        part = 1.0
        for _ in range(HALVINGS):
            new_x = round(x + part * (aim_x - x))
            new_y = round(y + part * (aim_y - y))
            new_cost = through(rules, from_x, from_y, new_x, new_y, to_x, to_y)
            if new_cost < cost:
                cost = new_cost
                points[index] = new_x, new_y
                part += step
            else:
                part -= step
            step *= 0.5
            if part >= 1.0:
                break


@jit
def through(rules: Rules, from_x: int, from_y: int, x: int, y: int, to_x: int, to_y: int) -> float:
    """Return the cost of two straight lines over (x, y), inf where one is blocked."""
    first = line_cost(*rules, from_x, from_y, x, y)
    if first < 0.0:
        return math.inf
    second = line_cost(*rules, x, y, to_x, to_y)
    return first + second if second >= 0.0 else math.inf
