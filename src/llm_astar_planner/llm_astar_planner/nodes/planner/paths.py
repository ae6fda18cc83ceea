"""Paths of cells as the messages they leave in."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.path import path_to_message
from nav_msgs.msg import Path
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.planning.types import Plan
from llm_astar_planner.search.any_angle import interpolate


class Paths:
    """Writes the paths of one request: all in one frame, under one stamp, to one heading."""

    def __init__(
        self, grid_map: GridMap, stamp: Time, start_yaw: float, goal_yaw: float | None
    ) -> None:
        """Take the map the cells are of, and the headings of the ends in radians.

        With `goal_yaw` None the path ends as it arrives, and one of one pose as it starts
        (Nav2's use_final_approach_orientation).
        """
        self._grid_map = grid_map
        self._stamp = stamp
        self._start_yaw = start_yaw
        self._goal_yaw = goal_yaw
        self._last: tuple[NDArray[np.float64], Path] | None = None

    def message(self, points: ArrayLike) -> Path:
        """Write points [n, 2] in grid coordinates; the same message where they are the last's."""
        cells = np.asarray(points, dtype=np.float64)
        if self._last is not None and np.array_equal(self._last[0], cells):
            return self._last[1]
        places = self._grid_map.grid_to_world(cells)
        yaw = self._start_yaw if len(cells) == 1 and self._goal_yaw is None else self._goal_yaw
        path = path_to_message(places, self._grid_map.frame_id, self._stamp, yaw)
        self._last = (cells, path)
        return path

    def final(self, plan: Plan) -> Path:
        """Write a plan's path; an any-angle one with a pose a cell, as controllers expect."""
        if plan.any_angle is None:
            return self.message(plan.path)
        return self.message(interpolate(plan.any_angle.points))
