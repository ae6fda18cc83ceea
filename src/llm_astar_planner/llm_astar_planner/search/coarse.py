# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A cheapest route over the tiles of a grid, as the few cells at which it turns.

The nodes are the connected parts of each tile, so a door of one cell is never lost: where cells
connect, the nodes do. The cost of a route is that of the shortest moves between the middles of
the parts, over the borders where they touch, times the mean price of the cells of each part.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from llm_astar_planner.search._kernels import coarse as kernels
from llm_astar_planner.search.arrays import Int64s
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
        counts, nodes = tiles.tables.counts, tiles.components.size
        sizes = np.zeros(nodes, dtype=np.int64)
        self._places = np.zeros((nodes, 2), dtype=np.int64)
        self._prices = np.ones(nodes if grid.cell_surcharge.size else 0, dtype=np.float32)
        kernels.describe_nodes(
            tiles.tables, grid.cell_surcharge, sizes, self._places, self._prices
        )
        # Tiles that are free with all eight around them, none cut off by the edge of the grid.
        only = tiles.tables.nodes[:-1].reshape(counts.shape) + (counts > 0)
        is_free = (counts > 0) & (sizes[only] == 1 << 2 * tiles.tables.shift)
        self._is_open = sliding_window_view(np.pad(is_free, 1), (3, 3)).all(axis=(2, 3))

    def turns(self, start: Cell, goal: Cell, most: int = EVERY_NODE) -> Int64s | None:
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
        rules = grid.blocked, grid.cell_surcharge, grid.corner_cutting
        graph = tiles.tables, self._is_open, self._places, self._prices
        points = kernels.taut_route(graph, start, goal, most, rules)
        if not points:
            raise TimeoutError(f'no route after {most} nodes')
        return np.array(points[1:-1], dtype=np.int64).reshape(-1, 2)


def compile_routes() -> None:
    """Compile what routes run, or load it from numba's cache, so that the first need not."""
    blocked = np.zeros((24, 24), dtype=np.bool_)
    blocked[4:, 12] = True
    # As those of costmaps are; numba compiles once more for arrays that can be written to.
    blocked.flags.writeable = False
    CoarseGraph(Tiles.build(blocked), GridGraph(blocked)).turns((2, 20), (21, 20))
