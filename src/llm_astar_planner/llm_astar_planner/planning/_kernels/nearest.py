"""Compiled loops that find places along a path."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.kernel_cache import jit


@jit
def nearest_places(path: NDArray[np.int32], points: NDArray[np.float64]) -> NDArray[np.int64]:
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
