"""The order in which a search expands, for animations and for checking the compiled searches.

A plain rewriting of the paper's A* and LLM-A*, kept apart from the compiled kernels: slower by a
thousand times, and a witness that what the pictures show is what was counted.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.result import Cell

Point = tuple[float, float]
_NEIGHBOURS = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))


@dataclass
class Trace:
    """A search in order: cells popped, `switches` (pops so far at each new target), the path.

    `path` is empty where the search found none.
    """

    order: list[Cell] = field(default_factory=list)
    switches: list[int] = field(default_factory=list)
    path: list[Cell] = field(default_factory=list)


def trace(
    blocked: NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    targets: Sequence[Point] = (),
    heuristic: str = 'euclidean',
) -> Trace:
    """Search `blocked` [height, width] as the paper does, corners cut.

    `targets` is the paper's target list after its start; none makes it A*.
    """
    return _Search(blocked, start, goal, targets, heuristic).run()


def distance(heuristic: str, a: Point, b: Point) -> float:
    """Return the distance of two points on an empty map. Raises ValueError for an unknown name."""
    dx, dy = abs(a[0] - b[0]), abs(a[1] - b[1])
    if heuristic == 'euclidean':
        return math.sqrt(dx * dx + dy * dy)
    if heuristic == 'chebyshev':
        return max(dx, dy)
    message = f'heuristic {heuristic!r} is not traced'
    raise ValueError(message)


class _Search:
    def __init__(
        self,
        blocked: NDArray[np.bool_],
        start: Cell,
        goal: Cell,
        targets: Sequence[Point],
        heuristic: str,
    ) -> None:
        self.blocked, self.start, self.goal = blocked, start, goal
        self.targets, self.heuristic = list(targets), heuristic
        self.index = 0
        self.g: dict[Cell, float] = {start: 0.0}
        self.parent: dict[Cell, Cell] = {start: start}
        self.open = [(self._key(start), start)]
        self.closed: set[Cell] = set()
        self.trace = Trace()

    def run(self) -> Trace:
        while self.open:
            _, cell = heapq.heappop(self.open)
            self.trace.order.append(cell)
            self.closed.add(cell)
            if cell == self.goal:
                self.trace.path = self._path()
                break
            for dx, dy in _NEIGHBOURS:
                self._reach(cell, (cell[0] + dx, cell[1] + dy))
        return self.trace

    def _reach(self, cell: Cell, neighbour: Cell) -> None:
        """Consider one neighbour; the target switches before it is known to be free."""
        if self.targets and neighbour == self.targets[self.index] and neighbour != self.goal:
            self.index += 1
            self.trace.switches.append(len(self.trace.order))
            self.open = [(self._key(entry), entry) for _, entry in self.open]
            heapq.heapify(self.open)
        if neighbour in self.closed or self._is_blocked(cell) or self._is_blocked(neighbour):
            return
        g = self.g[cell] + math.hypot(neighbour[0] - cell[0], neighbour[1] - cell[1])
        if g < self.g.get(neighbour, math.inf):
            self.g[neighbour] = g
            self.parent[neighbour] = cell
            heapq.heappush(self.open, (self._key(neighbour), neighbour))

    def _key(self, cell: Cell) -> float:
        estimate = distance(self.heuristic, cell, self.goal)
        if self.targets:
            estimate += distance(self.heuristic, cell, self.targets[self.index])
        return self.g[cell] + estimate

    def _is_blocked(self, cell: Cell) -> bool:
        return bool(self.blocked[cell[1], cell[0]])

    def _path(self) -> list[Cell]:
        path = [self.goal]
        while path[-1] != self.start:
            path.append(self.parent[path[-1]])
        return path[::-1]
