# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A cheapest route over the tiles of a grid, as the few cells at which it turns.

The nodes are the connected parts of each tile, so a door of one cell is never lost: where cells
connect, the nodes do. The cost of a route is that of the shortest moves between the middles of
the parts, over the borders where they touch, times the mean price of the cells of each part.
"""

from __future__ import annotations

from itertools import count

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import coarse as kernels
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.tiles import Tiles

EVERY_NODE = 2**62


class CoarseGraph:
    """The nodes of a grid's tiles, prepared for routes. Many threads may use it at once."""

    def __init__(self, tiles: Tiles, grid: GridGraph) -> None:
        """Find the middle of each node and, with graded costs, its price: O(cells).

        `tiles` are those of the grid.
        """
        self._tiles = tiles
        self._grid = grid
        nodes = tiles.components.size
        self._places = np.zeros(nodes, dtype=np.int64)
        self._prices = np.ones(nodes if grid.cell_surcharge.size else 0, dtype=np.float32)
        self._is_open = np.zeros(tiles.tables.counts.shape, dtype=np.bool_)
        kernels.describe_nodes(
            tiles.tables, grid.cell_surcharge, self._places, self._prices, self._is_open
        )
        self._highest_price = float(self._prices.max(initial=1.0))
        self._spare: list[kernels.Workspace] = []
        self._generations = count(1)

    def turns(self, start: Cell, goal: Cell, most: int = EVERY_NODE) -> NDArray[np.int64] | None:
        """Return the cells (x, y), int64 [n, 2], at which a route turns between start and goal.

        They are free, and each sees the one before and the next. None where there is no route.
        Raises ValueError for a cell off the grid, and TimeoutError where more than `most` nodes
        would have to be expanded.
        """
        tiles, grid = self._tiles, self._grid
        grid.index(start)
        grid.index(goal)
        component = tiles[start[1], start[0]]
        if component == 0 or component != tiles[goal[1], goal[0]]:
            return None
        points = self._route(start, goal, most)
        rules = grid.blocked, grid.cell_surcharge, grid.corner_cutting
        return kernels.taut(rules, tiles.tables.shift, points)

    def _route(self, start: Cell, goal: Cell, most: int) -> NDArray[np.int64]:
        """Return the cells of a cheapest route, start and goal included: int64 [n, 2]."""
        try:
            workspace = self._spare.pop()
        except IndexError:
            nodes = self._places.size
            workspace = kernels.Workspace(
                np.zeros(nodes),
                np.zeros((nodes, 3), dtype=np.int32),
                np.zeros(nodes, dtype=np.int64),
            )
        try:
            ended, node = kernels.route(
                self._tiles.tables, self._is_open, self._places, self._prices,
                self._highest_price, start, goal, next(self._generations), workspace, most,
            )  # fmt: skip
            if ended != kernels.ROUTE:
                raise TimeoutError(f'no route after {most} nodes')
            return np.asarray(kernels.trace(start, goal, node, self._places, workspace.parents))
        finally:
            self._spare.append(workspace)


def compile_kernels() -> None:
    """Compile what routes run, or load it from numba's cache, so that the first need not."""
    blocked = np.zeros((24, 24), dtype=np.bool_)
    blocked[4:, 12] = True
    # As those of costmaps are; numba compiles once more for arrays that can be written to.
    blocked.flags.writeable = False
    CoarseGraph(Tiles.build(blocked), GridGraph(blocked)).turns((2, 20), (21, 20))
