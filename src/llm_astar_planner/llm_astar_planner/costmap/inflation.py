"""The robot's body on a map: which cells its centre must not be in, and what the others cost.

As in Nav2's InflationLayer, with d the distance in metres from a cell's centre to that of the
nearest lethal cell, one of `occupied_threshold` or more: a cell with d up to `robot_radius`
(included, Nav2's inscribed cells) is blocked; from there up to `inflation_radius` it costs
98 * exp(-cost_scaling_factor * (d - robot_radius)), or its own occupancy if that is higher. 98 is
the highest cost that Nav2 publishes for a cell which is neither inscribed (99) nor lethal (100).
Unknown cells and the map's edge do not inflate.
"""

from __future__ import annotations

import math

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner.costmap.config import CostmapConfig

HIGHEST_COST = 98
# Rows handled at a time: the distances of a whole map of 4000 x 4000 would take 0.5 GB.
BAND_ROWS = 512
# So that a distance of exactly the radius is within it, whatever radius / resolution rounds to.
ROUNDING = 1e-6


def inflate(
    grid_map: GridMap, config: CostmapConfig
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Return which cells the robot's centre must not be in, and what the cells cost.

    The first is bool [height, width]; the second int8 [height, width], 0 to 100 and -1 where
    unknown, as in an occupancy grid. Without a radius these are the map's own. O(cells).
    """
    blocked = grid_map.blocked(config.occupied_threshold, allow_unknown=config.allow_unknown)
    radius = max(config.robot_radius, config.inflation_radius)
    if radius == 0.0:
        return blocked, grid_map.cells
    cost = grid_map.cells.copy()
    inscribed = squared_cells(config.robot_radius, grid_map.resolution)
    costs = costs_by_distance(config, grid_map)
    halo = math.ceil(radius / grid_map.resolution)
    for top in range(0, grid_map.height, BAND_ROWS):
        rows = slice(top, min(top + BAND_ROWS, grid_map.height))
        first = max(top - halo, 0)
        lethal = grid_map.cells[first : rows.stop + halo] >= config.occupied_threshold
        if not lethal.any():
            continue
        squared = squared_distances(lethal)[top - first : rows.stop - first]
        blocked[rows] |= squared <= inscribed
        graded = costs[np.minimum(squared, len(costs) - 1)]
        np.maximum(cost[rows], graded, out=cost[rows], where=graded > 0)
    return blocked, cost


def squared_cells(radius: float, resolution: float) -> int:
    """Return the greatest squared distance, in cells, that lies within `radius` metres."""
    return math.floor((radius / resolution) ** 2 + ROUNDING)


def squared_distances(lethal: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return each cell's squared distance, in cells, to the nearest of the lethal ones."""
    distances = ndimage.distance_transform_edt(~lethal)
    squared: NDArray[np.int64] = np.rint(np.square(distances)).astype(np.int64)
    return squared


def costs_by_distance(config: CostmapConfig, grid_map: GridMap) -> NDArray[np.int8]:
    """Return the inflation cost by squared distance in cells; the last one is for all beyond."""
    # No farther than two cells of the map can be apart.
    across = grid_map.width**2 + grid_map.height**2
    reach = min(squared_cells(config.inflation_radius, grid_map.resolution), across)
    distances = np.sqrt(np.arange(reach + 1)) * grid_map.resolution
    decay = np.exp(-config.cost_scaling_factor * np.maximum(distances - config.robot_radius, 0.0))
    return np.append(np.rint(HIGHEST_COST * decay), 0.0).astype(np.int8)
