"""The lattice a model is asked on: the map's own points, or a coarser one for a big map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap

# Cells from here up are obstacles, as everywhere in the planner.
_OCCUPIED = 65

Cell = tuple[int, int]
Waypoint = tuple[float, float]


class Lattice(NamedTuple):
    """Lattice point (x, y) is cell (0, 0); one step is `unit` cells."""

    x: int = 0
    y: int = 0
    unit: int = 1

    def coarsened(self, unit: int) -> Lattice:
        """Return the lattice of `unit` cells a step; a coarse one is counted from cell (0, 0)."""
        return self if unit == self.unit else Lattice(0, 0, unit)

    def to_lattice(self, cell: Cell) -> Cell:
        """Return the lattice point whose block of cells holds `cell`."""
        return cell[0] // self.unit + self.x, cell[1] // self.unit + self.y

    def to_cells(
        self, points: Sequence[Waypoint], grid_map: GridMap, ends: Sequence[Cell] = ()
    ) -> tuple[Waypoint, ...]:
        """Map points of a model back to grid coordinates.

        With a unit of one cell this is a shift. A coarser point means its block: one of `ends`
        (start and goal) that lies there, else the block's free cell nearest to its centre.
        """
        if self.unit == 1:
            return tuple((px - self.x, py - self.y) for px, py in points)
        return tuple(self._cell_of_block(point, grid_map, ends) for point in points)

    def _cell_of_block(self, point: Waypoint, grid_map: GridMap, ends: Sequence[Cell]) -> Waypoint:
        block = math.floor(point[0] + 0.5), math.floor(point[1] + 0.5)
        for end in ends:
            if self.to_lattice(end) == block:
                return float(end[0]), float(end[1])
        x0, y0 = ((value - low) * self.unit for value, low in zip(block, (self.x, self.y)))
        centre = x0 + (self.unit - 1) // 2, y0 + (self.unit - 1) // 2
        if not grid_map.contains(centre):
            return float(centre[0]), float(centre[1])
        cells = grid_map.cells[y0 : y0 + self.unit, x0 : x0 + self.unit]
        rows, columns = np.nonzero((cells >= 0) & (cells < _OCCUPIED))
        if rows.size == 0:
            return float(centre[0]), float(centre[1])
        distance = np.hypot(columns + x0 - centre[0], rows + y0 - centre[1])
        nearest = int(np.argmin(distance))
        return float(columns[nearest] + x0), float(rows[nearest] + y0)
