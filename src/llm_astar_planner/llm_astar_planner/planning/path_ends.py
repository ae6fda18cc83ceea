"""A path that begins and ends exactly where it was asked for, not at the centres of cells."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import BORDER_TOLERANCE
from numpy.typing import NDArray

from llm_astar_planner.planning.path_validator import CollisionChecker

# An end this near to the centre of its cell, in cells, is at it.
AT_CENTRE = 1e-9
# Ends of a path of one cell that are this near to each other, in cells, are the same place.
SAME_PLACE = 1e-3
# Where a path begins and ends exactly, [2] each; None: at the centre of its cell.
Ends = tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]


def with_exact_ends(
    points: NDArray[np.float64],
    start: NDArray[np.float64] | None,
    goal: NDArray[np.float64] | None,
    checker: CollisionChecker,
) -> NDArray[np.float64]:
    """Return a path [n, 2] in grid coordinates that begins at `start` and ends at `goal`, [2].

    These lie in the cells of its first and its last point; None leaves an end as it is. A path of
    one cell leads from `start` straight to `goal`; where they are the same place it stays one
    point.
    """
    if len(points) == 1:
        ends = [end for end in (start, goal) if end is not None]
        if len(ends) == 2 and np.abs(ends[1] - ends[0]).max() <= SAME_PLACE:
            del ends[1]
        return np.array(ends) if ends else points
    if start is not None:
        points = with_exact_goal(points[::-1], start, checker)[::-1]
    return points if goal is None else with_exact_goal(points, goal, checker)


def ends_that_fit(
    points: NDArray[np.float64],
    ends: Ends,
    checker: CollisionChecker,
    fits: Callable[[NDArray[np.float64]], bool],
) -> Ends:
    """Return the ends with which a path [n, 2] `fits`: both if possible, else one of them."""
    start, goal = ends
    for kept in (ends, (None, goal), (start, None)):
        if fits(with_exact_ends(points, *kept, checker)):
            return kept
    return None, None


def with_exact_goal(
    points: NDArray[np.float64], goal: NDArray[np.float64], checker: CollisionChecker
) -> NDArray[np.float64]:
    """Return a path [n, 2] that ends at `goal`, [2], which lies in the cell of its last point.

    The straight line to `goal` replaces the points in that cell if it passes through free cells
    alone. Else it leads on from the last point, which never leaves the cell.
    """
    if np.abs(points[-1] - goal).max() <= AT_CENTRE:
        return points
    last = len(points) - 1
    cell = cell_of(points[-1])
    while last > 0 and cell_of(points[last]) == cell:
        last -= 1
    if not checker.is_free(crossed_cells(points[last], goal)):
        last = len(points) - 1
    return np.concatenate((points[: last + 1], goal[None]))


def cell_of(point: NDArray[np.float64]) -> tuple[int, int]:
    """Return the cell (x, y) of a point [2] in grid coordinates."""
    x, y = point.tolist()
    shift = 0.5 + BORDER_TOLERANCE
    return math.floor(x + shift), math.floor(y + shift)


def crossed_cells(begin: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the cells (x, y) that a straight line passes through, int64 [n, 2]: all of them.

    `begin` and `end` [2] are points in grid coordinates.
    """
    (left, low), (right, high) = sorted((begin.tolist(), end.tolist()))
    shift = 0.5 + BORDER_TOLERANCE
    cells = []
    for column in range(math.floor(left + shift), math.floor(right + shift) + 1):
        # Where the line enters and leaves the column.
        enters, leaves = low, high
        if left < column - 0.5:
            enters += (column - 0.5 - left) / (right - left) * (high - low)
        if right > column + 0.5:
            leaves += (column + 0.5 - right) / (right - left) * (high - low)
        rows = sorted((math.floor(enters + shift), math.floor(leaves + shift)))
        cells += [(column, row) for row in range(rows[0], rows[1] + 1)]
    return np.array(cells, dtype=np.int64)
