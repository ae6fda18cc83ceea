"""The robot's body on a map: where its centre may not be, and where that is dear.

As Nav2's InflationLayer has it, d being the distance in metres from a cell's centre to that of the
nearest lethal cell, one of `occupied_threshold` or more: up to `robot_radius` (included, Nav2's
inscribed cells) a cell is blocked; from there up to `inflation_radius` it costs
98 * exp(-cost_scaling_factor * (d - robot_radius)), where its own occupancy is not dearer. 98 is
what Nav2 publishes for the dearest cell that is neither inscribed (99) nor lethal (100). Neither
unknown cells nor the map's edge inflate.
"""

from __future__ import annotations

import math

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner.costmap.config import CostmapConfig

DEAREST = 98
# Rows measured at once: the distances of a whole 4000 x 4000 map would take 0.5 GB.
BAND_ROWS = 512
# A distance of exactly the radius is within it, whatever the rounding of radius / resolution.
_ROUNDING = 1e-6


def inflate(grid_map: GridMap, rules: CostmapConfig) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Return where the robot's centre may not be and what the map's cells cost.

    The first is bool [height, width]; the second int8 [height, width], 0 to 100 and -1 where
    unknown, as in an occupancy grid. Without a radius these are the map's own. O(cells).
    """
    blocked = grid_map.blocked(rules.occupied_threshold, allow_unknown=rules.allow_unknown)
    radius = max(rules.robot_radius, rules.inflation_radius)
    if radius == 0.0:
        return blocked, grid_map.cells
    cost = grid_map.cells.copy()
    body = squared_cells(rules.robot_radius, grid_map.resolution)
    prices = _prices(rules, grid_map)
    halo = math.ceil(radius / grid_map.resolution)
    for top in range(0, grid_map.height, BAND_ROWS):
        rows = slice(top, min(top + BAND_ROWS, grid_map.height))
        first = max(top - halo, 0)
        lethal = grid_map.cells[first : rows.stop + halo] >= rules.occupied_threshold
        if not lethal.any():
            continue
        squared = _squared_distances(lethal)[top - first : rows.stop - first]
        blocked[rows] |= squared <= body
        graded = prices[np.minimum(squared, len(prices) - 1)]
        np.maximum(cost[rows], graded, out=cost[rows], where=graded > 0)
    return blocked, cost


def squared_cells(radius: float, resolution: float) -> int:
    """Return the greatest squared distance, in cells, that lies within `radius` metres."""
    return math.floor((radius / resolution) ** 2 + _ROUNDING)


def _squared_distances(lethal: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return each cell's squared distance to the nearest lethal one, of which there is one."""
    distances = ndimage.distance_transform_edt(~lethal)
    squared: NDArray[np.int64] = np.rint(np.square(distances)).astype(np.int64)
    return squared


def _prices(rules: CostmapConfig, grid_map: GridMap) -> NDArray[np.int8]:
    """Return what a cell costs by its squared distance in cells; the last is for all beyond."""
    # No farther than cells of the map may be apart, however fine it is.
    across = grid_map.width**2 + grid_map.height**2
    reach = min(squared_cells(rules.inflation_radius, grid_map.resolution), across)
    distances = np.sqrt(np.arange(reach + 1)) * grid_map.resolution
    decay = np.exp(-rules.cost_scaling_factor * np.maximum(distances - rules.robot_radius, 0.0))
    return np.append(np.rint(DEAREST * decay), 0.0).astype(np.int8)
