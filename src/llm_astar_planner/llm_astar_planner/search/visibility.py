"""Lines of sight on a grid: which straight lines between cell centres meet an obstacle.

Blocked cells that touch by a side are joined by a wall without thickness, as the paper's barriers
are; an isolated one is a point. A line that touches a wall is blocked. So a line of sight is
what 8-connected moves that may cut corners can follow.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import ArrayLike, NDArray


class LineOfSightChecker:
    """The walls of one grid; `blocked` is bool [height, width]."""

    def __init__(self, blocked: NDArray[np.bool_]) -> None:
        """Find the walls of a grid."""
        lines = np.concatenate([_runs(blocked), _runs(blocked.T)[..., ::-1]])
        alone = np.argwhere(blocked & ~_has_neighbour(blocked))[:, ::-1]
        self._ends = np.unique(np.concatenate([lines.reshape(-1, 2), alone]), axis=0)
        walls = np.concatenate(
            [np.asarray(shapely.linestrings(lines)), np.asarray(shapely.points(alone))]
        )
        self._tree = shapely.STRtree(walls)

    @property
    def ends(self) -> NDArray[np.intp]:
        """The cells (x, y) at which walls end, [n, 2]."""
        ends: NDArray[np.intp] = self._ends
        return ends

    def clear(self, begins: ArrayLike, ends: ArrayLike) -> NDArray[np.bool_]:
        """Tell for each line from `begins` to `ends`, both [n, 2] cells, whether it is free."""
        pairs = np.stack([np.asarray(begins, float), np.asarray(ends, float)], axis=1)
        free = np.ones(len(pairs), dtype=bool)
        if len(pairs):
            hits = self._tree.query(shapely.linestrings(pairs), predicate='intersects')
            free[hits[0]] = False
        return free

    def clear_along(self, points: ArrayLike) -> bool:
        """Tell whether the polyline through `points` [n, 2] meets no wall."""
        points = np.asarray(points, dtype=float).reshape(-1, 2)
        if not np.isfinite(points).all():
            return False
        return bool(self.clear(points[:-1], points[1:]).all())


@lru_cache(maxsize=4)
def walls_of(grid_map: GridMap) -> LineOfSightChecker:
    """Return the walls of a map, found once a map."""
    return LineOfSightChecker(grid_map.blocked())


def _runs(blocked: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Find the maximal runs along rows, two cells or longer: first and last cells, [n, 2, 2]."""
    change = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    ys, firsts = np.nonzero(change == 1)
    lasts = np.nonzero(change == -1)[1] - 1
    runs = np.stack([np.stack([firsts, ys], axis=1), np.stack([lasts, ys], axis=1)], axis=1)
    return runs[lasts > firsts]


def _has_neighbour(blocked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which cells have a blocked cell at one of their four sides."""
    padded = np.pad(blocked, 1)
    sides: NDArray[np.bool_] = (
        padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    )
    return sides
