"""Which sample a query is: of a dataset where it can be found there, else of a live run."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap

from llm_astar_planner.waypoints.prompts.lattice import Lattice
from llm_astar_planner.waypoints.source import SampleKey, WaypointQuery

# The paper scales its maps up to 10 times; rasterising more would only cost.
MAX_SCALE = 10


def live_key(query: WaypointQuery) -> SampleKey:
    """Return the key of a query without a dataset: grid digest and `x0,y0->x1,y1` in cells."""
    (x0, y0), (x1, y1) = query.start, query.goal
    return SampleKey(query.grid_map.digest, f'{x0},{y0}->{x1},{y1}', 1)


def lattice_of(grid_map: GridMap) -> Lattice:
    """Return the lattice coordinates of cell (0, 0) of a rasterised barrier map.

    A barrier map puts lattice point (x, y) at (x, y) * resolution; any other grid is (0, 0).
    """
    offsets = [value / grid_map.resolution + 0.5 for value in grid_map.origin[:2]]
    if grid_map.origin.yaw != 0.0 or any(abs(v - round(v)) > 1e-6 for v in offsets):
        return Lattice()
    return Lattice(round(offsets[0]), round(offsets[1]))


class SampleResolver:
    """Find the dataset's map and pair of a query by its cells, whatever its resolution."""

    def __init__(self, dataset: Sequence[BarrierMap] | None = None) -> None:
        """Take the maps to look in; none at all is fine."""
        self._maps = tuple(dataset or ())
        self._indices: dict[int, dict[str, BarrierMap]] = {}

    def resolve(self, query: WaypointQuery) -> tuple[SampleKey, Lattice]:
        """Return the key of a query and the lattice its coordinates are recorded in.

        The key is the query's own sample, else the dataset's, else the live key, whose lattice
        is that of the cells.
        """
        found = self._find(query.grid_map)
        if query.sample is not None:
            lattice = _corner(found[0]) if found else lattice_of(query.grid_map)
            return query.sample, lattice
        if found is not None:
            barrier_map, scale = found
            for index, sample in enumerate(barrier_map.samples):
                cells = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
                if cells == (tuple(query.start), tuple(query.goal)):
                    return SampleKey(barrier_map.id, index, scale), _corner(barrier_map)
        return live_key(query), Lattice()

    def _find(self, grid_map: GridMap) -> tuple[BarrierMap, int] | None:
        """Return the scaled barrier map with exactly these cells, and its scale."""
        digest = _cells_digest(grid_map)
        for scale in self._scales(grid_map):
            index = self._indices.get(scale)
            if index is None:
                scaled = [barrier_map.scale(scale) for barrier_map in self._maps]
                index = {_cells_digest(item.to_grid()): item for item in scaled}
                self._indices[scale] = index
            if digest in index:
                return index[digest], scale
        return None

    def _scales(self, grid_map: GridMap) -> list[int]:
        """Return the scales at which some map of the dataset has this grid's size."""
        sizes = {
            (item.range_x[1] - item.range_x[0], item.range_y[1] - item.range_y[0])
            for item in self._maps
        }
        return [
            scale
            for scale in range(1, MAX_SCALE + 1)
            if any((grid_map.width, grid_map.height) == (w * scale, h * scale) for w, h in sizes)
        ]


def _corner(barrier_map: BarrierMap) -> Lattice:
    return Lattice(barrier_map.range_x[0], barrier_map.range_y[0])


def _cells_digest(grid_map: GridMap) -> str:
    blocked = grid_map.blocked()
    return hashlib.sha256(str(blocked.shape).encode() + blocked.tobytes()).hexdigest()
