"""Where a path really begins and ends: what tolerances make of cells that cannot be had.

The goal becomes the nearest cell that the start reaches, by the distance from the goal cell's
centre. A start that is not free becomes the nearest free cell to which the robot need not cross a
lethal one, in the goal's part of the map if there is one; the path then begins there, and the
robot has to get to it by itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.inflation import squared_cells
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.result import Cell

# Cells looked round first; the square is doubled while nothing is found in it.
_FIRST_REACH = 8


class PlanningFailure(NamedTuple):
    """Why nothing can be planned."""

    code: ResultCode
    message: str


class Ends(NamedTuple):
    """The cells to plan between, how many metres off those asked for, and a sentence on each."""

    start: Cell
    goal: Cell
    start_shift: float = 0.0
    goal_shift: float = 0.0
    warnings: tuple[str, ...] = ()


def resolve_endpoints(costmap: Costmap, request: PlanRequest) -> Ends | PlanningFailure:
    """Return where to plan from and to, or why that cannot be."""
    start = _find_start(costmap, request)
    if isinstance(start, PlanningFailure):
        return start
    goal = _find_goal(costmap, request, start)
    if isinstance(goal, PlanningFailure):
        return goal
    resolution = costmap.grid_map.resolution
    start_shift = math.dist(request.start, start) * resolution
    goal_shift = math.dist(request.goal, goal) * resolution
    warnings = []
    if start != request.start:
        message = f'the start cell {request.start} is not free; the path begins at {start}'
        warnings.append(f'{message}, {start_shift:.2f} m off')
    if goal != request.goal:
        refusal = _goal_refusal(costmap, request.goal)
        warnings.append(f'{refusal.message}; the path ends at {goal}, {goal_shift:.2f} m off')
    return Ends(start, goal, start_shift, goal_shift, tuple(warnings))


def via_refusal(costmap: Costmap, via: Iterable[Cell], start: Cell) -> PlanningFailure | None:
    """Say why the first via cell that cannot be passed cannot, in the codes of a goal, or None."""
    for number, cell in enumerate(via, start=1):
        name = f'via {number}'
        if not costmap.grid_map.contains(cell):
            return PlanningFailure(ResultCode.GOAL_OUTSIDE_MAP, _outside(costmap, name, cell))
        if not costmap.is_free(cell):
            return PlanningFailure(ResultCode.GOAL_OCCUPIED, _barred(costmap, name, cell))
        if _component(costmap, cell) != _component(costmap, start):
            message = f'obstacles cut {name}, cell {cell}, off from the start'
            return PlanningFailure(ResultCode.NO_VALID_PATH, message)
    return None


def nearest(
    labels: NDArray[np.int32], label: int, centre: Cell, squared_reach: int
) -> Cell | None:
    """Return the cell of a label that is nearest to `centre`, which may lie off the map.

    `labels` is int [height, width]. None where no cell has it within the squared distance.
    """
    height, width = labels.shape
    most = math.isqrt(squared_reach)
    gap = max(-centre[0], centre[0] - width + 1, -centre[1], centre[1] - height + 1)
    if gap > most:
        return None
    reach = min(max(_FIRST_REACH, gap), most)
    while True:
        rows, columns = _window(labels.shape, centre, reach)
        y, x = np.nonzero(labels[rows, columns] == label)
        squared = (x + columns.start - centre[0]) ** 2 + (y + rows.start - centre[1]) ** 2
        whole = rows.stop - rows.start == height and columns.stop - columns.start == width
        last = whole or reach == most
        if len(squared) and squared.min() <= (squared_reach if last else reach**2):
            first = int(squared.argmin())
            return int(x[first]) + columns.start, int(y[first]) + rows.start
        if last:
            return None
        reach = min(2 * reach, most)


def _find_start(costmap: Costmap, request: PlanRequest) -> Cell | PlanningFailure:
    start = request.start
    if not costmap.grid_map.contains(start):
        return PlanningFailure(ResultCode.START_OUTSIDE_MAP, _outside(costmap, 'start', start))
    if costmap.is_free(start):
        return start
    message = _barred(costmap, 'start', start)
    if request.start_tolerance == 0.0:
        return PlanningFailure(ResultCode.START_OCCUPIED, message)
    escape = _escape(costmap, request)
    if escape is not None:
        return escape
    message += f', nor can a free cell be reached within {request.start_tolerance:g} m'
    return PlanningFailure(ResultCode.START_OCCUPIED, message)


def _find_goal(costmap: Costmap, request: PlanRequest, start: Cell) -> Cell | PlanningFailure:
    component = _component(costmap, start)
    goal = request.goal
    if costmap.grid_map.contains(goal) and _component(costmap, goal) == component:
        return goal
    if request.tolerance > 0.0:
        reach = squared_cells(request.tolerance, costmap.grid_map.resolution)
        found = nearest(costmap.components, component, goal, reach)
        if found is not None:
            return found
    refusal = _goal_refusal(costmap, goal)
    if request.tolerance == 0.0:
        return refusal
    message = f'{refusal.message}, nor is any cell within {request.tolerance:g} m of it reachable'
    return PlanningFailure(refusal.code, message)


def _goal_refusal(costmap: Costmap, goal: Cell) -> PlanningFailure:
    """Say what is wrong with a goal that the start does not reach."""
    if not costmap.grid_map.contains(goal):
        return PlanningFailure(ResultCode.GOAL_OUTSIDE_MAP, _outside(costmap, 'goal', goal))
    if not costmap.is_free(goal):
        return PlanningFailure(ResultCode.GOAL_OCCUPIED, _barred(costmap, 'goal', goal))
    return PlanningFailure(ResultCode.NO_VALID_PATH, 'obstacles cut the goal off from the start')


def _escape(costmap: Costmap, request: PlanRequest) -> Cell | None:
    """Return the free cell that a robot at an occupied start had best go to, or None."""
    start, resolution = request.start, costmap.grid_map.resolution
    squared_reach = squared_cells(request.start_tolerance, resolution)
    rows, columns = _window(costmap.blocked.shape, start, math.isqrt(squared_reach))
    y, x = np.ogrid[rows, columns]
    squared = (x - start[0]) ** 2 + (y - start[1]) ** 2
    lethal = costmap.grid_map.cells[rows, columns] >= costmap.config.occupied_threshold
    passable = (squared <= squared_reach) & ~lethal
    if not passable.any():
        return None
    # Who stands on a lethal cell is taken to stand beside it, on the side he is nearest to.
    foot = np.where(passable, squared, squared_reach + 1).argmin()
    regions, _ = ndimage.label(passable)
    components = np.where(regions == regions.flat[foot], costmap.components[rows, columns], 0)
    best = _best_of(components, costmap, request)
    if not best.any():
        return None
    place = int(np.where(best, squared, squared_reach + 1).argmin())
    row, column = divmod(place, best.shape[1])
    return column + columns.start, row + rows.start


def _best_of(
    components: NDArray[np.int32], costmap: Costmap, request: PlanRequest
) -> NDArray[np.bool_]:
    """Return which of some cells to begin at: in the goal's part of the map, near it, or any."""
    goal = request.goal
    if costmap.grid_map.contains(goal) and costmap.is_free(goal):
        with_goal: NDArray[np.bool_] = components == _component(costmap, goal)
        if with_goal.any():
            return with_goal
    reach = squared_cells(request.tolerance, costmap.grid_map.resolution)
    rows, columns = _window(costmap.blocked.shape, goal, math.isqrt(reach))
    near = costmap.components[rows, columns]
    if near.size:
        y, x = np.ogrid[rows, columns]
        near = near[(x - goal[0]) ** 2 + (y - goal[1]) ** 2 <= reach]
    near_goal: NDArray[np.bool_] = np.isin(components, near[near > 0])
    return near_goal if near_goal.any() else components > 0


def _window(shape: tuple[int, ...], centre: Cell, reach: int) -> tuple[slice, slice]:
    """Return the rows and columns of the map within `reach` of a cell, which may be off it."""
    height, width = shape
    columns, rows = (
        slice(min(max(place - reach, 0), size), min(max(place + reach + 1, 0), size))
        for place, size in zip(centre, (width, height))
    )
    return rows, columns


def _component(costmap: Costmap, cell: Cell) -> int:
    return int(costmap.components[cell[1], cell[0]])


def _outside(costmap: Costmap, name: str, cell: Cell) -> str:
    size = f'{costmap.grid_map.width} x {costmap.grid_map.height}'
    return f'the {name} cell {cell} is outside the map of {size} cells'


def _barred(costmap: Costmap, name: str, cell: Cell) -> str:
    return f'the {name} cell {cell} is not free ({costmap.describe_blocked(cell)})'
