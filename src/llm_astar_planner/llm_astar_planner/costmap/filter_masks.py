# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What the values of Nav2's costmap filter masks cost: keepout areas and speed limits.

The rules are those of nav2_costmap_2d's KeepoutFilter and SpeedFilter. A speed limit becomes a
cost, since a robot that drives at p percent of its speed takes 100 / p times as long.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap

from llm_astar_planner.costmap.config import HIGHEST_COST, CostmapConfig
from llm_astar_planner.costmap.zones import KEEPOUT, ZonesError
from llm_astar_planner.search.arrays import Int8s, Int64s

# A value of the mask that leaves a cell as it is.
TRANSPARENT = -1


class FilterKind(IntEnum):
    """`type` of nav2_msgs/CostmapFilterInfo."""

    KEEPOUT = 0
    SPEED_PERCENT = 1
    SPEED_ABSOLUTE = 2


class FilterInfo(NamedTuple):
    """What a nav2_msgs/CostmapFilterInfo says about a mask: value * multiplier + base.

    `topic` is where the mask is published. KeepoutFilter uses neither base nor multiplier.
    """

    kind: FilterKind
    topic: str
    base: float = 0.0
    multiplier: float = 1.0


class FilterMask(NamedTuple):
    """A mask and what it means."""

    info: FilterInfo
    grid_map: GridMap


def filter_info(kind: int, topic: str, base: float, multiplier: float) -> FilterInfo:
    """Return the fields of a CostmapFilterInfo, checked. Raises ZonesError."""
    if kind not in tuple(FilterKind):
        kinds = '0 (keepout), 1 (speed in percent), 2 (speed in m/s)'
        raise ZonesError(f'type: {kind} is none of {kinds}')
    if not topic:
        raise ZonesError('filter_mask_topic: is empty; name the topic of the mask')
    if not (math.isfinite(base) and math.isfinite(multiplier)):
        raise ZonesError(f'base, multiplier: {base}, {multiplier} are not finite')
    return FilterInfo(FilterKind(kind), topic, base, multiplier)


def mask_costs(info: FilterInfo, config: CostmapConfig, max_speed: float) -> Int8s:
    """Return what each value of a mask, 0 to 100, costs: int8 [101], TRANSPARENT for nothing.

    `max_speed` is the robot's, in m/s. Raises ZonesError for limits in m/s without it.
    """
    values = np.arange(KEEPOUT + 1)
    if info.kind is FilterKind.KEEPOUT:
        return np.where(values > 0, zone_costs(values, config), TRANSPARENT).astype(np.int8)
    percent = info.base + info.multiplier * values
    if info.kind is FilterKind.SPEED_ABSOLUTE:
        if not max_speed > 0.0:
            raise ZonesError("speed limits in m/s need the robot's: set the parameter max_speed")
        percent *= 100.0 / max_speed
    # As in SpeedFilter: value 0, a limit of 0 and one out of range are no limit.
    limited = (values > 0) & (percent > 0.0) & (percent < 100.0)
    factor = config.cost_travel_multiplier
    if factor == 0.0:
        return np.full(len(values), TRANSPARENT, dtype=np.int8)
    costs = 100.0 * (100.0 / np.where(limited, percent, 100.0) - 1.0) / factor
    capped = np.minimum(np.rint(costs), highest_cost(config))
    return np.where(limited & (capped > 0), capped, TRANSPARENT).astype(np.int8)


def zone_costs(costs: Int64s, config: CostmapConfig) -> Int64s:
    """Return the occupancy that makes cells cost this much: only KEEPOUT closes a cell."""
    return np.where(costs >= KEEPOUT, KEEPOUT, np.minimum(costs, highest_cost(config)))


def highest_cost(config: CostmapConfig) -> int:
    """Return the highest occupancy of a cell that is open."""
    return min(HIGHEST_COST, config.occupied_threshold - 1)
