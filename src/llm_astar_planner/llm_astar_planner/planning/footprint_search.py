# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Makes paths ones that the robot's polygon passes: checks them, and searches again by heading.

The robot moves straight ahead and turns on the spot, so a pose is free, or not, by its heading.
Where a path does not fit, A* over cells and headings looks for the cheapest that does.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning._kernels import footprint as kernels
from llm_astar_planner.planning.endpoints import window_around
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.segment import SegmentPlanner
from llm_astar_planner.planning.types import Endpoints, PlanningFailure, PlanRequest, ResultCode
from llm_astar_planner.search.arrays import Bools, Float64s, Int8s, Int32s, Int64s, StopFlag
from llm_astar_planner.search.headings import (
    EVERY_HEADING,
    HEADINGS,
    HeadingSearch,
    SweptCells,
    swept_cells,
)
from llm_astar_planner.search.result import Cell, SearchStatus

# Cells; a larger footprint would take too long to prepare.
MAX_REACH = 1000.0
# Cells that are tried, nearest first, where the footprint does not fit at the one requested.
MAX_CELLS = 20_000
ROUNDING = 1e-6
ANGLES = [2.0 * math.pi / HEADINGS * heading for heading in range(HEADINGS)]
CLEARED = 'the footprint meets an obstacle where the robot stands: cells under it count as free'
NO_TURN = 'the footprint cannot turn on the spot at the start to where the path leads'


def fit_footprint(
    costmap: Costmap,
    request: PlanRequest,
    endpoints: Endpoints,
    segments: Sequence[SegmentPlanner],
    deadline: float,
) -> Endpoints:
    """Search the segments again, by heading, if the footprint of the request cannot pass them.

    Returns the endpoints, moved within the tolerances if need be, with warnings. Raises
    PlanningFailure if there is no path that the footprint passes, or none until the deadline
    (monotonic seconds), and PathTooLongError.
    """
    search = FootprintSearch(costmap, request, endpoints, deadline)
    yaw = search.start_yaw
    for segment in segments:
        is_last = segment is segments[-1]
        path, goal_yaw = segment.result.path, search.goal_yaw if is_last else None
        if search.checker.path_collides(path, yaw, goal_yaw):
            path = search.search_again(segment, yaw, segment is segments[0], is_last)
        # The next segment begins as this one ends.
        ahead = np.flatnonzero((path != path[-1]).any(axis=1))
        if len(ahead):
            step = path[-1] - path[ahead[-1]]
            yaw = math.atan2(step[1], step[0])
    goal, shift = search.endpoints.goal, search.endpoints.goal_shift
    if goal != endpoints.goal:
        search.warn(f'the footprint gets no nearer to the goal than {goal}, {shift:.2f} m off')
    return search.endpoints


def collides(costmap: Costmap, request: PlanRequest, points: NDArray[Any]) -> bool:
    """Tell whether the footprint of a request collides on straight segments through points [n, 2].

    It also turns at the ends, from the start's yaw and to the goal's.
    """
    search = FootprintSearch(costmap, request)
    return search.checker.path_collides(points, search.start_yaw, search.goal_yaw)


class FootprintSearch:
    """Checks and searches for one request with a footprint; `endpoints` are those it ends with.

    Where the robot's footprint collides at the start, the cells under it count as free: the robot
    is there.
    """

    def __init__(
        self,
        costmap: Costmap,
        request: PlanRequest,
        endpoints: Endpoints | None = None,
        deadline: float = 0.0,
    ) -> None:
        """Take the request, and for a search the cells to plan between and monotonic seconds.

        Raises ValueError for a request without a footprint.
        """
        if request.footprint is None:
            raise ValueError('footprint: the request has none')
        yaw = costmap.grid_map.origin.yaw
        self.costmap = costmap
        self.request = request
        self.endpoints = endpoints or Endpoints(request.start, request.goal)
        self.deadline = deadline
        self.checker = FootprintChecker(costmap, request.footprint)
        # Relative to the grid.
        self.start_yaw = None if request.start_pose is None else request.start_pose.yaw - yaw
        self.goal_yaw = None if request.goal_yaw is None else request.goal_yaw - yaw
        pose = request.start_pose
        if pose is not None and self.checker.collisions(pose).any():
            self.warn(CLEARED)
            self.checker = self.checker.cleared(pose)

    def passes_ends(self, points: Float64s) -> bool:
        """Tell whether the footprint passes the first two and last two moves of a path [n, 2]."""
        first, last = points[:3], points[-3:]
        return not (
            self.checker.path_collides(first, self.start_yaw)
            or self.checker.path_collides(last, None, self.goal_yaw)
        )

    def warn(self, warning: str) -> None:
        """Add a warning to the endpoints."""
        warnings = (*self.endpoints.warnings, warning)
        self.endpoints = self.endpoints._replace(warnings=warnings)

    def failure(self, reason: str, code: ResultCode = ResultCode.NO_VALID_PATH) -> PlanningFailure:
        """Return what to raise where no path fits the footprint."""
        footprint = self.checker.footprint
        return PlanningFailure(code, f'no path fits the footprint ({footprint}): {reason}')

    def search_again(
        self, segment: SegmentPlanner, yaw: float | None, is_first: bool, is_last: bool
    ) -> Int32s:
        """Search a segment by heading, from a yaw on; return its path [n, 2].

        Raises PlanningFailure and PathTooLongError.
        """
        if segment.product is not None:
            raise self.failure('it meets an obstacle on the way that keeps to the instruction')
        begin = time.monotonic()
        swept = self.swept()
        start, goal = segment.request.start, segment.request.goal
        if is_first:
            self.move_start()
            start = self.endpoints.start
        if is_last:
            self.move_goal()
            goal = self.endpoints.goal
        search = HeadingSearch(
            segment.costmap.grid_graph, self.checker.obstacles, swept, start, goal
        )
        ends = self.headings_at(goal, self.goal_yaw) if is_last else EVERY_HEADING
        status = self.run(search, segment.stop, (self.headings_at(start, yaw), ends))
        if status is SearchStatus.EXHAUSTED and is_first and yaw is not None:
            # The robot is there anyway, and may get away in a manner of its own.
            status = self.run(search, segment.stop, (EVERY_HEADING, ends))
            self.warn(NO_TURN)
        found = status is SearchStatus.FOUND
        state = search.found if found else self.nearest_reached(search, is_last)
        result = search.result(state, want_expanded=segment.request.want_expanded)
        segment.take(result, time.monotonic() - begin)
        return segment.result.path

    def run(
        self, search: HeadingSearch, stop: StopFlag, headings: tuple[int, int]
    ) -> SearchStatus:
        """Run a search between headings at the start and at the goal, bits of masks.

        Raises PlanningFailure if it is stopped, and PathTooLongError.
        """
        status = search.run(*headings, self.deadline, stop)
        if status is SearchStatus.STOPPED:
            reason = 'cancelled' if stop[0] else 'out of time'
            message = f'{reason} while looking for a path that fits the footprint'
            raise PlanningFailure(ResultCode.TIMEOUT, message)
        return status

    def swept(self) -> SweptCells:
        """Return what each motion sweeps. Raises PlanningFailure for too many cells."""
        points = self.checker.points
        if np.abs(points).max() > MAX_REACH:
            message = f'the footprint is over {MAX_REACH:.0f} cells large, too large to search for'
            raise PlanningFailure(ResultCode.UNKNOWN, message)
        return swept_cells(tuple((x, y) for x, y in points.tolist()))

    def nearest_reached(self, search: HeadingSearch, is_last: bool) -> int:
        """Return a state of an exhausted search at the reached cell nearest to the goal.

        The cell lies within the tolerance, and becomes the goal. Raises PlanningFailure if there
        is none, and for a goal that is a via point.
        """
        metres = self.request.tolerance if is_last else -1.0
        for cell in self.fitting_cells(self.request.goal, metres, self.goal_yaw):
            reached = search.reached(cell)
            ends = self.headings_at(cell, self.goal_yaw) if reached else 0
            for heading in reached:
                if ends >> heading & 1:
                    self.end_at(cell)
                    return search.grid.index(cell) * HEADINGS + heading
        x, y = self.costmap.grid_map.grid_to_world(search.farthest())[0]
        raise self.failure(f'it gets no farther than ({x:.2f}, {y:.2f}) m')

    def move_start(self) -> None:
        """Begin at the nearest cell within the tolerance where the footprint fits, if any.

        It looks there as the robot does. The start stays if it fits, and if no cell does.
        """
        request, start = self.request, self.endpoints.start
        if self.start_yaw is None or self.fits(start, self.start_yaw):
            return
        cells = self.fitting_cells(request.start, request.start_tolerance, self.start_yaw)
        cell = next(cells, None)
        if cell is not None:
            shift = math.dist(cell, request.start) * self.costmap.grid_map.resolution
            warning = f'the path begins at {cell}, {shift:.2f} m off, where the footprint fits'
            self.warn(warning)
            self.endpoints = self.endpoints._replace(start=cell, start_shift=shift)

    def move_goal(self) -> None:
        """End at the nearest cell within the tolerance where the footprint fits.

        Raises PlanningFailure if there is none.
        """
        if self.fits(self.endpoints.goal, self.goal_yaw):
            return
        request = self.request
        cell = next(self.fitting_cells(request.goal, request.tolerance, self.goal_yaw), None)
        if cell is None:
            within = request.tolerance > 0.0
            code = ResultCode.NO_VALID_PATH if within else ResultCode.GOAL_OCCUPIED
            reason = f'it meets an obstacle at the goal {request.goal}'
            if within:
                reason += f' and at each cell within {request.tolerance:g} m of it'
            raise self.failure(reason, code)
        self.end_at(cell)

    def end_at(self, cell: Cell) -> None:
        """End at another cell than at the goal."""
        shift = math.dist(cell, self.request.goal) * self.costmap.grid_map.resolution
        self.endpoints = self.endpoints._replace(goal=cell, goal_shift=shift)

    def fits(self, cell: Cell, yaw: float | None) -> bool:
        """Tell whether the footprint is free at a cell, looking along yaw; None: along any."""
        return bool(self.free_cells(np.array([cell]), yaw)[0])

    def free_cells(self, cells: Int64s, yaw: float | None) -> Bools:
        """Tell at which cells [n, 2] the footprint is free, looking along yaw; None: along any."""
        free = np.zeros(len(cells), dtype=np.bool_)
        for angle in ANGLES if yaw is None else [yaw]:
            poses = np.column_stack([cells, np.full(len(cells), angle)])
            free |= ~self.checker.collisions_on_grid(poses)
        return free

    def fitting_cells(self, centre: Cell, metres: float, yaw: float | None) -> Iterator[Cell]:
        """Yield the cells, nearest first, around a cell at which the footprint is free.

        They are connected to the start for a robot that is a circle.
        """
        components = self.costmap.components
        if metres < 0.0:
            return
        reach = int(metres / self.costmap.grid_map.resolution + ROUNDING)
        rows, columns = window_around(components.shape, centre, reach)
        component = components[self.endpoints.start[1], self.endpoints.start[0]]
        y, x = np.nonzero(components[rows, columns] == component)
        cells = np.column_stack([x + columns.start, y + rows.start])
        squared = ((cells - centre) ** 2).sum(axis=1)
        nearest = np.argsort(squared, kind='stable')[: np.count_nonzero(squared <= reach**2)]
        cells = cells[nearest[:MAX_CELLS]]
        for cell in cells[self.free_cells(cells, yaw)]:
            yield int(cell[0]), int(cell[1])

    def headings_at(self, cell: Cell, yaw: float | None) -> int:
        """Return the headings, bits of a mask, from and to which it can turn at a cell."""
        if yaw is None:
            return EVERY_HEADING
        return sum(1 << h for h, a in enumerate(ANGLES) if self.checker.can_turn(cell, a, yaw))


# Cells [height, width], the threshold from which they are lethal, and whether unknown ones are.
Obstacles = tuple[Int8s, int, bool]


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
        return not kernels.turn_collides(self._rules, *map(float, place), (begin, end))

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
        return bool(kernels.path_collides(self._rules, points, *ends))

    def to_grid(self, poses: ArrayLike) -> Float64s:
        """Turn poses (x, y, yaw) [n, 3] in metres and radians into poses on the grid, in cells."""
        world = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        places = self.grid_map.world_to_grid(world[:, :2])
        return np.column_stack([places, world[:, 2] - self.grid_map.origin.yaw])

    def collisions(self, poses: ArrayLike) -> Bools:
        """Tell for each pose (x, y, yaw) [n, 3] whether it collides: bool [n].

        Metres and radians of the map's frame. One that is not finite collides.
        """
        return self.collisions_on_grid(self.to_grid(poses))

    def collisions_on_grid(self, poses: Float64s) -> Bools:
        """Tell for each pose [n, 3] in grid coordinates whether it collides: bool [n]."""
        found: Bools = kernels.all_collisions(self._rules, poses)
        return found
