"""Compiled loops that prepare a grid for search: legal moves and surcharges.

Both fill windows (top, bottom, left, right) in cells, half open. The bits of a move are those
of `_kernels.astar`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_jit: Any = njit(cache=True, nogil=True)


@_jit
def build_moves(
    blocked: NDArray[np.bool_],
    corner_cutting: bool,
    windows: NDArray[np.int64],
    moves: NDArray[np.uint8],
) -> None:
    """Fill `moves` [height * width] with the legal moves of each free cell, 0 where blocked.

    A diagonal needs both adjacent cardinal cells free unless `corner_cutting`. Bits without
    branches, so that the compiler handles many cells at once.
    """
    height, width = blocked.shape
    cutting = 1 if corner_cutting else 0
    for n in range(len(windows)):
        top, bottom, left, right = windows[n]
        size = right - left
        first, last = max(left - 1, 0), min(right + 1, width)
        # Whether cells are free, in three rows and with a column more on either side.
        free = np.zeros((3, size + 2), dtype=np.uint8)
        for y in range(top - 1, bottom + 1):
            above = free[(y + 3) % 3]
            above[:] = 0
            if 0 <= y < height:
                row = blocked[y, first:last]
                inner = above[first - left + 1 : last - left + 1]
                for x in range(row.size):
                    inner[x] = not row[x]
            if y <= top:
                continue
            here, below = free[(y + 2) % 3], free[(y + 1) % 3]
            start = (y - 1) * width + left
            out = moves[start : start + size]
            for x in range(size):
                east, west, up, down = here[x + 2], here[x], above[x + 1], below[x + 1]
                mask = east | up << 1 | west << 2 | down << 3
                mask |= (above[x + 2] & (east & up | cutting)) << 4
                mask |= (above[x] & (west & up | cutting)) << 5
                mask |= (below[x] & (west & down | cutting)) << 6
                mask |= (below[x + 2] & (east & down | cutting)) << 7
                out[x] = mask * here[x + 1]


@_jit
def fill_surcharges(
    cost: NDArray[np.int8],
    table: NDArray[np.uint16],
    windows: NDArray[np.int64],
    surcharges: NDArray[np.uint16],
) -> None:
    """Fill `surcharges` [height * width] from `cost` [height, width] by a table of 256."""
    width = cost.shape[1]
    for n in range(len(windows)):
        top, bottom, left, right = windows[n]
        for y in range(top, bottom):
            row = cost[y, left:right]
            out = surcharges[y * width + left : y * width + right]
            for x in range(row.size):
                out[x] = table[np.uint8(row[x])]
