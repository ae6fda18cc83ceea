"""Follow next hops to a route, and tell whether every leg of it is in sight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def follow(logits: NDArray[np.float32]) -> list[list[int]]:
    """Return each problem's greedy route from node 0 to node 1; no node is visited twice."""
    return [_follow(rows) for rows in logits]


def valid_ratio(routes: list[list[int]], apart: NDArray[np.float32]) -> float:
    """Return the part of the routes whose legs all see each other; `apart` is [n, N, N]."""
    valid = [np.isfinite(apart[n, route[:-1], route[1:]]).all() for n, route in enumerate(routes)]
    return float(np.mean(valid))


def _follow(rows: NDArray[np.float32]) -> list[int]:
    rows = rows.copy()
    route = [0]
    while route[-1] != 1:
        rows[:, route[-1]] = -np.inf
        route.append(int(rows[route[-1]].argmax()))
    return route
