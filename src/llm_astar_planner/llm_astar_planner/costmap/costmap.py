# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A map under rules, as searches and waypoint sources see it: blocked cells, costs, inflation.

As in Nav2's InflationLayer, with d the distance in metres from a cell's centre to that of the
nearest lethal cell, one of `occupied_threshold` or more: a cell with d up to `robot_radius`
(included, Nav2's inscribed cells) is blocked; from there up to `inflation_radius` it costs
98 * exp(-cost_scaling_factor * (d - robot_radius)), or its own occupancy if that is higher;
`unknown_cost` if it is unknown. Unknown cells and the map's edge do not inflate.
"""

from __future__ import annotations

import hashlib
import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, ORIGIN, GridMap

from llm_astar_planner.costmap import _kernels as kernels
from llm_astar_planner.costmap.config import HIGHEST_COST, CostmapConfig
from llm_astar_planner.search.arrays import Bools, DoubleBuffer, Int8s, Int64s
from llm_astar_planner.search.grid_graph import GridGraph, whole
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.tiles import Tiles

if TYPE_CHECKING:
    from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

    from llm_astar_planner.search.any_angle import LineOfSightChecker
    from llm_astar_planner.search.coarse import CoarseGraph


# So that a distance of exactly the radius is within it, whatever radius / resolution rounds to.
ROUNDING = 1e-6


def inflate(
    grid_map: GridMap,
    config: CostmapConfig,
    before: tuple[Bools, Int8s] | None = None,
    windows: Int64s | None = None,
    buffer: DoubleBuffer | None = None,
) -> tuple[Bools, Int8s]:
    """Return which cells the robot's centre must not be in, and what the cells cost.

    The first is bool [height, width]; the second int8 [height, width], 0 to 100 as in an occupancy
    grid, and -1 for what an unknown cell costs: unknown, and not inflated above `unknown_cost`.
    Without a radius these are the map's own. O(cells), or those in the `windows`, int64 [n, 4]
    (top, bottom, left, right) half open, where `before` is what this returned for another map:
    they hold all cells that differ and all that the inflation reaches from there. `buffer` is
    that of the series of maps.
    """
    if not config.has_radius:
        blocked = grid_map.blocked(config.occupied_threshold, allow_unknown=config.allow_unknown)
        return blocked, grid_map.cells
    shape = grid_map.cells.shape
    if before is None or windows is None or buffer is None:
        windows = whole(shape)
        blocked, cost = np.empty(shape, dtype=np.bool_), np.empty(shape, dtype=np.int8)
    else:
        blocked = buffer.copy('blocked', before[0], windows, shape)
        cost = buffer.copy('cost', before[1], windows, shape)
    across = grid_map.width**2 + grid_map.height**2
    inscribed = min(squared_cells(config.robot_radius, grid_map.resolution), across)
    kernels.inflate(
        grid_map.cells, config.occupied_threshold, config.allow_unknown, config.unknown_cost,
        inscribed, costs_by_distance(config, grid_map), inflation_reach(grid_map, config), windows,
        blocked, cost,
    )  # fmt: skip
    return blocked, cost


def inflation_reach(grid_map: GridMap, config: CostmapConfig) -> int:
    """Return how many cells away a lethal cell can still block or raise a cost."""
    radius = max(config.robot_radius, config.inflation_radius)
    reach = math.isqrt(squared_cells(radius, grid_map.resolution))
    return min(reach, max(grid_map.width, grid_map.height))


def squared_cells(radius: float, resolution: float) -> int:
    """Return the greatest squared distance, in cells, that lies within `radius` metres."""
    return math.floor((radius / resolution) ** 2 + ROUNDING)


def costs_by_distance(config: CostmapConfig, grid_map: GridMap) -> Int8s:
    """Return the inflation cost by squared distance in cells; the last one is for all beyond."""
    # No farther than two cells of the map can be apart.
    across = grid_map.width**2 + grid_map.height**2
    reach = min(squared_cells(config.inflation_radius, grid_map.resolution), across)
    distances = np.sqrt(np.arange(reach + 1)) * grid_map.resolution
    decay = np.exp(-config.cost_scaling_factor * np.maximum(distances - config.robot_radius, 0.0))
    return np.append(np.rint(HIGHEST_COST * decay), 0.0).astype(np.int8)


# The most straight barriers in a map of the paper's kind.
MAX_BARRIERS = 30


class Costmap:
    """Which cells are blocked and what the others cost. Each layer is computed once, when used.

    Immutable, so safe to share between threads. Two costmaps are different even where their
    cells are equal; `key` is equal for equal ones.
    """

    def __init__(
        self,
        grid_map: GridMap,
        config: CostmapConfig | None = None,
        barrier_map: BarrierMap | None = None,
        previous: Costmap | None = None,
    ) -> None:
        """Take a map. `barrier_map`, if the grid was made from one, makes LLM-A* exact on it.

        Of `previous`, the costmap of the map before, the layers that it has computed are taken
        over and computed again only where the map has changed. `previous` stays as it is.
        """
        self.grid_map = grid_map
        self.config = config or CostmapConfig()
        self.barrier_map = barrier_map
        self._changes: Int64s | None = None
        self._buffer = DoubleBuffer()
        if previous is not None:
            self._take_over(previous)

    def prepare(self) -> None:
        """Compute the layers that every search needs now instead of at the first plan."""
        _ = self.components, self.rejected_cells, self.grid_graph

    @property
    def changes(self) -> Int64s | None:
        """Where `blocked`, `cost` or moves may differ from those of the previous costmap.

        Disjoint windows (top, bottom, left, right) in cells, half open: int64 [n, 4]. None if
        there was no previous costmap, or nothing of it could be taken over.
        """
        return self._changes

    @property
    def key(self) -> tuple[str, CostmapConfig]:
        """The map's digest and the rules: equal for costmaps with equal cells."""
        return self.grid_map.digest, self.config

    @cached_property
    def _inflated(self) -> tuple[Bools, Int8s]:
        return read_only(inflate(self.grid_map, self.config))

    @cached_property
    def blocked(self) -> Bools:
        """Cells the robot's centre must not be in: bool [height, width]."""
        return self._inflated[0]

    @cached_property
    def cost(self) -> Int8s:
        """Occupancy with inflation: int8 [height, width], 0 to 100, -1 for `unknown_cost`."""
        return self._inflated[1]

    @cached_property
    def components(self) -> Tiles:
        """Connected free cells: `components[y, x]` is a number, 0 where blocked."""
        return Tiles.build(self.blocked, corner_cutting=self.config.corner_cutting)

    @cached_property
    def rejected_cells(self) -> Bools:
        """Cells on which the paper's methods drop a waypoint: bool [height, width].

        These are the blocked cells. The published code misses the last cell of every barrier;
        where the barriers are known this does the same, to be exact on the paper's samples. The
        paper's robot is a point, so with a robot radius the blocked cells decide.
        """
        if self.barrier_map is None or self.config.robot_radius > 0.0:
            return self.blocked
        return self.barrier_map.open_ended().to_grid().blocked()

    @cached_property
    def grid_graph(self) -> GridGraph:
        """The cells as the graph that our own searches work on."""
        return GridGraph(
            self.blocked,
            corner_cutting=self.config.corner_cutting,
            cost=self._graded_cost(),
            cost_multiplier=self.config.cost_travel_multiplier,
            unknown_cost=self.config.unknown_cost,
        ).with_rules(self.grid_map.forbidden)

    def reached(self, start: Cell) -> Tiles:
        """Return `components`, or the like of the cells that rules of the road let a start reach.

        There these are the component of the start.
        """
        if not self.grid_map.forbidden.size:
            return self.components
        # A diagonal move may have led there, past corners that it must not reach.
        return Tiles.build(~self.grid_graph.reach(start), corner_cutting=True)

    def _graded_cost(self) -> Int8s | None:
        """Return `cost` if it matters to any path, else None."""
        if self.config.cost_travel_multiplier == 0:
            return None
        is_graded = kernels.has_graded(self.cost, self.blocked, self.config.unknown_cost)
        return self.cost if is_graded else None

    def _take_over(self, previous: Costmap) -> None:
        """Take over the layers that the previous costmap has computed, updated in windows."""
        before, now, layers = previous.grid_map, self.grid_map, vars(previous)
        is_alike = before.layout == now.layout
        if '_inflated' not in layers or not is_alike or previous.config != self.config:
            return
        # One cell more than the inflation reaches: legal moves depend on the neighbours.
        margin = inflation_reach(now, self.config) + 1
        windows = kernels.changed_windows(before.cells, now.cells, margin)
        self._buffer = previous._buffer
        inflated = inflate(now, self.config, layers['_inflated'], windows, self._buffer)
        self._inflated = read_only(inflated)
        if 'grid_graph' in layers:
            graph: GridGraph = layers['grid_graph']
            graph = graph.without_rules.updated(
                self.blocked, self._graded_cost(), windows, self._buffer
            )
            self.grid_graph = graph.with_rules(now.forbidden)
        if 'components' in layers:
            self.components = layers['components'].updated(self.blocked, windows, self._buffer)
        self._changes = windows

    @cached_property
    def coarse_graph(self) -> CoarseGraph:
        """The tiles of `components` as a graph for rough routes."""
        # Kernels that no search takes.
        from llm_astar_planner.search.coarse import CoarseGraph  # noqa: PLC0415

        return CoarseGraph(self.components, self.grid_graph.without_rules)

    @cached_property
    def is_barrier_map(self) -> bool:
        """Whether a few dozen straight barriers block all that is blocked, as in the paper."""
        # Readers of files, which no search takes.
        from llm_astar_msgs_adapter.maps import barrier_decomposition  # noqa: PLC0415

        if max(self.blocked.shape) > barrier_decomposition.MAX_SIDE:
            return False
        barriers, are_all = barrier_decomposition.cover(self.blocked, MAX_BARRIERS, only_all=True)
        return are_all and bool(barriers)

    @cached_property
    def line_of_sight(self) -> LineOfSightChecker:
        """Tells which straight lines between cells meet no blocked cell."""
        from llm_astar_planner.search.any_angle import LineOfSightChecker  # noqa: PLC0415

        return LineOfSightChecker(self.blocked)

    def describe_cell(self, cell: Cell) -> str:
        """Name a cell (x, y), on the map or off it, for a person, with its centre in metres.

        Barrier maps, where it has the coordinates of the map's file, and maps without a
        resolution and origin of their own have no metres.
        """
        x, y = cell
        if self.barrier_map is not None:
            x_min, y_min = self.barrier_map.offset
            return f'cell ({x + x_min}, {y + y_min})'
        if (self.grid_map.resolution, self.grid_map.origin) == (1.0, ORIGIN):
            return f'cell ({x}, {y})'
        ((east, north),) = self.grid_map.grid_to_world([cell]).tolist()
        return f'cell ({x}, {y}) at ({round(east, 3):g}, {round(north, 3):g}) m'

    def describe_blocked(self, cell: Cell) -> str:
        """Say why a cell (x, y) of the map is blocked."""
        occupancy = self.grid_map.cells[cell[1], cell[0]]
        if occupancy >= self.config.occupied_threshold:
            return f'occupancy {occupancy}'
        if occupancy < FREE and not self.config.allow_unknown:
            return 'unknown'
        return f"an obstacle within the robot's radius, {self.config.robot_radius:g} m"


def read_only(layers: tuple[Bools, Int8s]) -> tuple[Bools, Int8s]:
    """Return layers that nobody can write to: sources and searches of others are given these.

    And kernels, which numba compiles once more for arrays that can be written to.
    """
    for layer in layers:
        layer.flags.writeable = False
    return layers


class ClosedCostmap(Costmap):
    """A costmap with more cells blocked than the robot's body demands: no-go areas."""

    def __init__(self, costmap: Costmap, closed: Bools) -> None:
        """Close the cells `closed`, bool [height, width], of a costmap."""
        super().__init__(costmap.grid_map, costmap.config, costmap.barrier_map)
        self._costmap = costmap
        self._closed = closed

    @property
    def key(self) -> tuple[str, CostmapConfig]:
        """The digests of the map and of the closed cells, and the rules."""
        closed = hashlib.sha256(np.packbits(self._closed).tobytes()).hexdigest()[:12]
        return f'{self.grid_map.digest} {closed}', self.config

    @cached_property
    def blocked(self) -> Bools:
        """Cells the robot's centre must not be in: bool [height, width]."""
        return self._costmap.blocked | self._closed

    @cached_property
    def cost(self) -> Int8s:
        """Occupancy with inflation, as without the closed cells: int8 [height, width]."""
        return self._costmap.cost

    @cached_property
    def rejected_cells(self) -> Bools:
        """Cells on which the paper's methods drop a waypoint, the closed ones included."""
        return self._costmap.rejected_cells | self._closed

    def describe_blocked(self, cell: Cell) -> str:
        """Say why a cell (x, y) of the map is blocked."""
        is_closed = self._closed[cell[1], cell[0]]
        return 'closed to the path' if is_closed else super().describe_blocked(cell)
