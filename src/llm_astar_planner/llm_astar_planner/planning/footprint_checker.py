"""The poses and paths on which the robot's polygon meets an obstacle."""

from __future__ import annotations

import copy
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning._kernels import footprint as kernels
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.search.result import Cell

# Cells [height, width], the threshold from which they are lethal, and whether unknown ones are.
Obstacles = tuple[NDArray[np.int8], int, bool]


class FootprintChecker:
    """Tells at which poses a footprint meets an obstacle of a map, or leaves the map.

    The whole area counts, not the outline alone. Lethal are cells of `occupied_threshold` or
    more; on a costmap (threshold 99) those of 100, since inscribed cells are no obstacles to a
    polygon. Unknown cells are obstacles unless `allow_unknown`. `points` [n, 2] are in cells.
    Immutable.
    """

    def __init__(
        self, costmap: Costmap, footprint: Footprint, *, allow_unknown: bool | None = None
    ) -> None:
        """Take a map with its rules, and the polygon. Prepares nothing.

        `allow_unknown`, if given, replaces the costmap's.
        """
        self.grid_map, config = costmap.grid_map, costmap.config
        self.footprint = footprint
        self.points = points = footprint.array / self.grid_map.resolution
        allowed = config.allow_unknown if allow_unknown is None else allow_unknown
        self._rules = self.grid_map.cells, config.obstacle_threshold, not allowed, points

    @property
    def obstacles(self) -> Obstacles:
        """What the polygon must not meet."""
        return self._rules[:3]

    def cleared(self, pose: ArrayLike) -> FootprintChecker:
        """Return a checker for which the cells under the footprint at a pose [3] are free.

        Nav2's costmap layers clear them too (`footprint_clearing_enabled`). The pose is in metres
        and radians.
        """
        cells = self._rules[0].copy()
        kernels.clear(cells, self.points, self.to_grid(pose)[0])
        checker = copy.copy(self)
        checker._rules = cells, *self._rules[1:]
        return checker

    def can_turn(self, place: Cell, begin: float, end: float) -> bool:
        """Tell whether the robot can turn on the spot at a cell (x, y), one way or the other.

        Yaws are relative to the grid, in radians.
        """
        return not kernels.turn_collides(
            *self._rules, float(place[0]), float(place[1]), (begin, end)
        )

    def path_collides(
        self, path: ArrayLike, start_yaw: float | None = None, goal_yaw: float | None = None
    ) -> bool:
        """Tell whether it collides on a path [n, 2].

        The robot moves straight ahead from point to point and turns on the spot, at the first
        from `start_yaw` and at the last to `goal_yaw`, where given. Points are in grid
        coordinates, yaws in radians, relative to the grid.
        """
        points = np.ascontiguousarray(path, dtype=np.float64).reshape(-1, 2)
        ends = (math.nan if yaw is None else yaw for yaw in (start_yaw, goal_yaw))
        return bool(kernels.path_collides(*self._rules, points, *ends))

    def to_grid(self, poses: ArrayLike) -> NDArray[np.float64]:
        """Turn poses (x, y, yaw) [n, 3] in metres and radians into poses on the grid, in cells."""
        world = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        places = self.grid_map.world_to_grid(world[:, :2])
        return np.column_stack([places, world[:, 2] - self.grid_map.origin.yaw])

    def first_collision(self, poses: ArrayLike) -> int | None:
        """Return the index of the first pose (x, y, yaw) [n, 3] that collides, or None.

        Poses are in metres and radians, in the map's frame. One that is not finite collides.
        """
        found = np.flatnonzero(self.collisions(poses))
        return int(found[0]) if len(found) else None

    def collisions(self, poses: ArrayLike) -> NDArray[np.bool_]:
        """Tell for each pose (x, y, yaw) [n, 3] in metres whether it collides: bool [n]."""
        return self.collisions_on_grid(self.to_grid(poses))

    def collisions_on_grid(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell for each pose [n, 3] in grid coordinates whether it collides: bool [n]."""
        found: NDArray[np.bool_] = kernels.all_collisions(*self._rules, poses)
        return found
