# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The robot's body on a map: which cells its centre must not be in, and what the others cost.

As in Nav2's InflationLayer, with d the distance in metres from a cell's centre to that of the
nearest lethal cell, one of `occupied_threshold` or more: a cell with d up to `robot_radius`
(included, Nav2's inscribed cells) is blocked; from there up to `inflation_radius` it costs
98 * exp(-cost_scaling_factor * (d - robot_radius)), or its own occupancy if that is higher;
`unknown_cost` if it is unknown. Unknown cells and the map's edge do not inflate.
"""

from __future__ import annotations

import math

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.costmap._kernels import inflation as kernels
from llm_astar_planner.costmap.config import HIGHEST_COST, CostmapConfig
from llm_astar_planner.search.double_buffer import DoubleBuffer
from llm_astar_planner.search.grid_graph import whole

# So that a distance of exactly the radius is within it, whatever radius / resolution rounds to.
ROUNDING = 1e-6


def inflate(
    grid_map: GridMap, config: CostmapConfig
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Return which cells the robot's centre must not be in, and what the cells cost.

    The first is bool [height, width]; the second int8 [height, width], 0 to 100 as in an occupancy
    grid, and -1 for what an unknown cell costs: unknown, and not inflated above `unknown_cost`.
    Without a radius these are the map's own. O(cells).
    """
    if not config.has_radius:
        blocked = grid_map.blocked(config.occupied_threshold, allow_unknown=config.allow_unknown)
        return blocked, grid_map.cells
    shape = grid_map.cells.shape
    blocked, cost = np.empty(shape, dtype=np.bool_), np.empty(shape, dtype=np.int8)
    inflate_windows(grid_map, config, whole(shape), blocked, cost)
    return blocked, cost


def inflated_again(
    grid_map: GridMap,
    config: CostmapConfig,
    before: tuple[NDArray[np.bool_], NDArray[np.int8]],
    windows: NDArray[np.int64],
    buffer: DoubleBuffer,
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Return what `inflate` does, from what it returned `before` for another map.

    The windows [n, 4] hold all cells that differ and all that the inflation reaches from there.
    """
    if not config.has_radius:
        return inflate(grid_map, config)
    shape = grid_map.cells.shape
    blocked = buffer.copy('blocked', before[0], windows, shape)
    cost = buffer.copy('cost', before[1], windows, shape)
    inflate_windows(grid_map, config, windows, blocked, cost)
    return blocked, cost


def inflate_windows(
    grid_map: GridMap,
    config: CostmapConfig,
    windows: NDArray[np.int64],
    blocked: NDArray[np.bool_],
    cost: NDArray[np.int8],
) -> None:
    """Fill `blocked` and `cost` [height, width] in windows, O(cells in them).

    A window is (top, bottom, left, right) in cells, half open: int64 [n, 4].
    """
    across = grid_map.width**2 + grid_map.height**2
    inscribed = min(squared_cells(config.robot_radius, grid_map.resolution), across)
    kernels.inflate(
        grid_map.cells, config.occupied_threshold, config.allow_unknown, config.unknown_cost,
        inscribed, costs_by_distance(config, grid_map), inflation_reach(grid_map, config), windows,
        blocked, cost,
    )  # fmt: skip


def inflation_reach(grid_map: GridMap, config: CostmapConfig) -> int:
    """Return how many cells away a lethal cell can still block or raise a cost."""
    radius = max(config.robot_radius, config.inflation_radius)
    reach = math.isqrt(squared_cells(radius, grid_map.resolution))
    return min(reach, max(grid_map.width, grid_map.height))


def squared_cells(radius: float, resolution: float) -> int:
    """Return the greatest squared distance, in cells, that lies within `radius` metres."""
    return math.floor((radius / resolution) ** 2 + ROUNDING)


def costs_by_distance(config: CostmapConfig, grid_map: GridMap) -> NDArray[np.int8]:
    """Return the inflation cost by squared distance in cells; the last one is for all beyond."""
    # No farther than two cells of the map can be apart.
    across = grid_map.width**2 + grid_map.height**2
    reach = min(squared_cells(config.inflation_radius, grid_map.resolution), across)
    distances = np.sqrt(np.arange(reach + 1)) * grid_map.resolution
    decay = np.exp(-config.cost_scaling_factor * np.maximum(distances - config.robot_radius, 0.0))
    return np.append(np.rint(HIGHEST_COST * decay), 0.0).astype(np.int8)
