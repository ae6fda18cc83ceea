"""Records the order in which a search expands cells, to compare the compiled searches with.

This is a second implementation of the paper's A* and LLM-A* that shares no code with the compiled
kernels. It is a thousand times slower, and tests compare the two expansion by expansion.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray

Point = tuple[float, float]
NEIGHBOURS = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))


@dataclass(frozen=True)
class Trace:
    """One search: the cells in `order` of expansion, the target `switches`, and the path.

    `switches` holds the number of expansions before each new target. `path` is empty where the
    search found none.
    """

    order: list[Cell]
    switches: list[int]
    path: list[Cell]


def trace(
    blocked: NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    targets: Sequence[Point] = (),
    heuristic: str = 'euclidean',
) -> Trace:
    """Search `blocked` [height, width] by the paper's rules, which allow cutting corners.

    `targets` is the paper's target list without the start; without targets this is A*.
    """
    return TracedSearch(blocked, start, goal, targets, heuristic).run()


def distance(heuristic: str, a: Point, b: Point) -> float:
    """Return the heuristic distance of two points. Raises ValueError for an unknown heuristic."""
    dx, dy = abs(a[0] - b[0]), abs(a[1] - b[1])
    if heuristic == 'euclidean':
        return math.sqrt(dx * dx + dy * dy)
    if heuristic == 'chebyshev':
        return max(dx, dy)
    raise ValueError(f'heuristic {heuristic!r} cannot be traced')


class TracedSearch:
    """One search that records its expansions."""

    def __init__(
        self,
        blocked: NDArray[np.bool_],
        start: Cell,
        goal: Cell,
        targets: Sequence[Point],
        heuristic: str,
    ) -> None:
        """Put the start into the open list."""
        self.blocked, self.start, self.goal = blocked, start, goal
        self.targets, self.heuristic = list(targets), heuristic
        self.index = 0
        self.g: dict[Cell, float] = {start: 0.0}
        self.parent: dict[Cell, Cell] = {start: start}
        self.open = [(self.priority(start), start)]
        self.closed: set[Cell] = set()
        self.order: list[Cell] = []
        self.switches: list[int] = []

    def run(self) -> Trace:
        """Search until the goal is expanded or no cell is left."""
        while self.open:
            _, cell = heapq.heappop(self.open)
            self.order.append(cell)
            self.closed.add(cell)
            if cell == self.goal:
                return Trace(self.order, self.switches, self.path_to_start())
            for dx, dy in NEIGHBOURS:
                self.consider(cell, (cell[0] + dx, cell[1] + dy))
        return Trace(self.order, self.switches, [])

    def consider(self, cell: Cell, neighbour: Cell) -> None:
        """Try to reach a neighbour from `cell`.

        The target switches even where the neighbour is blocked, as in the published code.
        """
        if self.targets and neighbour == self.targets[self.index] and neighbour != self.goal:
            self.index += 1
            self.switches.append(len(self.order))
            self.open = [(self.priority(entry), entry) for _, entry in self.open]
            heapq.heapify(self.open)
        if neighbour in self.closed or self.blocked[cell[::-1]] or self.blocked[neighbour[::-1]]:
            return
        g = self.g[cell] + math.hypot(neighbour[0] - cell[0], neighbour[1] - cell[1])
        if g < self.g.get(neighbour, math.inf):
            self.g[neighbour] = g
            self.parent[neighbour] = cell
            heapq.heappush(self.open, (self.priority(neighbour), neighbour))

    def priority(self, cell: Cell) -> float:
        """Return f = g + h(goal) + h(target)."""
        estimate = distance(self.heuristic, cell, self.goal)
        if self.targets:
            estimate += distance(self.heuristic, cell, self.targets[self.index])
        return self.g[cell] + estimate

    def path_to_start(self) -> list[Cell]:
        """Return the path, found by following the parents back from the goal."""
        path = [self.goal]
        while path[-1] != self.start:
            path.append(self.parent[path[-1]])
        return path[::-1]
