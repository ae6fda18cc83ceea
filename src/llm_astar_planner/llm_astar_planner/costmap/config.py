# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The rules that turn an occupancy grid into a costmap."""

from dataclasses import dataclass
from functools import cached_property

from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED

from llm_astar_planner.parameter import ParameterError, parameter, parameters_of

# Metres; a robot is not larger.
MAX_RADIUS = 10.0
# The highest occupancy that Nav2 publishes for a cell which is neither inscribed (99) nor lethal.
HIGHEST_COST = 98
# What `occupied_threshold` is on a costmap: inscribed cells are 99, lethal ones 100.
COSTMAP_THRESHOLD = 99


@dataclass(frozen=True)
class CostmapConfig:
    """Where a path may go, and what it costs there.

    `cost_travel_multiplier` is Nav2's: a move of length d into a cell below
    the threshold costs d * (1 + multiplier * occupancy / 100) in `guided` and `exact_astar`.
    An unknown cell has the occupancy `unknown_cost`. With `allow_unknown`, Nav2's planners take
    it for about the most expensive passable one, of cost 252: NavFn::setCostmap as COST_OBS - 1,
    Smac's Node2D::getTraversalCost as 255, ThetaStar::isSafe as OCCUPIED_COST - 1.
    Inflation is that of Nav2's InflationLayer; the formula is in `costmap.costmap`.

    With both radii 0 the map is used unchanged, which is right for a costmap: it is inflated
    already. A costmap as an occupancy grid has 100 for lethal, 99 for inscribed and 1 to 98 for
    graded cells, so its `occupied_threshold` is 99. Raises ParameterError for a number out of
    range.

    - `occupied_threshold`: Occupancy from which a cell is lethal: no path crosses it; 99 for a
      costmap
    - `allow_unknown`: Whether paths may cross unknown cells
    - `unknown_cost`: What an unknown cell costs, as occupancy; by default as much as the most
      expensive known one, as in Nav2's planners; 0 for nothing
    - `corner_cutting`: Whether diagonal moves may pass the corner of a blocked cell
    - `cost_travel_multiplier`: How much occupancy below the threshold adds to the cost of a move,
      in `guided` and `exact_astar`; 0 counts length only
    - `robot_radius`: Cells up to this distance from a lethal one are blocked; 0 for a costmap,
      which is inflated already
    - `inflation_radius`: Cells up to this distance from a lethal one cost more, the closer the
      more; 0 for a costmap
    - `cost_scaling_factor`: How fast the inflation cost decays with distance
    """

    occupied_threshold: int = parameter(65, between=(1, 100))
    allow_unknown: bool = parameter(True)
    unknown_cost: int = parameter(HIGHEST_COST, between=(0, HIGHEST_COST))
    corner_cutting: bool = parameter(
        False, cli_default=True, cli_reason='on barrier maps only, as in the paper'
    )
    cost_travel_multiplier: float = parameter(2.0, between=(0.0, 100.0))
    robot_radius: float = parameter(0.0, unit='m', between=(0.0, MAX_RADIUS))
    inflation_radius: float = parameter(0.0, unit='m', between=(0.0, MAX_RADIUS))
    cost_scaling_factor: float = parameter(10.0, unit='1/m', between=(0.0, 1000.0))

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, entry in COSTMAP.items():
            problem = entry.problem(getattr(self, name))
            if problem:
                raise ParameterError(problem)

    @property
    def obstacle_threshold(self) -> int:
        """Occupancy from which a cell is an obstacle itself, of a robot of whatever shape.

        On a costmap, which is used with COSTMAP_THRESHOLD, inscribed cells are none.
        """
        is_costmap = self.occupied_threshold == COSTMAP_THRESHOLD
        return OCCUPIED if is_costmap else self.occupied_threshold

    @cached_property
    def has_radius(self) -> bool:
        """Whether lethal cells affect others; without a radius a map is used unchanged."""
        return self.robot_radius > 0.0 or self.inflation_radius > 0.0


# The parameters, by field name.
COSTMAP = parameters_of(CostmapConfig)
