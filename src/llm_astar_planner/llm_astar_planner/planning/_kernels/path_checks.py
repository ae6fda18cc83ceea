"""Compiled loops that hold paths against the cells of a map.

A cell is lethal from `threshold` up. `reach` is the greatest squared distance, in cells, to a
lethal cell at which another is blocked; -1 where only cells themselves count. Distances are
measured where they are needed, row by row around a cell: nothing is prepared for a map.

`tiles` remembers of the squares of TILE x TILE cells that have been looked at whether they hold
a lethal cell. It begins with zeros; threads may share it, since all write the same.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

# More than any squared distance on a map.
NO_LETHAL = 2**62
# Half the sides, in cells, of the squares that are looked at before tiles are.
NEAR_SIDES = (4, 12)
TILE = 32
# Parts of a path this short are looked at cell by cell.
SHORT = 4
UNSEEN, EMPTY, LETHAL = range(3)
# What is wrong with a path.
FINE, ENDS, OUTSIDE, OBSTACLE, JUMP, CORNER = range(6)

_jit: Any = njit(cache=True, nogil=True)


@_jit
def nearest_in_row(row: NDArray[np.int8], threshold: int, x: int, first: int, last: int) -> int:
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


@_jit
def nearest_lethal(
    cells: NDArray[np.int8], tiles: NDArray[np.uint8], threshold: int, x: int, y: int, limit: int
) -> int:
    """Return the squared distance from a cell to the nearest lethal one, at most `limit`."""
    height = len(cells)
    best = limit
    done = -1
    for side in NEAR_SIDES:
        if (done + 1) * (done + 1) >= best:
            return best
        for away in range(side + 1):
            if away * away >= best:
                break
            half = side
            if side * side + away * away >= best:
                half = int(math.sqrt(best - 1 - away * away))
            for turn in range(2 if away else 1):
                place = y - away if turn else y + away
                if not 0 <= place < height:
                    continue
                row = cells[place]
                if away > done:
                    nearest = nearest_in_row(row, threshold, x, x - half, x + half)
                else:
                    nearest = nearest_in_row(row, threshold, x, x - half, x - done - 1)
                    right = nearest_in_row(row, threshold, x, x + done + 1, x + half)
                    nearest = min(nearest, right)
                if nearest < NO_LETHAL:
                    best = min(best, nearest * nearest + away * away)
        done = side
    if (done + 1) * (done + 1) >= best:
        return best
    return nearest_by_tiles(cells, tiles, threshold, x, y, best)


@_jit
def nearest_by_tiles(
    cells: NDArray[np.int8], tiles: NDArray[np.uint8], threshold: int, x: int, y: int, best: int
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
                tile = cells[top : top + TILE, left : left + TILE]
                beside = max(left - x, 0, x - left - TILE + 1)
                for n in range(len(tile)):
                    away = abs(top + n - y)
                    if away * away + beside * beside < best:
                        nearest = nearest_in_row(tile[n], threshold, x - left, 0, TILE)
                        if nearest < NO_LETHAL:
                            best = min(best, nearest * nearest + away * away)
    return best


@_jit
def tile_has_lethal(
    cells: NDArray[np.int8], tiles: NDArray[np.uint8], threshold: int, row: int, column: int
) -> bool:
    """Tell whether a tile holds a lethal cell, and remember it."""
    if tiles[row, column] == UNSEEN:
        top, left = row * TILE, column * TILE
        lethal = has_lethal(cells[top : top + TILE, left : left + TILE], threshold)
        tiles[row, column] = LETHAL if lethal else EMPTY
    return tiles[row, column] == LETHAL


@_jit
def has_lethal(tile: NDArray[np.int8], threshold: int) -> bool:
    """Tell whether any cell of a tile is lethal."""
    found = False
    for n in range(len(tile)):
        row = tile[n]
        for column in range(row.size):
            found |= row[column] >= threshold
    return found


@_jit
def is_blocked(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    allow_unknown: bool,
    reach: int,
    x: int,
    y: int,
) -> bool:
    """Tell whether a cell of the map is blocked."""
    value = cells[y, x]
    if value >= threshold or (value < 0 and not allow_unknown):
        return True
    return reach > 0 and nearest_lethal(cells, tiles, threshold, x, y, reach + 1) <= reach


@_jit
def squared_clearance(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    path: NDArray[np.int64],
    limit: int,
) -> int:
    """Return the least squared distance of cells [n, 2] to a lethal one, at most `limit`.

    The cells are halved again and again; a part is left out if the box around it, wider by the
    least distance so far, holds no lethal cell. Fast where neighbours in `path` are near.
    """
    height, width = cells.shape
    best = limit
    parts = np.empty((128, 2), dtype=np.int64)
    parts[0] = 0, len(path)
    count = 1
    while count and best:
        count -= 1
        first, last = parts[count]
        if first == last:
            continue
        if best < NO_LETHAL and last - first > SHORT:
            left, top = path[first]
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
        x, y = path[middle]
        best = min(best, nearest_lethal(cells, tiles, threshold, x, y, best))
        if best == NO_LETHAL:
            break
        parts[count] = first, middle
        parts[count + 1] = middle + 1, last
        count += 2
    return best


@_jit
def box_has_lethal(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    top: int,
    bottom: int,
    left: int,
    right: int,
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


@_jit
def any_blocked(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    allow_unknown: bool,
    reach: int,
    places: NDArray[np.int64],
) -> bool:
    """Tell whether any of the places (x, y) [n, 2] on the map is blocked."""
    for n in range(len(places)):
        value = cells[places[n, 1], places[n, 0]]
        if value >= threshold or (value < 0 and not allow_unknown):
            return True
    return reach > 0 and squared_clearance(cells, tiles, threshold, places, reach + 1) <= reach


@_jit
def path_fault(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    allow_unknown: bool,
    reach: int,
    path: NDArray[np.int64],
    ends: tuple[int, int, int, int],
    corner_cutting: bool,
) -> tuple[int, int]:
    """Return the first rule that a path [n, 2], n > 0, breaks, and the index of the cell.

    `ends` is the start (x, y) and the goal (x, y). The rules are in the order of their numbers.
    """
    height, width = cells.shape
    first, last = path[0], path[-1]
    if first[0] != ends[0] or first[1] != ends[1] or last[0] != ends[2] or last[1] != ends[3]:
        return ENDS, 0
    for n in range(len(path)):
        if not (0 <= path[n, 0] < width and 0 <= path[n, 1] < height):
            return OUTSIDE, n
    if any_blocked(cells, tiles, threshold, allow_unknown, reach, path):
        for n in range(len(path)):
            x, y = path[n]
            if is_blocked(cells, tiles, threshold, allow_unknown, reach, x, y):
                return OBSTACLE, n
    diagonals = 0
    for n in range(len(path) - 1):
        step_x, step_y = path[n + 1, 0] - path[n, 0], path[n + 1, 1] - path[n, 1]
        if max(abs(step_x), abs(step_y)) != 1:
            return JUMP, n
        diagonals += step_x != 0 and step_y != 0
    if corner_cutting:
        return FINE, 0
    corners = np.empty((2 * diagonals, 2), dtype=np.int64)
    moves = np.empty(diagonals, dtype=np.int64)
    count = 0
    for n in range(len(path) - 1):
        if path[n, 0] != path[n + 1, 0] and path[n, 1] != path[n + 1, 1]:
            moves[count] = n
            corners[2 * count] = path[n + 1, 0], path[n, 1]
            corners[2 * count + 1] = path[n, 0], path[n + 1, 1]
            count += 1
    if any_blocked(cells, tiles, threshold, allow_unknown, reach, corners):
        for n in range(len(corners)):
            x, y = corners[n]
            if is_blocked(cells, tiles, threshold, allow_unknown, reach, x, y):
                return CORNER, moves[n // 2]
    return FINE, 0


@_jit
def segment_fault(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    allow_unknown: bool,
    reach: int,
    begin: NDArray[np.int64],
    end: NDArray[np.int64],
    corner_cutting: bool,
) -> tuple[int, int, int]:
    """Return the rule that a straight segment between two cells breaks, and the cell (x, y).

    Every cell that it passes through is looked at; then, unless `corner_cutting`, the two cells
    beside each corner of cells that it passes exactly over. Whole numbers, so exactly.
    """
    height, width = cells.shape
    far_x, far_y = abs(end[0] - begin[0]), abs(end[1] - begin[1])
    step_x, step_y = np.sign(end[0] - begin[0]), np.sign(end[1] - begin[1])
    corner = False
    corner_x = corner_y = 0
    x, y = begin
    # It leaves the column after (2 * steps + 1) / (2 * far_x) of its length, and so the row.
    across, along = 0, 0
    while True:
        if not (0 <= x < width and 0 <= y < height):
            return OUTSIDE, x, y
        if is_blocked(cells, tiles, threshold, allow_unknown, reach, x, y):
            return OBSTACLE, x, y
        if x == end[0] and y == end[1]:
            break
        to_column, to_row = (2 * across + 1) * far_y, (2 * along + 1) * far_x
        if to_column == to_row and not corner_cutting and not corner:
            corner_x, corner_y = x, y
            corner = is_blocked(cells, tiles, threshold, allow_unknown, reach, x + step_x, y)
            corner = corner or is_blocked(
                cells, tiles, threshold, allow_unknown, reach, x, y + step_y
            )
        if to_column <= to_row:
            x += step_x
            across += 1
        if to_row <= to_column:
            y += step_y
            along += 1
    return (CORNER, corner_x, corner_y) if corner else (FINE, x, y)


@_jit
def measure(
    cells: NDArray[np.int8], tiles: NDArray[np.uint8], threshold: int, path: NDArray[np.int64]
) -> tuple[int, float, int]:
    """Return a path's squared clearance, its length in unknown cells and its turns, in cells."""
    unknown, turns = 0.0, 0
    before_x = before_y = 0
    for n in range(1, len(path)):
        x, y = path[n]
        step_x, step_y = x - path[n - 1, 0], y - path[n - 1, 1]
        if n > 1 and (step_x != before_x or step_y != before_y):
            turns += 1
        before_x, before_y = step_x, step_y
        # Half of a move is in each of its two cells.
        halves = (cells[y, x] < 0) + (cells[path[n - 1, 1], path[n - 1, 0]] < 0)
        if halves:
            unknown += halves / 2.0 * math.hypot(step_x, step_y)
    squared = squared_clearance(cells, tiles, threshold, path, NO_LETHAL)
    return squared, unknown, turns


@_jit
def first_missed(path: NDArray[np.int64], via: NDArray[np.int64]) -> int:
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
