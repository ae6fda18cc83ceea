"""Compiled loop over the poses of a path from any planner. The rules are those of path_checks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning._kernels.path_checks import (
    FINE,
    nearest_lethal,
    segment_fault,
    squared_clearance,
)
from llm_astar_planner.search.kernel_cache import jit


@jit
def invalid_poses(
    cells: NDArray[np.int8],
    tiles: NDArray[np.uint8],
    threshold: int,
    allow_unknown: bool,
    reach: int,
    path: NDArray[np.int64],
    cost_limit: int,
) -> NDArray[np.bool_]:
    """Tell for each pose [n, 2], n > 0, of a path whether a robot cannot reach it: bool [n].

    It cannot where the cell is off the map, is blocked, or costs `cost_limit` or more, nor where
    the straight segment from the pose before, if that is more than a cell away, is blocked.
    """
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
    near = squared_clearance(cells, tiles, threshold, inside[:count], reach + 1) <= reach
    for n in range(len(path)):
        if near and not invalid[n]:
            x, y = path[n, 0], path[n, 1]
            invalid[n] = nearest_lethal(cells, tiles, threshold, x, y, reach + 1) <= reach
    blocked = invalid.copy()
    for n in range(1, len(path)):
        far = max(abs(path[n, 0] - path[n - 1, 0]), abs(path[n, 1] - path[n - 1, 1])) > 1
        if far and not (blocked[n - 1] or blocked[n]):
            fault = segment_fault(
                cells, tiles, threshold, allow_unknown, reach, path[n - 1], path[n], True
            )
            invalid[n] = fault[0] != FINE
    return invalid
