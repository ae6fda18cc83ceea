"""Which way a robot looks along a path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def headings(points: NDArray[np.float64], goal_yaw: float | None = None) -> list[float]:
    """Return a yaw in radians for each of the points [n, 2]: towards the next.

    The last is `goal_yaw` where given, else that of the one before it.
    """
    if len(points) == 0:
        return []
    steps = np.diff(points, axis=0)
    yaws: list[float] = np.arctan2(steps[:, 1], steps[:, 0]).tolist()
    last = yaws[-1] if yaws else 0.0
    return [*yaws, last if goal_yaw is None else goal_yaw]
