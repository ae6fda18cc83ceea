"""A live sequence of maps: eight moving obstacles, and a plan on each map as it arrives.

Measured is the CPU time of the thread from the message to the first plan, with every map taken
in increments and with every map prepared from nothing, in turns; and what keeping the landmarks
costs, in this thread and in the background.
"""

from __future__ import annotations

import array
import math
import statistics
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.messages.fields import grid_from_message
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import LandmarkManager
from numpy.typing import NDArray

from benchmarks.cases import RESOLUTION, SEED, Query, drawn_case
from benchmarks.map_families import boxes
from benchmarks.ours import BOUND, ready_landmarks

SIZES = (1000, 2000, 4000)
MAPS = 60
# The first maps are not counted: each obstacle is left out of landmarks and borders when it has
# moved for the first time.
FIRST_MAPS = 20
PERIOD_S = 0.2
OBSTACLES = 8
# Cells: the radius of an obstacle, and how far it moves from map to map (1 m/s).
OBSTACLE_RADIUS, STEP = 8, 4
CONFIG = CostmapConfig(robot_radius=0.2, inflation_radius=0.55, cost_scaling_factor=3.0)
INCREMENTS, NOTHING = 'in increments', 'from nothing'
Summary = dict[str, float]


def measure(size: int, maps: int = MAPS, period: float = PERIOD_S) -> dict[str, Summary]:
    """Return the figures of both ways over a sequence of maps of `size` cells a side."""
    static = boxes(size, np.random.default_rng(SEED))
    static[[0, -1]] = static[:, [0, -1]] = True
    passable = Planner(to_grid(static), CONFIG).costmap.blocked
    query = drawn_case('live', passable, 1).problems[0].queries[0]
    robots = {name: Robot(in_increments=name == INCREMENTS) for name in (INCREMENTS, NOTHING)}
    for number, blocked in enumerate(sequence(static, query, maps)):
        message = to_message(blocked)
        for robot in robots.values():
            if number == 1:
                robot.wait()
            robot.take(message, query, period, counts=number >= FIRST_MAPS)
    return {name: robot.summary() for name, robot in robots.items()}


class TimedLandmarkManager(LandmarkManager):
    """Notes the CPU seconds that the last map cost in the calling thread."""

    update_s = 0.0

    def update(self, grid: GridGraph) -> None:
        """Take a new map."""
        begin = time.thread_time()
        super().update(grid)
        self.update_s = time.thread_time() - begin


class Robot:
    """Takes maps and plans on each, noting the milliseconds of CPU that this cost."""

    def __init__(self, *, in_increments: bool) -> None:
        """Say whether a map takes over from the one before what did not change."""
        self._in_increments = in_increments
        self._planner: Planner | None = None
        self._landmarks = TimedLandmarkManager()
        self._plans: list[float] = []
        self._upkeep: list[float] = []
        self._had_landmarks: list[bool] = []

    def wait(self) -> None:
        """Wait for what is measured of the first map: 5 to 7 seconds at 4000 x 4000."""
        self._landmarks.wait(60.0)

    def take(self, message: Any, query: Query, period: float, *, counts: bool) -> None:  # noqa: ANN401
        """Make a planner of a map message, plan on it, and wait until the period is over."""
        end, process, begin = time.monotonic() + period, time.process_time(), time.thread_time()
        previous = self._planner if self._in_increments else None
        grid_map = grid_from_message(message)
        planner = Planner(grid_map, CONFIG, landmarks=self._landmarks, previous=previous)
        self._planner = planner.prepare(wait=False)
        prepared = time.thread_time()
        grid = planner.costmap.grid_graph
        had_landmarks = ready_landmarks(self._landmarks, grid) is not None
        asked = time.thread_time()
        request = PlanRequest(*query, max_suboptimality=BOUND, want_expanded=False)
        plan = planner.plan(request)
        own = time.thread_time() - asked + prepared - begin
        if plan.code is not ResultCode.NONE:
            raise RuntimeError(plan.message)
        time.sleep(max(0.0, end - time.monotonic()))
        self._landmarks.wait(period)
        others = time.process_time() - process - (time.thread_time() - begin)
        upkeep = others + self._landmarks.update_s
        if counts:
            self._plans.append(own * 1e3)
            self._upkeep.append(upkeep * 1e3)
            self._had_landmarks.append(had_landmarks)

    def summary(self) -> Summary:
        """Return the medians, the 90th percentile, and the share of plans that had landmarks."""
        return {
            'plan_ms': statistics.median(self._plans),
            'plan_p90_ms': float(np.percentile(self._plans, 90)),
            'upkeep_ms': statistics.median(self._upkeep),
            'had_landmarks': statistics.fmean(self._had_landmarks),
        }


def sequence(static: NDArray[np.bool_], query: Query, maps: int) -> Iterator[NDArray[np.bool_]]:
    """Yield maps on which round obstacles move straight on, and back from the border.

    They stay away from start and goal.
    """
    random, size = np.random.default_rng(SEED), len(static)
    positions = random.uniform(0.1 * size, 0.9 * size, (OBSTACLES, 2))
    angles = random.uniform(0.0, 2.0 * np.pi, OBSTACLES)
    steps = STEP * np.column_stack((np.cos(angles), np.sin(angles)))
    rows, columns = np.ogrid[:size, :size]
    for _ in range(maps):
        blocked = static.copy()
        for x, y in positions:
            if min(math.dist((x, y), cell) for cell in query) > 4 * OBSTACLE_RADIUS:
                blocked |= (columns - x) ** 2 + (rows - y) ** 2 <= OBSTACLE_RADIUS**2
        yield blocked
        steps *= np.where((positions < 0) | (positions >= size), -1.0, 1.0)
        positions += steps


def to_grid(blocked: NDArray[np.bool_]) -> GridMap:
    """Return an occupancy grid."""
    return GridMap(np.where(blocked, OCCUPIED, FREE).astype(np.int8), RESOLUTION)


def to_message(blocked: NDArray[np.bool_]) -> Any:  # noqa: ANN401
    """Return what rclpy hands over of a nav_msgs/OccupancyGrid: fields, and data as an array."""
    height, width = blocked.shape
    cells = np.where(blocked, OCCUPIED, FREE).astype(np.int8)
    pose = SimpleNamespace(
        position=SimpleNamespace(x=0.0, y=0.0, z=0.0),
        orientation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
    )
    return SimpleNamespace(
        header=SimpleNamespace(frame_id='map'),
        info=SimpleNamespace(width=width, height=height, resolution=RESOLUTION, origin=pose),
        data=array.array('b', cells.tobytes()),
    )
