# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops over paths: they hold them against the cells of a map, and find places on them.

A cell is lethal from `threshold` up. `reach` is the greatest squared distance, in cells, to a
lethal cell at which another is blocked; -1 where only cells themselves count. Distances are
measured where they are needed, row by row around a cell: nothing is prepared for a map.

`tiles` remembers of the squares of TILE x TILE cells that have been looked at whether they hold
a lethal cell. It begins with zeros; threads may share it, since all write the same.
"""

import math

import numpy as np

from llm_astar_planner.search.arrays import Bools, Float64s, Int8s, Int32s, Int64s, Uint8s
from llm_astar_planner.search.kernel_cache import jit

# More than any squared distance on a map.
NO_LETHAL = 2**62
# Half the side, in cells, of the square that is looked at before tiles are.
NEAR = 12
TILE = 32
# Parts of a path this short are looked at cell by cell.
SHORT = 4
UNSEEN, EMPTY, LETHAL = range(3)
# What is wrong with a path.
FINE, ENDS, OUTSIDE, OBSTACLE, JUMP, CORNER = range(6)
# A map's cells, its tiles, the threshold, whether unknown cells are free, and the reach.
Rules = tuple[Int8s, Uint8s, int, bool, int]


@jit
def nearest_in_row(row: Int8s, threshold: int, x: int, first: int, last: int) -> int:
    """Return the distance from column x to the nearest lethal cell of a row in first to last."""
    cells = row[max(first, 0) : max(last + 1, 0)]
    found = False
    for column in range(cells.size):
        found |= cells[column] >= threshold
    nearest = NO_LETHAL
    if found:
        shift = max(first, 0) - x
        for column in range(cells.size):
            if cells[column] >= threshold:
                nearest = min(nearest, abs(column + shift))
    return nearest


@jit
def nearest_lethal(cells: Int8s, tiles: Uint8s, threshold: int, x: int, y: int, limit: int) -> int:
    """Return the squared distance from a cell to the nearest lethal one, at most `limit`."""
    best = limit
    for away in range(NEAR + 1):
        if away * away >= best:
            return best
        half = NEAR
        if NEAR * NEAR + away * away >= best:
            half = int(math.sqrt(best - 1 - away * away))
        for place in (y - away, y + away):
            if 0 <= place < len(cells):
                nearest = nearest_in_row(cells[place], threshold, x, x - half, x + half)
                if nearest < NO_LETHAL:
                    best = min(best, nearest * nearest + away * away)
    if best <= (NEAR + 1) * (NEAR + 1):
        return best
    return nearest_by_tiles(cells, tiles, threshold, x, y, best)


@jit
def nearest_by_tiles(
    cells: Int8s, tiles: Uint8s, threshold: int, x: int, y: int, best: int
) -> int:
    """Return the squared distance from a cell to the nearest lethal one, at most `best`.

    Looks at the tiles in rings around the cell's own, at the cells of those with lethal ones.
    """
    height, width = tiles.shape
    column, row = x // TILE, y // TILE
    for ring in range(max(column, width - 1 - column, row, height - 1 - row) + 1):
        least = max((ring - 1) * TILE + 1, 0)
        if least * least >= best:
            break
        for tile_row in range(max(row - ring, 0), min(row + ring, height - 1) + 1):
            step = 1 if abs(tile_row - row) == ring else 2 * ring
            for tile_column in range(column - ring, column + ring + 1, step):
                if not 0 <= tile_column < width:
                    continue
                if not tile_has_lethal(cells, tiles, threshold, tile_row, tile_column):
                    continue
                top, left = tile_row * TILE, tile_column * TILE
                beside = max(left - x, 0, x - left - TILE + 1)
                for place in range(top, min(top + TILE, len(cells))):
                    away = abs(place - y)
                    if away * away + beside * beside < best:
                        right = left + TILE - 1
                        nearest = nearest_in_row(cells[place], threshold, x, left, right)
                        if nearest < NO_LETHAL:
                            best = min(best, nearest * nearest + away * away)
    return best


@jit
def tile_has_lethal(cells: Int8s, tiles: Uint8s, threshold: int, row: int, column: int) -> bool:
    """Tell whether a tile holds a lethal cell, and remember it."""
    if tiles[row, column] == UNSEEN:
        top, left = row * TILE, column * TILE
        lethal = has_lethal(cells[top : top + TILE, left : left + TILE], threshold)
        tiles[row, column] = LETHAL if lethal else EMPTY
    return tiles[row, column] == LETHAL


@jit
def has_lethal(tile: Int8s, threshold: int) -> bool:
    """Tell whether any cell of a tile is lethal."""
    found = False
    for n in range(len(tile)):
        row = tile[n]
        for column in range(row.size):
            found |= row[column] >= threshold
    return found


@jit
def squared_clearance(
    cells: Int8s, tiles: Uint8s, threshold: int, path: Int64s, limit: int, enough: int
) -> int:
    """Return the least squared distance of cells [n, 2] to a lethal one, at most `limit`.

    Or any distance to one that is at most `enough`.
    The cells are halved again and again; a part is left out if the box around it, wider by the
    least distance so far, holds no lethal cell. Fast where neighbours in `path` are near.
    """
    height, width = cells.shape
    best = limit
    firsts, lasts = np.zeros(128, dtype=np.int64), np.zeros(128, dtype=np.int64)
    lasts[0] = len(path)
    count = 1
    while count and best > enough:
        count -= 1
        first, last = firsts[count], lasts[count]
        if first == last:
            continue
        if best < NO_LETHAL and last - first > SHORT:
            left, top = path[first, 0], path[first, 1]
            right, bottom = left, top
            for n in range(first + 1, last):
                left, right = min(left, path[n, 0]), max(right, path[n, 0])
                top, bottom = min(top, path[n, 1]), max(bottom, path[n, 1])
            around = int(math.sqrt(best - 1))
            left, right = max(left - around, 0), min(right + around + 1, width)
            top, bottom = max(top - around, 0), min(bottom + around + 1, height)
            if not box_has_lethal(cells, tiles, threshold, top, bottom, left, right):
                continue
        middle = (first + last) // 2
        x, y = path[middle, 0], path[middle, 1]
        best = min(best, nearest_lethal(cells, tiles, threshold, x, y, best))
        if best == NO_LETHAL:
            break
        firsts[count], lasts[count] = first, middle
        firsts[count + 1], lasts[count + 1] = middle + 1, last
        count += 2
    return best


@jit
def box_has_lethal(
    cells: Int8s, tiles: Uint8s, threshold: int, top: int, bottom: int, left: int, right: int
) -> bool:
    """Tell whether any cell in the rows top to bottom and columns left to right is lethal."""
    for row in range(top // TILE, (bottom - 1) // TILE + 1):
        for column in range(left // TILE, (right - 1) // TILE + 1):
            if tile_has_lethal(cells, tiles, threshold, row, column):
                begin, end = max(top, row * TILE), min(bottom, (row + 1) * TILE)
                west, east = max(left, column * TILE), min(right, (column + 1) * TILE)
                if has_lethal(cells[begin:end, west:east], threshold):
                    return True
    return False


@jit
def first_blocked(rules: Rules, places: Int64s) -> int:
    """Return the index of the first blocked place (x, y) [n, 2] on the map, or -1."""
    cells, tiles, threshold, allow_unknown, reach = rules
    own = -1
    for n in range(len(places) - 1, -1, -1):
        value = cells[places[n, 1], places[n, 0]]
        if value >= threshold or (value < 0 and not allow_unknown):
            own = n
    # Of the places from `begin`, those to `end` are looked at; one to `found` is too near.
    begin, found, end = 0, 0, len(places) if own < 0 else own
    while reach > 0 and begin < end:
        if squared_clearance(cells, tiles, threshold, places[begin:end], reach + 1, reach) > reach:
            begin, end = end, found
        elif end - begin == 1:
            return begin
        else:
            found, end = end, (begin + end) // 2
    return own


@jit
def path_fault(
    rules: Rules, path: Int64s, ends: tuple[int, int, int, int], corner_cutting: bool
) -> tuple[int, int]:
    """Return the first rule that a path [n, 2], n > 0, breaks, and the index of the cell.

    `ends` is the start (x, y) and the goal (x, y). The rules are in the order of their numbers.
    """
    height, width = rules[0].shape
    first, last = path[0], path[-1]
    if first[0] != ends[0] or first[1] != ends[1] or last[0] != ends[2] or last[1] != ends[3]:
        return ENDS, 0
    for n in range(len(path)):
        if not (0 <= path[n, 0] < width and 0 <= path[n, 1] < height):
            return OUTSIDE, n
    diagonals, jump = 0, -1
    for n in range(len(path) - 2, -1, -1):
        step_x, step_y = path[n + 1, 0] - path[n, 0], path[n + 1, 1] - path[n, 1]
        if max(abs(step_x), abs(step_y)) != 1:
            jump = n
        diagonals += step_x != 0 and step_y != 0
    corners = np.empty((2 * diagonals, 2), dtype=np.int64)
    moves = np.empty(diagonals, dtype=np.int64)
    count = 0
    for n in range(len(path) - 1):
        if path[n, 0] != path[n + 1, 0] and path[n, 1] != path[n + 1, 1]:
            moves[count] = n
            corners[2 * count, 0], corners[2 * count, 1] = path[n + 1, 0], path[n, 1]
            corners[2 * count + 1, 0], corners[2 * count + 1, 1] = path[n, 0], path[n + 1, 1]
            count += 1
    n = first_blocked(rules, path)
    if n >= 0:
        return OBSTACLE, n
    if jump >= 0:
        return JUMP, jump
    if not corner_cutting:
        n = first_blocked(rules, corners)
        if n >= 0:
            return CORNER, moves[n // 2]
    return FINE, 0


@jit
def passed_cells(begin: Int64s, end: Int64s) -> Int64s:
    """Return the cells [n, 2] that a straight line between two cells passes, in turn.

    A move between them is diagonal where the line meets a corner of cells exactly.
    """
    far_x, far_y = abs(end[0] - begin[0]), abs(end[1] - begin[1])
    step_x, step_y = np.sign(end[0] - begin[0]), np.sign(end[1] - begin[1])
    passed = np.empty((far_x + far_y + 1, 2), dtype=np.int64)
    passed[0, 0], passed[0, 1] = begin[0], begin[1]
    across = along = count = 0
    while across < far_x or along < far_y:
        # It leaves the column after (2 * across + 1) / (2 * far_x) of its length, and so the row.
        to_column, to_row = (2 * across + 1) * far_y, (2 * along + 1) * far_x
        across += to_column <= to_row
        along += to_row <= to_column
        count += 1
        passed[count, 0], passed[count, 1] = begin[0] + across * step_x, begin[1] + along * step_y
    return passed[: count + 1]


@jit
def measure(cells: Int8s, tiles: Uint8s, threshold: int, path: Int64s) -> tuple[int, float, int]:
    """Return a path's squared clearance, its length in unknown cells and its turns, in cells."""
    unknown, turns = 0.0, 0
    before_x = before_y = 0
    # Outside of obstacles nothing is nearer than a cell: there the measuring ends.
    is_free = cells[path[0, 1], path[0, 0]] < threshold
    for n in range(1, len(path)):
        x, y = path[n, 0], path[n, 1]
        step_x, step_y = x - path[n - 1, 0], y - path[n - 1, 1]
        if n > 1 and (step_x != before_x or step_y != before_y):
            turns += 1
        before_x, before_y = step_x, step_y
        is_free &= cells[y, x] < threshold
        # Half of a move is in each of its two cells.
        halves = (cells[y, x] < 0) + (cells[path[n - 1, 1], path[n - 1, 0]] < 0)
        if halves:
            unknown += halves / 2.0 * math.hypot(step_x, step_y)
    # With its type, or numba compiles all of it once more for this constant.
    limit = np.int64(NO_LETHAL)
    squared = squared_clearance(cells, tiles, threshold, path, limit, np.int64(is_free))
    return squared, unknown, turns


@jit
def first_missed(path: Int64s, via: Int64s) -> int:
    """Return the index of the first cell of `via` [m, 2] that a path does not pass in turn, or -1.

    Two cells of `via` that are the same may be passed at once.
    """
    n = 0
    for number in range(len(via)):
        while n < len(path) and (path[n, 0] != via[number, 0] or path[n, 1] != via[number, 1]):
            n += 1
        if n == len(path):
            return number
    return -1


@jit
def nearest_places(path: Int32s, points: Float64s) -> Int64s:
    """Return for each of the points [m, 2] the first of its nearest cells on a path: int64 [m].

    The path, int32 [n, 2], n > 0, is of single moves: near a far cell no cell is near.
    """
    places = np.zeros(points.shape[0], dtype=np.int64)
    for number in range(points.shape[0]):
        x = points[number, 0]
        y = points[number, 1]
        # Not farther than the nearest of every 64th cell.
        limit = np.inf
        for index in range(0, path.shape[0], 64):
            limit = min(limit, (path[index, 0] - x) ** 2 + (path[index, 1] - y) ** 2)
        least = np.inf
        index = 0
        while index < path.shape[0]:
            squared = (path[index, 0] - x) ** 2 + (path[index, 1] - y) ** 2
            if squared < least:
                least = squared
                limit = min(limit, least)
                places[number] = index
            # A move brings the path nearer by its length at most.
            index += max(1, int((math.sqrt(squared) - math.sqrt(limit)) / math.sqrt(2.0)))
    return places


@jit
def invalid_poses(rules: Rules, path: Int64s, cost_limit: int) -> Bools:
    """Tell for each pose [n, 2], n > 0, of a path whether a robot cannot reach it: bool [n].

    It cannot where the cell is off the map, is blocked, or costs `cost_limit` or more, nor where
    the straight segment from the pose before, if that is more than a cell away, is blocked.
    """
    cells, tiles, threshold, allow_unknown, reach = rules
    height, width = cells.shape
    invalid = np.empty(len(path), dtype=np.bool_)
    inside = np.empty_like(path)
    count = 0
    for n in range(len(path)):
        x, y = path[n, 0], path[n, 1]
        invalid[n] = not (0 <= x < width and 0 <= y < height)
        if not invalid[n]:
            inside[count, 0], inside[count, 1] = x, y
            count += 1
            value = cells[y, x]
            invalid[n] = value >= min(threshold, cost_limit) or (value < 0 and not allow_unknown)
    # Mostly all are far enough from obstacles, which is cheaper to tell of all at once.
    near = squared_clearance(cells, tiles, threshold, inside[:count], reach + 1, reach) <= reach
    for n in range(len(path)):
        if near and not invalid[n]:
            x, y = path[n, 0], path[n, 1]
            invalid[n] = nearest_lethal(cells, tiles, threshold, x, y, reach + 1) <= reach
    blocked = invalid.copy()
    for n in range(1, len(path)):
        far = max(abs(path[n, 0] - path[n - 1, 0]), abs(path[n, 1] - path[n - 1, 1])) > 1
        if far and not (blocked[n - 1] or blocked[n]):
            invalid[n] = first_blocked(rules, passed_cells(path[n - 1], path[n])) >= 0
    return invalid
