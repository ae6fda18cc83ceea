"""Lines of sight on a grid: which straight lines between cell centres touch an obstacle.

Blocked cells that share a side form a wall without thickness through their centres, like the
paper's barriers; an isolated blocked cell is a point. A line that touches a wall is blocked. So
where a line of sight is free, 8-connected moves that may cut corners can follow it.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray


class LineOfSightChecker:
    """The walls of one grid; `blocked` is bool [height, width]."""

    def __init__(self, blocked: NDArray[np.bool_]) -> None:
        """Find the walls of a grid."""
        lines = np.concatenate([runs_along_rows(blocked), runs_along_rows(blocked.T)[..., ::-1]])
        padded = np.pad(blocked, 1)
        has_neighbour = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
        isolated = np.argwhere(blocked & ~has_neighbour)[:, ::-1]
        self._ends = np.unique(np.concatenate([lines.reshape(-1, 2), isolated]), axis=0)
        walls = np.concatenate(
            [np.asarray(shapely.linestrings(lines)), np.asarray(shapely.points(isolated))]
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
        """Tell whether the polyline through `points` [n, 2] touches no wall."""
        points = np.asarray(points, dtype=float).reshape(-1, 2)
        if not np.isfinite(points).all():
            return False
        return bool(self.clear(points[:-1], points[1:]).all())


def runs_along_rows(blocked: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Find the maximal runs of two or more blocked cells in a row: first and last, [n, 2, 2]."""
    change = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    ys, firsts = np.nonzero(change == 1)
    lasts = np.nonzero(change == -1)[1] - 1
    runs = np.stack([np.stack([firsts, ys], axis=1), np.stack([lasts, ys], axis=1)], axis=1)
    return runs[lasts > firsts]
