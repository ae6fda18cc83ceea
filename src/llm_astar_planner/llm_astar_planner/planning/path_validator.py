"""The last check before a path leaves: written apart from the searches it checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.result import Cell


class Mask(Protocol):
    """Where a path may not go: bool [height, width], or what reads like it."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Height and width."""

    def __getitem__(
        self, places: tuple[NDArray[np.int32], NDArray[np.int32]]
    ) -> NDArray[np.bool_]:
        """Tell which of the cells at `rows, columns` are barred."""


def path_problem(  # noqa: PLR0911 - one return a rule
    path: NDArray[np.int32],
    blocked: Mask,
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


def via_problem(path: NDArray[np.int32], via: Sequence[Cell]) -> str | None:
    """Say which of the cells `via` a path [n, 2] does not pass in their order, or None."""
    place = 0
    for number, cell in enumerate(via, start=1):
        there = (path[place:] == cell).all(axis=1)
        if not there.any():
            return f'it does not pass via {number} {cell} in its turn'
        place += int(there.argmax())
    return None


def shift_problem(name: str, asked: Cell, taken: Cell, most: float) -> str | None:
    """Say that an end was moved by more than `most` cells, or None."""
    distance = math.dist(asked, taken)
    if distance <= most * (1.0 + 1e-6):
        return None
    return f'its {name} {taken} is {distance:.2f} cells off {asked}, over the {most:.2f} allowed'


def legs_problem(points: NDArray[np.int32], blocked: Mask, *, corner_cutting: bool) -> str | None:
    """Say what is wrong with straight legs between cells [n, 2] at any angle, or None.

    Every cell that a leg passes through must be free, and so must both cells beside a corner
    that it passes exactly over, unless `corner_cutting`.
    """
    for begin, end in zip(points[:-1].tolist(), points[1:].tolist()):
        cells, corners = _crossed(np.array(begin, float), np.array(end, float))
        hit = blocked[cells[:, 1], cells[:, 0]]
        if hit.any():
            return f'the leg from {tuple(begin)} hits an obstacle at {_show(cells[hit.argmax()])}'
        if not corner_cutting and len(corners):
            beside = np.concatenate([corners[:, [0, 3]], corners[:, [2, 1]]])
            if blocked[beside[:, 1], beside[:, 0]].any():
                return f'the leg from {tuple(begin)} cuts a corner'
    return None


def _crossed(
    begin: NDArray[np.float64], end: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the cells [n, 2] a leg passes through, and the corners it passes exactly over.

    A corner is given by the cells (x, y, x, y) before and after it. Between two borders that
    the leg crosses lies one cell; two at once are a corner.
    """
    step = end - begin
    crossings = [np.array([0.0, 1.0])]
    for axis in (0, 1):
        low, high = sorted((begin[axis], end[axis]))
        if step[axis]:
            crossings.append((np.arange(low + 0.5, high) - begin[axis]) / step[axis])
    times = np.sort(np.concatenate(crossings))
    double = np.diff(times) < 1e-9
    middles = ((times[:-1] + times[1:]) / 2)[~double]
    cells = np.rint(begin + middles[:, None] * step).astype(np.int32)
    corners = begin + times[:-1][double][:, None] * step
    before = np.rint(corners - 0.5 * np.sign(step)).astype(np.int32)
    after = np.rint(corners + 0.5 * np.sign(step)).astype(np.int32)
    return cells, np.hstack([before, after])


def _show(cell: NDArray[np.int32]) -> str:
    return f'({cell[0]}, {cell[1]})'
