"""Applies map_msgs/OccupancyGridUpdate, a rectangle of new cells, to a GridMap.

map_msgs need not be installed: an update is any object with its fields.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap, GridMapError
from llm_astar_msgs_adapter.messages.fields import stamp_of


class GridUpdate(Protocol):
    """The fields of map_msgs/OccupancyGridUpdate: a rectangle of cells, row by row from (x, y)."""

    header: Any
    x: int
    y: int
    width: int
    height: int
    data: Sequence[int]


def is_outdated(update: GridUpdate, map_time: int) -> bool:
    """Tell whether an update is older than a whole map stamped `map_time` (ns).

    Such a map contains the update already; they arrive in any order, on two topics. An update
    with stamp 0 is never outdated.
    """
    return 0 < stamp_of(update) < map_time


def updated(grid_map: GridMap, update: GridUpdate) -> GridMap:
    """Return the map with the update's cells in it. An empty frame means the map's.

    Raises GridMapError, naming the field, for an update in another frame, one that does not lie
    on the map, one with too few cells, and for values that are no occupancy.
    """
    frame_id = update.header.frame_id
    if frame_id not in ('', grid_map.frame_id):
        problem = f'{frame_id!r} is not the frame of the map, {grid_map.frame_id!r}'
        raise GridMapError('header.frame_id', problem)
    x, y, width, height = update.x, update.y, update.width, update.height
    corner_ok = x >= 0 and y >= 0 and width > 0 and height > 0
    if not corner_ok or x + width > grid_map.width or y + height > grid_map.height:
        size = f'{grid_map.width} x {grid_map.height}'
        problem = f'{width} x {height} cells from ({x}, {y}) do not lie on a map of {size}'
        raise GridMapError('x, y, width, height', problem)
    patch = np.asarray(update.data, dtype=np.int8)
    if len(patch) != width * height:
        raise GridMapError('data', f'{len(patch)} cells do not fill {width} x {height}')
    if patch.min() < UNKNOWN or patch.max() > OCCUPIED:
        raise GridMapError('data', f'values must lie in {UNKNOWN}, {FREE} to {OCCUPIED}')
    cells: NDArray[np.int8] = grid_map.cells.copy()
    cells[y : y + height, x : x + width] = patch.reshape(height, width)
    # GridMap copies only arrays that can still be written to.
    cells.flags.writeable = False
    return GridMap(cells, grid_map.resolution, grid_map.origin, grid_map.frame_id)
