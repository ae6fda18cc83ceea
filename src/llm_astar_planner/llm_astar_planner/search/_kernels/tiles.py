# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops over square tiles of a grid: connected cells in a tile, and between tiles.

A tile has 2^shift cells a side, fewer at the right and lower edge of the grid; tiles are numbered
row by row. Its connected free cells form local components, numbered from 1 in the order of their
first cells. A contact says that a component of a tile touches one of a neighbouring tile: a
uint32 of both numbers, which neighbour it is, and which cells of the tile's border.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int32s, Uint8s, Uint32s
from llm_astar_planner.search.kernel_cache import jit

# The neighbours that a tile keeps its contacts with: +x, +y, +x+y, -x+y.
EAST, SOUTH, SOUTH_EAST, SOUTH_WEST = range(4)
# A contact: the number in the tile, that in the neighbour, the neighbour, and the first and the
# last cell on the border, counted from the tile's corner.
NUMBER_BITS = 10
SIDE_SHIFT = 2 * NUMBER_BITS
FIRST_SHIFT = SIDE_SHIFT + 2
LAST_SHIFT = FIRST_SHIFT + 5
NUMBER_MASK = (1 << NUMBER_BITS) - 1


class TileTables(NamedTuple):
    """The tiles of a grid; `search.tiles.Tiles` describes them."""

    labels: Uint8s  # [height, width]
    shift: int
    corner_cutting: bool
    counts: Int32s  # [rows, columns]
    nodes: Int32s  # [tiles + 1]
    starts: Int32s  # [tiles + 1]
    contacts: Uint32s


@jit
def label_tiles(tiles: TileTables, blocked: Bools, changed: Bools) -> None:
    """Give numbers to the local components of the tiles marked in `changed` [rows, columns].

    Fills `tiles.labels`, 0 where blocked, and `tiles.counts`, how many each tile has. Cells that
    share a side are connected, with corner cutting also diagonal ones.
    """
    labels, shift, corner_cutting, counts, _, _, _ = tiles
    parents = np.empty((1 << 2 * shift) // 2 + 2, dtype=np.int32)
    for row in range(changed.shape[0]):
        for column in range(changed.shape[1]):
            if changed[row, column]:
                window = tile_window(labels, shift, row, column)
                counts[row, column] = label_tile(blocked, corner_cutting, labels, parents, window)


@jit
def tile_window(labels: Uint8s, shift: int, row: int, column: int) -> tuple[int, int, int, int]:
    """Return the cells of a tile: top, bottom, left, right, half open."""
    height, width = labels.shape
    top, left = row << shift, column << shift
    return top, min(top + (1 << shift), height), left, min(left + (1 << shift), width)


@jit
def label_tile(
    blocked: Bools,
    corner_cutting: bool,
    labels: Uint8s,
    parents: Int32s,
    window: tuple[int, int, int, int],
) -> int:
    """Label the components of the tile of a window; return how many."""
    top, bottom, left, right = window
    taken = 0
    for y in range(top, bottom):
        for x in range(left, right):
            taken += blocked[y, x]
            labels[y, x] = not blocked[y, x]
    if taken == 0 or taken == (bottom - top) * (right - left):
        return 1 if taken == 0 else 0
    found = 0
    roots = 0
    for y in range(top, bottom):
        for x in range(left, right):
            if blocked[y, x]:
                continue
            label = np.int64(labels[y, x - 1]) if x > left else 0
            if y > top:
                first = x - 1 if corner_cutting and x > left else x
                last = x + 1 if corner_cutting and x + 1 < right else x
                for other_x in range(first, last + 1):
                    other = np.int64(labels[y - 1, other_x])
                    if label == 0:
                        label = other
                    elif other != 0 and other != label:
                        roots -= join(parents, label, other)
            if label == 0:
                found += 1
                roots += 1
                label = found
                parents[label] = label
            labels[y, x] = label
    if roots == found:
        return found
    # Number the roots in order; a parent is never larger than its child.
    roots = 0
    for label in range(1, found + 1):
        if parents[label] == label:
            roots += 1
            parents[label] = roots
        else:
            parents[label] = parents[parents[label]]
    for y in range(top, bottom):
        for x in range(left, right):
            if labels[y, x]:
                labels[y, x] = parents[labels[y, x]]
    return roots


@jit
def join(parents: Int32s, one: int, other: int) -> int:
    """Join two sets; the smaller root becomes that of both. Return 1 if they were two, else 0."""
    while parents[one] != one:
        parents[one] = parents[parents[one]]
        one = parents[one]
    while parents[other] != other:
        parents[other] = parents[parents[other]]
        other = parents[other]
    if one == other:
        return 0
    parents[max(one, other)] = min(one, other)
    return 1


@jit
def find_contacts(tiles: TileTables, stale: Bools, starts: Int32s, contacts: Uint32s) -> None:
    """List the contacts of all tiles, tile after tile, those of tile t from `starts[t]` on.

    Tiles that are not marked in `stale` [rows, columns] have those that are in `tiles`.
    """
    rows, columns = stale.shape
    # Whole numbers are written with their type where a constant would have a function of it
    # compiled once more for that value.
    count = np.int64(0)
    for row in range(rows):
        for column in range(columns):
            tile = row * columns + column
            starts[tile] = count
            if stale[row, column]:
                count = tile_contacts(tiles, row, column, contacts, count)
            else:
                for old in range(tiles.starts[tile], tiles.starts[tile + 1]):
                    contacts[count] = tiles.contacts[old]
                    count += 1
    starts[rows * columns] = count


@jit
def tile_contacts(tiles: TileTables, row: int, column: int, contacts: Uint32s, count: int) -> int:
    """Append the contacts of one tile to `contacts`, of which there are `count`; return how many.

    Each run of cells that are free on both sides of the border is one contact. With corner
    cutting the diagonal neighbours across the border count too.
    """
    labels, cutting = tiles.labels, tiles.corner_cutting
    height, width = labels.shape
    top, bottom, left, right = tile_window(labels, tiles.shift, row, column)
    if right < width:
        size, side = bottom - top, np.int64(EAST)
        count = border_contacts(labels, cutting, top, right - 1, size, side, contacts, count)
    if bottom < height:
        size, side = right - left, np.int64(SOUTH)
        count = border_contacts(labels, cutting, bottom - 1, left, size, side, contacts, count)
    if cutting and bottom < height:
        for corner, x, other_x in ((SOUTH_EAST, right - 1, right), (SOUTH_WEST, left, left - 1)):
            number = np.int64(labels[bottom - 1, x])
            if 0 <= other_x < width and number and labels[bottom, other_x]:
                other, place = np.int64(labels[bottom, other_x]), x - left
                contacts[count] = pack(number, other, np.int64(corner), place, place)
                count += 1
    return count


@jit
def border_contacts(
    labels: Uint8s, cutting: bool, y: int, x: int, size: int, side: int, contacts: Any, count: int
) -> int:
    """Append the contacts across one border of a tile: `size` cells from (x, y) on."""
    along_y = 1 if side == EAST else 0
    along_x = 1 - along_y
    begin: Any = np.int64(-1)
    number: Any = np.int64(0)
    other: Any = number
    for place in range(size + 1):
        inner: Any = np.int64(0)
        outer: Any = inner
        if place < size:
            inner = np.int64(labels[y, x])
            outer = np.int64(labels[y + along_x, x + along_y])
        is_open = inner != 0 and outer != 0
        if is_open and begin < 0:
            begin, number, other = place, inner, outer
        elif not is_open and begin >= 0:
            contacts[count] = pack(number, other, side, begin, place - 1)
            count += 1
            begin = np.int64(-1)
        if cutting and inner != 0:
            for step in (-1, 1):
                if 0 <= place + step < size:
                    beside_y, beside_x = y + along_y * step, x + along_x * step
                    outer = np.int64(labels[beside_y + along_x, beside_x + along_y])
                    if outer != 0:
                        contacts[count] = pack(inner, outer, side, place, place)
                        count += 1
        y += along_y
        x += along_x
    return count


@jit
def pack(number: Any, other: Any, neighbour: int, first: int, last: int) -> Any:
    """Return a contact."""
    return (
        np.int64(number)
        | np.int64(other) << NUMBER_BITS
        | neighbour << SIDE_SHIFT
        | first << FIRST_SHIFT
        | last << LAST_SHIFT
    )


@jit
def join_tiles(
    nodes: Int32s, columns: int, starts: Int32s, contacts: Uint32s, components: Int32s
) -> None:
    """Fill `components` with the number of the component of the whole grid of each node.

    Node `nodes[t] + n` is the local component n of tile t; n = 0 stands for the tile's blocked
    cells and gets 0. The others get the number of the first node that they are connected to.
    """
    for node in range(components.size):
        components[node] = node
    steps = np.array([1, columns, columns + 1, columns - 1])
    for tile in range(nodes.size - 1):
        for index in range(starts[tile], starts[tile + 1]):
            contact = np.int64(contacts[index])
            other_tile = tile + steps[(contact >> SIDE_SHIFT) & 3]
            one = nodes[tile] + (contact & NUMBER_MASK)
            other = nodes[other_tile] + ((contact >> NUMBER_BITS) & NUMBER_MASK)
            if components[one] != components[other]:
                join(components, one, other)
    for node in range(components.size):
        components[node] = components[components[node]]
    for tile in range(nodes.size - 1):
        components[nodes[tile]] = 0
