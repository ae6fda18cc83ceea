"""Random barrier maps for training, compiled: the recipe of the paper's appendix and wider ones.

A barrier is (horizontal, line, first, last) with both ends inclusive, in cells from (0, 0); the
outermost cells of a map are walls. All maps of a batch have the same number of barriers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
jit: Any = njit(cache=True, nogil=True)

RECIPE, SCALED, SCATTERED, ROOMS, BOXES = range(5)
KINDS = ('recipe', 'scaled', 'scattered', 'rooms', 'boxes')
# The paper's map: lattice points 0..50 and 0..30, one to four barriers per direction.
WIDTH, HEIGHT = 51, 31
MAX_PARALLEL = 4
MIN_BARRIER = 3
MIN_GAP = 2
MAX_SCALE = 10
# The wider maps: range of the longer side in cells, minimum of the shorter, maximum aspect ratio.
MIN_LONG, MAX_LONG, MIN_SHORT = 11, 330, 8
MAX_ASPECT = 4.0
TRIES = 200


@jit
def draw_between(low: int, high: int) -> int:
    """Draw a whole number, both ends included."""
    return np.random.randint(low, high + 1)


@jit
def is_blocked(barriers: Ints, width: int, height: int, x: int, y: int) -> bool:
    """Tell whether a cell is off the map, in its outermost cells or on a barrier."""
    if x < 1 or y < 1 or x > width - 2 or y > height - 2:
        return True
    for k in range(barriers.shape[0]):
        across, along = (y, x) if barriers[k, 0] else (x, y)
        if across == barriers[k, 1] and barriers[k, 2] <= along <= barriers[k, 3]:
            return True
    return False


@jit
def is_too_near(barriers: Ints, count: int) -> bool:
    """Tell whether barrier `count` is nearer to an earlier parallel one than the recipe allows."""
    for k in range(count):
        if barriers[k, 0] != barriers[count, 0]:
            continue
        across = barriers[k, 1] - barriers[count, 1]
        along = max(barriers[k, 2] - barriers[count, 3], barriers[count, 2] - barriers[k, 3], 0)
        if across * across + along * along < MIN_GAP * MIN_GAP:
            return True
    return False


@jit
def draw_recipe(barriers: Ints) -> bool:
    """Fill `barriers` by the appendix's recipe on 51 x 31; False if there was no room."""
    total = barriers.shape[0]
    least = max(1, total - MAX_PARALLEL)
    horizontal = draw_between(least, min(MAX_PARALLEL, total - 1))
    for k in range(total):
        is_horizontal = k < horizontal
        across = HEIGHT - 1 if is_horizontal else WIDTH - 1
        along = WIDTH - 1 if is_horizontal else HEIGHT - 1
        for _ in range(TRIES):
            a, b = draw_between(0, along), draw_between(0, along)
            line = draw_between(1, across - 1)
            barriers[k] = int(is_horizontal), line, min(a, b), max(a, b)
            if abs(a - b) >= MIN_BARRIER and not is_too_near(barriers, k):
                break
        else:
            return False
    return True


@jit
def draw_scattered(barriers: Ints, first: int, width: int, height: int, reach: float) -> None:
    """Fill from `first` on with barriers up to `reach` times a side; they may touch and cross."""
    for k in range(first, barriers.shape[0]):
        is_horizontal = np.random.random() < 0.5
        across = height if is_horizontal else width
        along = width if is_horizontal else height
        length = 0
        if np.random.random() > 0.1:
            length = int(np.random.random() * reach * along)
        begin = draw_between(-length // 2, along - 1 - length // 2)
        line = draw_between(1, across - 2)
        end = min(max(begin + length, 0), along - 1)
        barriers[k] = int(is_horizontal), line, min(max(begin, 0), along - 1), end


@jit
def draw_rooms(barriers: Ints, width: int, height: int) -> None:
    """Fill with walls across the map, each interrupted by one or two doors."""
    k = 0
    total = barriers.shape[0]
    while k < total:
        is_horizontal = np.random.random() * (width + height) < height
        across = height if is_horizontal else width
        along = width if is_horizontal else height
        line = draw_between(2, across - 3)
        begin = 0 if np.random.random() < 0.6 else draw_between(0, along // 2)
        end = along - 1 if np.random.random() < 0.6 else draw_between(along // 2, along - 1)
        for door in range(draw_between(1, 2) + 1):
            if k == total or begin > end:
                break
            stop = draw_between(begin, end)
            if door == 2 or k == total - 1:
                stop = end if np.random.random() < 0.5 else stop
            barriers[k] = int(is_horizontal), line, begin, stop
            begin = stop + 2 + draw_between(0, max(1, along // 12))
            k += 1


@jit
def draw_boxes(barriers: Ints, width: int, height: int) -> None:
    """Fill with the outlines of boxes, and the remainder with short barriers."""
    k = 0
    while k + 4 <= barriers.shape[0]:
        box_x, box_y = draw_between(1, max(1, width // 3)), draw_between(1, max(1, height // 3))
        left, low = draw_between(0, width - 1 - box_x), draw_between(0, height - 1 - box_y)
        right, high = left + box_x, low + box_y
        barriers[k], barriers[k + 1] = (1, low, left, right), (1, high, left, right)
        barriers[k + 2], barriers[k + 3] = (0, left, low, high), (0, right, low, high)
        k += 4
    draw_scattered(barriers, k, width, height, 0.3)


@jit
def draw_map(kind: int, barriers: Ints, size: Ints) -> bool:
    """Draw the size and barriers of one map in place; False if the recipe found no room."""
    if kind in (RECIPE, SCALED):
        size[0], size[1] = WIDTH, HEIGHT
        return draw_recipe(barriers)
    side = MIN_LONG * math.exp(np.random.random() * math.log(MAX_LONG / MIN_LONG))
    other = max(MIN_SHORT, side * math.exp(-np.random.random() * math.log(MAX_ASPECT)))
    flip = np.random.random() < 0.5
    size[0] = int(other if flip else side)
    size[1] = int(side if flip else other)
    if kind == ROOMS:
        draw_rooms(barriers, size[0], size[1])
    elif kind == BOXES:
        draw_boxes(barriers, size[0], size[1])
    else:
        most = min(1.0, 3.5 / math.sqrt(barriers.shape[0] + 1.0))
        draw_scattered(barriers, 0, size[0], size[1], 0.1 + np.random.random() * most)
    return True


@jit
def scale_map(barriers: Ints, size: Ints, endpoints: Ints, factor: int) -> None:
    """Multiply every coordinate by `factor`, as the paper's scaled environments do."""
    # Loops compile in a tenth of the time that array arithmetic takes.
    for k in range(barriers.shape[0]):
        for column in range(1, 4):
            barriers[k, column] *= factor
    for axis in range(2):
        size[axis] *= factor
        endpoints[0, axis] *= factor
        endpoints[1, axis] *= factor


@jit
def draw_endpoints(barriers: Ints, size: Ints, endpoints: Ints) -> bool:
    """Draw start and goal among the free cells; False if hardly any cell is free."""
    for which in range(2):
        for _ in range(TRIES):
            x, y = draw_between(1, size[0] - 2), draw_between(1, size[1] - 2)
            if not is_blocked(barriers, size[0], size[1], x, y):
                endpoints[which, 0], endpoints[which, 1] = x, y
                break
        else:
            return False
    return True
