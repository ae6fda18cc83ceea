# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops of the coarse route: A* over the components of tiles, and taut waypoints.

A node is a local component of a tile (`_kernels.tiles`), at the free cell nearest to its centroid.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from llm_astar_planner.search._kernels import tiles as tiling
from llm_astar_planner.search._kernels.astar import STEP_X, STEP_Y, octile
from llm_astar_planner.search._kernels.line_of_sight import Rules, line_cost
from llm_astar_planner.search._kernels.tiles import TileTables, tile_window
from llm_astar_planner.search.arrays import Bools, Float32s, Int64s, Uint16s
from llm_astar_planner.search.kernel_cache import jit

Points = list[tuple[int, int]]
# The tiles, which of them are open, and the middle and the price of each node.
Graph = tuple[TileTables, Bools, Int64s, Float32s]

# How much longer a diagonal move is than a straight one, and half of its length, in cells.
DIAGONAL = math.sqrt(2.0) - 1.0
HALF_DIAGONAL = math.sqrt(0.5)
# Halvings of the stretch along which a turn is moved.
HALVINGS = 4


@jit
def describe_nodes(
    tiles: TileTables, cell_surcharge: Uint16s, sizes: Int64s, places: Int64s, prices: Float32s
) -> None:
    """Count the cells of each node, find its middle and, with graded costs, their mean price.

    The middle, (x, y) in `places`, is the free cell nearest to the mean of the cells; a price is
    the cost of a length of 1, and `prices` is empty on uniform costs.
    """
    labels, shift, nodes = tiles.labels, tiles.shift, tiles.nodes
    height, width = labels.shape
    columns = tiles.counts.shape[1]
    sums = np.zeros((len(sizes), 3), dtype=np.int64)
    nearest = np.full(len(sizes), 2**62)
    for is_first_pass in (True, False):
        for y in range(height):
            for x in range(width):
                if labels[y, x] == 0:
                    continue
                node = nodes[(y >> shift) * columns + (x >> shift)] + labels[y, x]
                if is_first_pass:
                    sizes[node] += 1
                    sums[node, 0] += x
                    sums[node, 1] += y
                    if prices.size:
                        sums[node, 2] += cell_surcharge[y * width + x]
                else:
                    off = (x - sums[node, 0]) ** 2 + (y - sums[node, 1]) ** 2
                    if off < nearest[node]:
                        nearest[node] = off
                        places[node, 0], places[node, 1] = x, y
        if is_first_pass:
            for node in np.nonzero(sizes)[0]:
                sums[node, 0] = round(sums[node, 0] / sizes[node])
                sums[node, 1] = round(sums[node, 1] / sizes[node])
                if prices.size:
                    prices[node] = 1.0 + sums[node, 2] / sizes[node] / 256.0


@jit
def neighbours(tiles: TileTables, number: int, row: int, column: int) -> Sequence[tuple[int, ...]]:
    """Return the neighbours of local component `number` of a tile.

    Each is a node, the least and the greatest x and y of the cells at which one may leave to it,
    and the step in x and y there.
    """
    labels, shift, corner_cutting, counts, nodes, starts, contacts = tiles
    height, width = labels.shape
    columns = counts.shape[1]
    tile = row * columns + column
    top, bottom, left, right = tile_window(labels, shift, row, column)
    found = []
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
                found.append((node, border, border, begin, end, step, aside))
            else:
                found.append((node, begin, end, border, border, aside, step))
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
                found.append((node, x, x, y, y, step_x, step_y))
    return found


@jit
def open_neighbours(
    tiles: TileTables, row: int, column: int, move_x: int, move_y: int
) -> Sequence[tuple[int, ...]]:
    """Return the neighbours of an open tile, as `neighbours` does.

    Reached by a move between open tiles, which is not 0, only the neighbours are tried that the
    tile before does not reach as cheaply without this one, diagonal moves first.
    """
    shift, nodes, columns = tiles.shift, tiles.nodes, tiles.counts.shape[1]
    found = []
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
            found.append((node, least_x, most_x, least_y, most_y, step_x, step_y))
    return found


@jit
def route(
    graph: Graph, start: tuple[int, int], goal: tuple[int, int], most: int
) -> tuple[Points, float]:
    """Return a cheapest route between two connected free cells, and its cost.

    The route is the cells (x, y) of its nodes, and where it enters each; empty if more than
    `most` nodes would have to be expanded.
    """
    tiles, is_open, places, prices = graph
    labels, shift, nodes = tiles.labels, tiles.shift, tiles.nodes
    columns = is_open.shape[1]
    start_x, start_y = start
    goal_x, goal_y = goal
    goal_row = goal_y >> shift
    goal_column = goal_x >> shift
    start_node = nodes[(start_y >> shift) * columns + (start_x >> shift)]
    start_node += labels[start_y, start_x]
    goal_node = nodes[goal_row * columns + goal_column] + labels[goal_y, goal_x]
    costs = np.full(len(places), math.inf)
    # The node before, and the cell on which the route enters.
    parents = np.full((len(places), 3), -1, dtype=np.int64)
    is_expanded = np.zeros(len(places), dtype=np.bool_)
    graded = prices.size > 0
    price = other_price = 1.0
    # A bucket holds the nodes whose f is within a quarter of a tile's side, the newest first.
    per_width = 4.0 / (1 << shift)
    lowest = octile(1.0, DIAGONAL, start_x - goal_x, start_y - goal_y)
    costs[start_node] = 0.0
    queue = [(0, 0, np.int64(start_node))]
    pushed = expanded = 0
    while queue:
        bucket, _, node = heapq.heappop(queue)
        if lowest + bucket / per_width >= costs[goal_node]:
            break
        if is_expanded[node]:
            continue
        is_expanded[node] = True
        expanded += 1
        if expanded > most:
            costs[goal_node] = math.inf
            break
        x, y = start if node == start_node else (places[node, 0], places[node, 1])
        row = y >> shift
        column = x >> shift
        if is_open[row, column]:
            move_x = move_y = 0
            near_goal = abs(row - goal_row) <= 1 and abs(column - goal_column) <= 1
            before = parents[node, 0]
            if not (graded or near_goal or node == start_node or before == start_node):
                move_x = column - (places[before, 0] >> shift)
                move_y = row - (places[before, 1] >> shift)
            found = open_neighbours(tiles, row, column, move_x, move_y)
        else:
            found = neighbours(tiles, node - nodes[row * columns + column], row, column)
        if graded:
            price = prices[node]
        for other, least_x, most_x, least_y, most_y, step_x, step_y in found:
            to_x, to_y = goal if other == goal_node else (places[other, 0], places[other, 1])
            if graded:
                other_price = prices[other]
            away = octile(1.0, DIAGONAL, x - to_x, y - to_y)
            if costs[other] <= costs[node] + away * min(price, other_price):
                continue
            leave_x = min(max((x + to_x) >> 1, least_x), most_x)
            leave_y = min(max((y + to_y) >> 1, least_y), most_y)
            enter_x = leave_x + step_x
            enter_y = leave_y + step_y
            half = 0.5 if step_x == 0 or step_y == 0 else HALF_DIAGONAL
            cost = (
                costs[node]
                + price * (octile(1.0, DIAGONAL, x - leave_x, y - leave_y) + half)
                + other_price * (octile(1.0, DIAGONAL, enter_x - to_x, enter_y - to_y) + half)
            )
            f = cost + octile(1.0, DIAGONAL, to_x - goal_x, to_y - goal_y)
            if f >= costs[goal_node] or costs[other] <= cost:
                continue
            costs[other] = cost
            parents[other, 0], parents[other, 1], parents[other, 2] = node, enter_x, enter_y
            is_expanded[other] = False
            if other != goal_node:
                pushed += 1
                rank = max(int((f - lowest) * per_width), bucket)
                heapq.heappush(queue, (rank, -pushed, np.int64(other)))
    points = [goal for _ in range(costs[goal_node] < math.inf)]
    node = np.int64(goal_node)
    while points and parents[node, 0] >= 0:
        points.append((parents[node, 1], parents[node, 2]))
        node = parents[node, 0]
        points.append(start if node == start_node else (places[node, 0], places[node, 1]))
    return points[::-1], costs[goal_node]


@jit
def taut_route(
    graph: Graph, start: tuple[int, int], goal: tuple[int, int], most: int, rules: Rules
) -> Points:
    """Return where a cheapest route turns once it is pulled taut, with its ends; see `route`."""
    points, _ = route(graph, start, goal, most)
    return taut(rules, graph[0].shift, points) if points else points


@jit
def taut(rules: Rules, shift: int, points: Points) -> Points:
    """Return the turns of a route pulled taut, with its ends."""
    points = pull(rules, fill_in(rules, shift, points))
    tighten(rules, points)
    return pull(rules, points)


@jit
def fill_in(rules: Rules, shift: int, points: Points) -> Points:
    """Return a route with a path of single moves wherever two points do not see another.

    Two successive points are connected within the square of tiles around both.
    """
    blocked, _, corner_cutting = rules
    height, width = blocked.shape
    side = 2 << shift
    filled = [points[0]]
    for index in range(1, len(points)):
        from_x, from_y = points[index - 1]
        x, y = points[index]
        if line_cost(*rules, from_x, from_y, x, y) >= 0.0:
            filled.append((x, y))
            continue
        left = min(from_x, x) >> shift << shift
        top = min(from_y, y) >> shift << shift
        right = min(left + side, width)
        bottom = min(top + side, height)
        # Breadth first from the later point; `onward` is the move towards it.
        onward = np.full((side, side), -1, dtype=np.int8)
        onward[y - top, x - left] = 8
        queue = [(x, y)]
        for at_x, at_y in queue:
            if onward[from_y - top, from_x - left] >= 0:
                break
            for move in range(8):
                to_x = at_x - STEP_X[move]
                to_y = at_y - STEP_Y[move]
                if not (left <= to_x < right and top <= to_y < bottom):
                    continue
                if onward[to_y - top, to_x - left] >= 0 or blocked[to_y, to_x]:
                    continue
                if corner_cutting or not (blocked[at_y, to_x] or blocked[to_y, at_x]):
                    onward[to_y - top, to_x - left] = move
                    queue.append((to_x, to_y))
        while from_x != x or from_y != y:
            move = onward[from_y - top, from_x - left]
            from_x += STEP_X[move]
            from_y += STEP_Y[move]
            filled.append((from_x, from_y))
    return filled


@jit
def pull(rules: Rules, points: Points) -> Points:
    """Return the points at which a route has to turn, with its ends.

    From each point kept the route goes straight to a far one, as long as the line is free and
    costs no more than the way along the points, of which each sees the next; the steps that are
    tried double, then halve.
    """
    last = len(points) - 1
    along = np.zeros(len(points))
    for index in range(last):
        along[index + 1] = along[index] + line_cost(*rules, *points[index], *points[index + 1])
    kept = [points[0]]
    index = 0
    while index < last:
        step = 1
        far = index + 1  # the farthest known to be seen
        grows = True
        while step > 0:
            probe = min(far + step, last)
            is_better = False
            if probe > far:
                cost = line_cost(*rules, *points[index], *points[probe])
                is_better = 0.0 <= cost <= along[probe] - along[index] + 1e-6
            if is_better:
                far = probe
            else:
                grows = False
            step = step * 2 if grows else step // 2
        kept.append(points[far])
        index = far
    return kept


@jit
def tighten(rules: Rules, points: Points) -> None:
    """Move each turn of a route towards the line between its neighbours while that is cheaper.

    It stays in sight of both.
    """
    for index in range(1, len(points) - 1):
        x, y = points[index]
        before, after = points[index - 1], points[index + 1]
        cost = through(rules, before, (x, y), after)
        delta_x = after[0] - before[0]
        delta_y = after[1] - before[1]
        length = delta_x * delta_x + delta_y * delta_y
        if length == 0:
            continue
        share = ((x - before[0]) * delta_x + (y - before[1]) * delta_y) / length
        share = min(max(share, 0.0), 1.0)
        aim_x = before[0] + share * delta_x
        aim_y = before[1] + share * delta_y
        part = 1.0
        for halving in range(1, HALVINGS + 1):
            moved = round(x + part * (aim_x - x)), round(y + part * (aim_y - y))
            new_cost = through(rules, before, moved, after)
            if new_cost < cost:
                cost = new_cost
                points[index] = moved
                if part == 1.0:
                    break
                part += 0.5**halving
            else:
                part -= 0.5**halving


@jit
def through(
    rules: Rules, before: tuple[int, int], point: tuple[int, int], after: tuple[int, int]
) -> float:
    """Return the cost of two straight lines over a point (x, y), inf where one is blocked."""
    first = line_cost(*rules, *before, *point)
    if first < 0.0:
        return math.inf
    second = line_cost(*rules, *point, *after)
    return first + second if second >= 0.0 else math.inf
