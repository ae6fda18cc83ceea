"""What a robot's owner asks of a path beside its length."""

from __future__ import annotations

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from numpy.typing import NDArray


def turns(path: NDArray[np.int32]) -> int:
    """Count the changes of direction along a path of single moves [n, 2]."""
    steps = np.diff(path, axis=0)
    return int((steps[1:] != steps[:-1]).any(axis=1).sum())


def unknown_length(path: NDArray[np.int32], grid_map: GridMap) -> float:
    """Return the metres of a path [n, 2] in unknown cells; a move is half in either of its two."""
    unknown = grid_map.cells[path[:, 1], path[:, 0]] < FREE
    if not unknown.any():
        return 0.0
    lengths = np.hypot(*np.diff(path, axis=0).T)
    shares = (unknown[1:].astype(np.float64) + unknown[:-1]) / 2.0
    return float(lengths @ shares) * grid_map.resolution
