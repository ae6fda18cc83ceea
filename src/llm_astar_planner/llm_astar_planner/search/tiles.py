# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Connected free cells of a grid, by tiles: cheap to update where few cells change.

The grid is divided into square tiles. The connected free cells of a tile form a local component,
a node; nodes of neighbouring tiles that touch are joined (union-find), which numbers the
components of the whole grid. After a change only the tiles that it touches are labelled again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import tiles as kernels
from llm_astar_planner.search.arrays import Bools, DoubleBuffer, Int32s

# Grids of up to so many cells along the longer side have tiles of 2^2 and of 2^3 cells a side.
SMALL_GRID, MEDIUM_GRID = 256, 512
# A tile of 2^4 cells a side has at most 128 components: a byte holds their numbers.
LARGEST_SHIFT = 4

Numbers = NDArray[np.integer[Any]]
Components = Int32s


@dataclass(frozen=True, eq=False)
class Tiles:
    """The components of a grid: indexed like an array [height, width] of their numbers.

    Numbers are int32, 0 where blocked, equal where connected, not consecutive. An index is a row
    and a column: two whole numbers from 0 up, two arrays of them, or two slices. Without corner
    cutting cells that share a side are connected (a diagonal step that cuts no corner can be
    walked as two straight ones), with it also those that share a corner. Immutable.

    `tables.labels`, uint8 [height, width], holds the numbers of the local components; node
    `tables.nodes[t] + n` is number n of tile t, and `components`, int32 [nodes], are the numbers
    of their components. The contacts of tile t begin at `tables.starts[t]`, see `_kernels.tiles`.
    """

    tables: kernels.TileTables
    components: Int32s

    @classmethod
    def build(
        cls, blocked: ArrayLike, shift: int | None = None, *, corner_cutting: bool = False
    ) -> Tiles:
        """Divide `blocked`, bool [height, width], into tiles of 2^shift cells a side: O(cells).

        `shift` is at most 4; by default tiles have 4 cells a side up to 256 cells along the longer
        side of the grid, 8 up to 512, and 16 beyond. Raises ValueError on a wrong shape.
        """
        grid = np.ascontiguousarray(blocked, dtype=np.bool_)
        if grid.ndim != 2 or grid.size == 0:
            raise ValueError(f'blocked: shape {grid.shape} is not [height, width]')
        if shift is None:
            side = max(grid.shape)
            shift = 2 if side <= SMALL_GRID else 3 if side <= MEDIUM_GRID else LARGEST_SHIFT
        rows, columns = (((size - 1) >> shift) + 1 for size in grid.shape)
        labels = np.empty(grid.shape, dtype=np.uint8)
        changed = np.ones((rows, columns), dtype=np.bool_)
        counts = np.empty((rows, columns), dtype=np.int32)
        starts, contacts = np.zeros(counts.size + 1, dtype=np.int32), np.empty(0, dtype=np.uint32)
        tables = kernels.TileTables(
            labels, shift, corner_cutting, counts, starts, starts, contacts
        )
        kernels.label_tiles(tables, grid, changed)
        return joined(tables, changed)

    def updated(
        self, blocked: Bools, windows: ArrayLike, buffer: DoubleBuffer | None = None
    ) -> Tiles:
        """Return the tiles of a grid that differs only inside of `windows`.

        They are int [n, 4], (top, bottom, left, right), half open, on the grid; `buffer` is that
        of a series of grids. The result is equal to one built from nothing. Raises ValueError if
        the grid has another shape.
        """
        if blocked.shape != self.shape:
            raise ValueError(f'blocked: shape {blocked.shape} is not {self.shape}')
        tables, shift = self.tables, self.tables.shift
        changed = np.zeros(tables.counts.shape, dtype=np.bool_)
        last = (1 << shift) - 1
        cells = np.asarray(windows, dtype=np.int64).reshape(-1, 4)
        touched = cells + (0, last, 0, last) >> shift
        for top, bottom, left, right in touched.tolist():
            changed[top:bottom, left:right] = True
        old, _, cutting, count, nodes, starts, contacts = tables
        buffer, counts = buffer or DoubleBuffer(), count.copy()
        labels = buffer.copy('labels', old, touched << shift, self.shape)
        tables = kernels.TileTables(labels, shift, cutting, counts, nodes, starts, contacts)
        kernels.label_tiles(tables, np.ascontiguousarray(blocked), changed)
        return joined(tables, changed)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the grid in cells."""
        height, width = self.tables.labels.shape
        return height, width

    def at(self, cell: tuple[int, int]) -> int:
        """Return the number of the component of a cell (x, y), 0 also where it is off the grid."""
        x, y = cell
        labels, shift, _, counts, nodes, _, _ = self.tables
        if not (0 <= y < labels.shape[0] and 0 <= x < labels.shape[1]):
            return 0
        tile = (y >> shift) * counts.shape[1] + (x >> shift)
        return int(self.components.item(nodes.item(tile) + labels.item(y, x)))

    @overload
    def __getitem__(self, index: tuple[int, int]) -> int: ...

    @overload
    def __getitem__(self, index: tuple[slice, slice] | tuple[Numbers, Numbers]) -> Components: ...

    def __getitem__(self, index: tuple[Any, Any]) -> int | Components:
        """Return the number of the component of a cell, or of an array of cells."""
        rows, columns = index
        labels, shift, _, counts, nodes, _, _ = self.tables
        label = labels[rows, columns]
        if isinstance(rows, slice):
            rows = np.arange(labels.shape[0])[rows, None]
        if isinstance(columns, slice):
            columns = np.arange(labels.shape[1])[columns]
        tile = (rows >> shift) * counts.shape[1] + (columns >> shift)
        number: int | Components = self.components[nodes[tile] + label]
        return number


def joined(tables: kernels.TileTables, changed: Bools) -> Tiles:
    """Return labelled tiles, joined by their contacts.

    Those between tiles that are not marked in `changed` [rows, columns] are taken over.
    """
    labels, shift, corner_cutting, counts, _, _, old_contacts = tables
    nodes = np.zeros(counts.size + 1, dtype=np.int32)
    np.cumsum(counts.ravel() + 1, out=nodes[1:])
    starts = np.empty(counts.size + 1, dtype=np.int32)
    stale = changed.copy()  # the tiles whose own cells or neighbours have changed
    stale[:, :-1] |= changed[:, 1:]
    stale[:-1] |= changed[1:]
    if corner_cutting:
        stale[:-1, :-1] |= changed[1:, 1:]
        stale[:-1, 1:] |= changed[1:, :-1]
    # At most every second cell of a border begins a run; corners may connect any cell to three.
    most = (6 << shift) + 2 if corner_cutting else 1 << shift
    contacts = np.empty(old_contacts.size + int(stale.sum()) * most, dtype=np.uint32)
    kernels.find_contacts(tables, stale, starts, contacts)
    contacts = contacts[: starts[-1]].copy()
    components = np.empty(nodes[-1], dtype=np.int32)
    kernels.join_tiles(nodes, counts.shape[1], starts, contacts, components)
    tables = kernels.TileTables(labels, shift, corner_cutting, counts, nodes, starts, contacts)
    return Tiles(tables, components)
