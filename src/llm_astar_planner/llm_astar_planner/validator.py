"""The last check before a path leaves: written apart from the searches it checks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.result import Cell


def path_problem(  # noqa: PLR0911 - one return a rule
    path: NDArray[np.int32],
    blocked: NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    *,
    corner_cutting: bool,
) -> str | None:
    """Say what is wrong with a path of cells [n, 2] on `blocked` [height, width], or None.

    Checks that it runs from start to goal, on the map, over free cells, by single steps, and
    past no corner unless `corner_cutting`.
    """
    if len(path) == 0:
        return 'it is empty'
    if tuple(path[0]) != start or tuple(path[-1]) != goal:
        return f'it runs from {_show(path[0])} to {_show(path[-1])}'
    height, width = blocked.shape
    outside = (path < 0).any(axis=1) | (path[:, 0] >= width) | (path[:, 1] >= height)
    if outside.any():
        return f'it leaves the map at {_show(path[outside.argmax()])}'
    on_obstacle = blocked[path[:, 1], path[:, 0]]
    if on_obstacle.any():
        return f'it hits an obstacle at {_show(path[on_obstacle.argmax()])}'
    steps = np.diff(path, axis=0)
    jump = np.abs(steps).max(axis=1, initial=0) != 1
    if jump.any():
        return f'it jumps after {_show(path[jump.argmax()])}'
    if not corner_cutting:
        before, after = path[:-1], path[1:]
        corner = blocked[before[:, 1], after[:, 0]] | blocked[after[:, 1], before[:, 0]]
        if corner.any():
            return f'it cuts a corner after {_show(path[corner.argmax()])}'
    return None


def _show(cell: NDArray[np.int32]) -> str:
    return f'({cell[0]}, {cell[1]})'
