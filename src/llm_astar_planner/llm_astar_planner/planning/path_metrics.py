"""Figures of a path that a robot's owner asks for, besides its length."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from numpy.typing import NDArray


class DistanceLookup(Protocol):
    """Knows how far cells are from the nearest lethal one."""

    def distances(self, cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the distance of cells (x, y) [n, 2] in cells: float64 [n]."""


class PathMetrics(NamedTuple):
    """Metres to the nearest lethal cell, metres through unknown cells, changes of direction."""

    clearance: float
    unknown_length: float
    turns: int


def path_metrics(
    path: NDArray[np.int32], grid_map: GridMap, lookup: DistanceLookup
) -> PathMetrics:
    """Measure a path of single moves [n, 2], n > 0, on a map."""
    clearance = float(lookup.distances(path).min()) * grid_map.resolution
    return PathMetrics(clearance, unknown_length(path, grid_map), count_turns(path))


def count_turns(path: NDArray[np.int32]) -> int:
    """Count the changes of direction along a path of single moves [n, 2]."""
    steps = np.diff(path, axis=0)
    return int((steps[1:] != steps[:-1]).any(axis=1).sum())


def unknown_length(path: NDArray[np.int32], grid_map: GridMap) -> float:
    """Return the metres of a path [n, 2] in unknown cells; half of a move is in each cell."""
    unknown = grid_map.cells[path[:, 1], path[:, 0]] < FREE
    if not unknown.any():
        return 0.0
    lengths = np.hypot(*np.diff(path, axis=0).T)
    shares = (unknown[1:].astype(np.float64) + unknown[:-1]) / 2.0
    return float(lengths @ shares) * grid_map.resolution
