"""Follow next hops to routes as the planner does, and tell whether every leg is in sight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from llm_astar_planner.waypoints.learned.source import Route, follow
from numpy.typing import NDArray


def greedy_routes(logits: NDArray[np.float32], usable: NDArray[np.bool_]) -> list[Route]:
    """Return each problem's greedy route; `logits` is [n, N, N], `usable` [n, N]."""
    return [follow(*problem) for problem in zip(logits, usable)]


def valid_ratio(routes: Sequence[Route], apart: NDArray[np.float32]) -> float:
    """Return the part of the routes whose legs all see each other; `apart` is [n, N, N]."""
    valid = [np.isfinite(apart[n, route[:-1], route[1:]]).all() for n, route in enumerate(routes)]
    return float(np.mean(valid))
