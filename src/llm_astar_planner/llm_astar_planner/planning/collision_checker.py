"""What the last check holds a path against: a map's cells, measured apart from the planner's."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMap
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from llm_astar_planner.costmap.config import CostmapConfig

# Less than the planner's own rounding, so that what it takes for free is not refused here.
_ROUNDING = 5e-7


class CollisionChecker:
    """Where a robot may not be on a map, read like a mask: `ground[rows, columns]`.

    Nothing here comes from the inflation or the search: occupancy is read from the map's cells,
    and distances are looked up in a k-d tree of the lethal ones, built once, when first needed.
    """

    def __init__(self, grid_map: GridMap, config: CostmapConfig) -> None:
        """Take a map and its rules."""
        self._cells = grid_map.cells
        self._config = config
        self._radius = config.robot_radius / grid_map.resolution

    def prepare(self) -> None:
        """Build the tree now instead of when it is first needed."""
        _ = self._tree

    @property
    def shape(self) -> tuple[int, ...]:
        """The map's height and width."""
        return self._cells.shape

    def __getitem__(
        self, places: tuple[NDArray[np.int32], NDArray[np.int32]]
    ) -> NDArray[np.bool_]:
        """Tell which of the cells at `rows, columns`, int [n] each, are barred: bool [n]."""
        rows, columns = places
        occupancy = self._cells[rows, columns]
        barred: NDArray[np.bool_] = occupancy >= self._config.occupied_threshold
        if not self._config.allow_unknown:
            barred |= occupancy < FREE
        if self._radius > 0.0:
            squared = np.rint(np.square(self.distances(np.column_stack((columns, rows)))))
            barred |= squared <= self._radius**2 + _ROUNDING
        return barred

    def distances(self, cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return how far cells (x, y) [n, 2] are from the nearest lethal one: float64 [n].

        In cells, from centre to centre; inf on a map without lethal cells.
        """
        if self._tree is None or len(cells) == 0:
            return np.full(len(cells), np.inf)
        distances, _ = self._tree.query(cells)
        distances[self._cells[cells[:, 1], cells[:, 0]] >= self._config.occupied_threshold] = 0.0
        return np.asarray(distances, dtype=np.float64)

    @cached_property
    def _tree(self) -> cKDTree | None:
        """The lethal cells that have a neighbour which is not: the nearest one is among them."""
        border = self._cells >= self._config.occupied_threshold
        inner = border.copy()
        inner[1:] &= border[:-1]
        inner[:-1] &= border[1:]
        inner[:, 1:] &= border[:, :-1]
        inner[:, :-1] &= border[:, 1:]
        rows, columns = np.nonzero(border & ~inner)
        if len(rows) == 0:
            return None
        points = np.column_stack((columns, rows))
        return cKDTree(points, balanced_tree=False, compact_nodes=False)
