"""Compiled loops of lines of sight between walls without thickness."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_jit: Any = njit(cache=True, nogil=True)


@_jit
def line_is_free(
    padded: NDArray[np.bool_], x: int, y: int, to_x: int, to_y: int, scale: int
) -> bool:
    """Tell whether a straight line touches no wall; a wall joins blocked cells that share a side.

    `padded` are the blocked cells in a ring of free ones. The ends are in cells, times `scale`:
    whole numbers, so that nothing is rounded. The line is looked at where it crosses the centres
    of a column or of a row, and at its beginning, as it may cross none.
    """
    height = padded.shape[0] - 2
    width = padded.shape[1] - 2
    delta_x = to_x - x
    delta_y = to_y - y
    for along in range(2):
        # Columns first; then rows, as columns of the map transposed.
        first = max(0, -(-min(x, to_x) // scale))
        last = min(width - 1, max(x, to_x) // scale)
        if delta_x == 0 and x % scale != 0:
            last = -1
        for column in range(first, last + 1):
            if delta_x == 0:
                above, size = y, scale
            else:
                above = y * delta_x + (column * scale - x) * delta_y
                size = delta_x * scale
            if size < 0:
                above, size = -above, -size
            row = above // size
            if -1 <= row < height:
                here = padded[row + 1, column + 1] if along == 0 else padded[column + 1, row + 1]
                if here and row * size == above:
                    return False
                after = padded[row + 2, column + 1] if along == 0 else padded[column + 1, row + 2]
                if here and after:
                    return False
        x, y, to_x, to_y = y, x, to_y, to_x
        delta_x, delta_y = delta_y, delta_x
        height, width = width, height
    return True


@_jit
def lines_are_free(padded: NDArray[np.bool_], lines: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell it for each of the `lines` [n, 4]: x and y of both ends, in cells."""
    free = np.empty(len(lines), dtype=np.bool_)
    for index in range(len(lines)):
        x, y, to_x, to_y = lines[index]
        free[index] = line_is_free(padded, x, y, to_x, to_y, 1)
    return free
