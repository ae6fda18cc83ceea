"""Where a path from anywhere, not only from this planner, can no longer be followed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning.path_validator import legs_problem


def invalid_poses(
    cells: NDArray[np.int32], blocked: NDArray[np.bool_], first: int = 0
) -> list[int]:
    """Return the indices of the poses, `first` and later, that a robot cannot get to.

    `cells` is [n, 2], the cell (x, y) of each pose; poses may lie any distance apart. One is
    invalid where it is off the map or on `blocked` [height, width], or where the straight leg
    that leads to it is.
    """
    height, width = blocked.shape
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    invalid: NDArray[np.bool_] = np.logical_not(inside)
    invalid[inside] = blocked[cells[inside, 1], cells[inside, 0]]
    far = np.abs(np.diff(cells, axis=0)).max(axis=1, initial=0) > 1
    for index in np.flatnonzero(far[first:]) + first:
        if not (invalid[index] or invalid[index + 1]):
            leg = cells[index : index + 2]
            invalid[index + 1] = legs_problem(leg, blocked, corner_cutting=True) is not None
    invalid[:first] = False
    return [int(index) for index in np.flatnonzero(invalid)]


def nearest_pose(points: NDArray[np.float64], x: float, y: float) -> int:
    """Return the index of the point [n, 2] of a path that is nearest to (x, y), n > 0."""
    return int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))
