"""A map made ready for planning: everything that is worked out once a map and its rules."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner.costmap.inflation import inflate
from llm_astar_planner.planning import waypoint_filter as targets
from llm_astar_planner.planning.collision_checker import CollisionChecker
from llm_astar_planner.planning.types import CostmapConfig
from llm_astar_planner.planning.waypoint_filter import CheckedWaypoint
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import Waypoint


class Costmap:
    """A map under one set of rules; each view of it is made when first asked for, and kept."""

    def __init__(
        self, grid_map: GridMap, rules: CostmapConfig, barrier_map: BarrierMap | None = None
    ) -> None:
        """Take a map; `barrier_map`, where it comes from one, makes LLM-A* exact on it."""
        self.grid_map = grid_map
        self.rules = rules
        self.ground = CollisionChecker(grid_map, rules)
        self._barrier_map = barrier_map

    def prepare(self) -> None:
        """Make every view now instead of at the first plan."""
        self.ground.prepare()
        _ = self.components, self.waypoint_cells, self.grid_graph

    @cached_property
    def _inflated(self) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
        return inflate(self.grid_map, self.rules)

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """Where a path may not go, the robot's body considered: bool [height, width]."""
        return self._inflated[0]

    @cached_property
    def components(self) -> NDArray[np.int32]:
        """The connected free cells, numbered from 1 (0 is blocked): int32 [height, width].

        A diagonal step that cuts no corner can be walked as two straight ones, so without corner
        cutting four neighbours decide, and with it eight.
        """
        neighbours = np.ones((3, 3)) if self.rules.corner_cutting else None
        labels, _ = ndimage.label(~self.blocked, structure=neighbours)
        components: NDArray[np.int32] = labels.astype(np.int32, copy=False)
        return components

    @cached_property
    def waypoint_cells(self) -> NDArray[np.bool_]:
        """Where the paper's methods take no waypoint: bool [height, width]."""
        has_body = self.rules.robot_radius > 0.0  # the paper's robots are points
        return targets.waypoint_cells(self.blocked, None if has_body else self._barrier_map)

    @cached_property
    def grid_graph(self) -> GridGraph:
        """The grid as our own searches want it."""
        blocked, cost = self._inflated
        graded = self.rules.cost_multiplier > 0 and bool(((cost > 0) & ~blocked).any())
        return GridGraph(
            blocked,
            corner_cutting=self.rules.corner_cutting,
            cost=cost if graded else None,
            cost_multiplier=self.rules.cost_multiplier,
        )

    def is_free(self, cell: Cell) -> bool:
        """Tell whether a path may be at a cell of the map."""
        return not self.blocked[cell[1], cell[0]]

    def judge(self, waypoints: Sequence[Waypoint], start: Cell) -> tuple[CheckedWaypoint, ...]:
        """Judge waypoints that a path from `start` may be at, up to the map's very edge."""
        return targets.judge(waypoints, self.blocked, self.components, start, 0)

    def why_barred(self, cell: Cell) -> str:
        """Say why a path may not be at a cell of the map."""
        occupancy = self.grid_map.cells[cell[1], cell[0]]
        if occupancy >= self.rules.occupied_threshold:
            return f'occupancy {occupancy}'
        if occupancy < FREE and not self.rules.allow_unknown:
            return 'unknown'
        return f"an obstacle within the robot's radius, {self.rules.robot_radius:g} m"
