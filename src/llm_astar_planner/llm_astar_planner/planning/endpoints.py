# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Other ends where those of a request cannot be planned between: the nearest cells that can.

An unreachable goal or via point is replaced by the nearest cell that the start reaches, by the
distance to its own cell's centre. A blocked start is replaced by the nearest free cell that the
robot reaches without crossing a lethal cell, preferably one that is connected to the goal; the
path begins there and the robot has to get there by itself.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from llm_astar_planner.costmap.costmap import Costmap, squared_cells
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.planning.types import PlanningFailure, PlanRequest, ResultCode
from llm_astar_planner.search.arrays import Bools, Int32s
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.tiles import Tiles
from llm_astar_planner.waypoints.source import WaypointQuery, WaypointReply

NAME = 'viapoints'
# Components, and the number of those that are reached.
Reached = tuple[Tiles, int]
# Half the side, in cells, of the square that is searched first; it doubles until a cell is found.
FIRST_REACH = 8


def moved_start(costmap: Costmap, request: PlanRequest) -> Cell:
    """Return the free cell within `start_tolerance` that replaces a start which is not free."""
    start = request.start
    if not costmap.grid_map.contains(start):
        message = outside_message(costmap, 'start', start)
        raise PlanningFailure(ResultCode.START_OUTSIDE_MAP, message)
    message = blocked_message(costmap, 'start', start)
    if request.start_tolerance > 0.0:
        cell = nearest_reachable_free_cell(costmap, request)
        if cell is not None:
            return cell
        message += f', nor can a free cell be reached within {request.start_tolerance:g} m'
    raise PlanningFailure(ResultCode.START_OCCUPIED, message)


def moved_goal(
    costmap: Costmap, request: PlanRequest, goal: Cell, reached: Reached, name: str = 'goal'
) -> Cell:
    """Return the cell of a component within the tolerance that is nearest to a goal or via point.

    Raises PlanningFailure, naming it, if there is none.
    """
    tolerance = request.tolerance
    found = None
    if costmap.grid_map.contains(goal):
        found = nearest_reached(costmap, reached, goal, tolerance)
    if found is None:
        failure = goal_failure(costmap, request, goal, name)
        if tolerance == 0.0 or failure.code is ResultCode.GOAL_OUTSIDE_MAP:
            raise failure
        message = f'{failure}, nor is any cell within {tolerance:g} m of it reachable'
        raise PlanningFailure(failure.code, message)
    return found


def nearest_reached(
    costmap: Costmap, reached: Reached, cell: Cell, tolerance: float
) -> Cell | None:
    """Return the cell if it is of a component, else the nearest that is.

    None if there is none within so many metres.
    """
    components, component = reached
    if components.at(cell) == component:
        return cell
    if tolerance == 0.0:
        return None
    reach = squared_cells(tolerance, costmap.grid_map.resolution)
    return nearest_labelled(components, component, cell, reach)


def goal_failure(
    costmap: Costmap, request: PlanRequest, goal: Cell, name: str = 'goal'
) -> PlanningFailure:
    """Return what is wrong with a goal or via point that the start does not reach."""
    if not costmap.grid_map.contains(goal):
        message = outside_message(costmap, name, goal)
        return PlanningFailure(ResultCode.GOAL_OUTSIDE_MAP, message)
    if costmap.blocked[goal[1], goal[0]]:
        message = blocked_message(costmap, name, goal)
        return PlanningFailure(ResultCode.GOAL_OCCUPIED, message)
    end, begin = costmap.describe_cell(goal), costmap.describe_cell(request.start)
    components = costmap.components
    are_joined = components.at(goal) == components.at(request.start) > 0
    what = 'rules of the road' if are_joined else 'obstacles'
    message = f'{what} cut the {name} {end} off from the start {begin}'
    return PlanningFailure(ResultCode.NO_VALID_PATH, message)


def moved_via(costmap: Costmap, request: PlanRequest, used: tuple[Cell, ...]) -> str:
    """Say which via point the path passes at another cell, and how many more."""
    requested = request.via
    moved = [number for number, pair in enumerate(zip(requested, used)) if pair[0] != pair[1]]
    first = moved[0]
    shift = math.dist(requested[first], used[first]) * costmap.grid_map.resolution
    failure = goal_failure(costmap, request, requested[first], f'via {first + 1}')
    place = costmap.describe_cell(used[first])
    more = f'; so are {len(moved) - 1} more via points' if len(moved) > 1 else ''
    return f'{failure}; it is moved to {place}, {shift:.2f} m off{more}'


def nearest_labelled(
    labels: Tiles | Int32s, label: int, centre: Cell, squared_reach: int
) -> Cell | None:
    """Return the cell with `label` that is nearest to `centre`, which may lie off the map.

    `labels` is int [height, width]. None if no such cell lies within the squared distance, in
    cells.
    """
    height, width = labels.shape
    limit = math.isqrt(squared_reach)
    gap = max(-centre[0], centre[0] - width + 1, -centre[1], centre[1] - height + 1)
    if gap > limit:
        return None
    reach = min(max(FIRST_REACH, gap), limit)
    while True:
        rows, columns = window_around(labels.shape, centre, reach)
        y, x = np.nonzero(labels[rows, columns] == label)
        squared = (x + columns.start - centre[0]) ** 2 + (y + rows.start - centre[1]) ** 2
        whole = rows.stop - rows.start == height and columns.stop - columns.start == width
        last = whole or reach == limit
        if len(squared) and squared.min() <= (squared_reach if last else reach**2):
            first = int(squared.argmin())
            return int(x[first]) + columns.start, int(y[first]) + rows.start
        if last:
            return None
        reach = min(2 * reach, limit)


def nearest_reachable_free_cell(costmap: Costmap, request: PlanRequest) -> Cell | None:
    """Return the free cell that a robot at a blocked start should go to, or None.

    It lies within `start_tolerance` and is reached without crossing a lethal cell.
    """
    start, resolution = request.start, costmap.grid_map.resolution
    squared_reach = squared_cells(request.start_tolerance, resolution)
    rows, columns = window_around(costmap.blocked.shape, start, math.isqrt(squared_reach))
    y, x = np.ogrid[rows, columns]
    squared = (x - start[0]) ** 2 + (y - start[1]) ** 2
    lethal = costmap.grid_map.cells[rows, columns] >= costmap.config.occupied_threshold
    passable = (squared <= squared_reach) & ~lethal
    if not passable.any():
        return None
    # A robot on a lethal cell is assumed to be in the nearest passable one.
    robot = np.where(passable, squared, squared_reach + 1).argmin()
    regions, _ = ndimage.label(passable)
    components = np.where(regions == regions.flat[robot], costmap.components[rows, columns], 0)
    candidates = preferred_cells(components, costmap, request)
    if not candidates.any():
        return None
    place = int(np.where(candidates, squared, squared_reach + 1).argmin())
    row, column = divmod(place, candidates.shape[1])
    return column + columns.start, row + rows.start


def preferred_cells(components: Int32s, costmap: Costmap, request: PlanRequest) -> Bools:
    """Return which cells to begin at: connected to the goal, else to a cell near it, else any."""
    goal = request.goal
    if costmap.grid_map.contains(goal) and not costmap.blocked[goal[1], goal[0]]:
        with_goal: Bools = components == costmap.components[goal[1], goal[0]]
        if with_goal.any():
            return with_goal
    reach = squared_cells(request.tolerance, costmap.grid_map.resolution)
    rows, columns = window_around(costmap.blocked.shape, goal, math.isqrt(reach))
    near = costmap.components[rows, columns]
    if near.size:
        y, x = np.ogrid[rows, columns]
        near = near[(x - goal[0]) ** 2 + (y - goal[1]) ** 2 <= reach]
    near_goal: Bools = np.isin(components, near[near > 0])
    return near_goal if near_goal.any() else components > 0


def window_around(shape: tuple[int, ...], centre: Cell, reach: int) -> tuple[slice, slice]:
    """Return the rows and columns of the map within `reach` of a cell, which may be off it."""
    height, width = shape
    columns, rows = (
        slice(min(max(place - reach, 0), size), min(max(place + reach + 1, 0), size))
        for place, size in zip(centre, (width, height))
    )
    return rows, columns


def outside_message(costmap: Costmap, name: str, cell: Cell) -> str:
    """Say that an endpoint or via point is off the map."""
    width, height = costmap.grid_map.width, costmap.grid_map.height
    first, last = (costmap.describe_cell(end) for end in ((0, 0), (width - 1, height - 1)))
    place = f'{name} {costmap.describe_cell(cell)}'
    return f'the {place} is outside the map of {width} x {height} cells, from {first} to {last}'


def blocked_message(costmap: Costmap, name: str, cell: Cell) -> str:
    """Say why an endpoint or via point is blocked."""
    reason = costmap.describe_blocked(cell)
    return f'the {name} {costmap.describe_cell(cell)} is not free ({reason})'


@dataclass(frozen=True)
class ViapointSource:
    """Returns given cells (x, y); one that the start does not reach is moved as a goal would be.

    That is to the nearest cell that it reaches, at most `tolerance` metres away. Where there is
    none it stays where it is, for the check of waypoints to drop it and say why.
    """

    viapoints: tuple[Cell, ...]
    tolerance: float = 0.0
    name: str = NAME

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the via points; the detail says how many were moved and which had to stay."""
        deadline = time.monotonic() + query.time_limit
        components = query.costmap.components
        reached = components, components.at(query.start)

        def place(cell: Cell) -> Cell | None:
            # After its time no other cells are looked for.
            tolerance = self.tolerance if time.monotonic() <= deadline else 0.0
            return nearest_reached(query.costmap, reached, cell, tolerance)

        places = list(map(place, self.viapoints))
        lost = [number for number, place in enumerate(places, start=1) if place is None]
        moved = sum(place not in (None, cell) for place, cell in zip(places, self.viapoints))
        detail = f'{len(places) - len(lost)} of {len(places)} via points can be reached'
        if moved:
            detail += f', {moved} of them moved to a free cell near by'
        if lost:
            shown = ', '.join(map(str, lost[:5])) + (', ...' if len(lost) > 5 else '')
            detail += f'; not within {self.tolerance:g} m: number {shown}'
        kept = tuple(place or cell for place, cell in zip(places, self.viapoints))
        return WaypointReply(kept, NAME, detail=detail)
