"""Finds the sample of a dataset that a query is about, by the cells of its map."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap

from llm_astar_planner.waypoints.prompts.map_description import Lattice
from llm_astar_planner.waypoints.source import SampleKey, WaypointQuery

# The paper scales its maps by up to 10; searching more scales would only cost time.
MAX_SCALE = 10


class SampleResolver:
    """Finds the dataset's map and pair of a query by the map's cells, at any resolution."""

    def __init__(self, dataset: Sequence[BarrierMap] | None = None) -> None:
        """Take the maps to search; there may be none."""
        self._maps = tuple(dataset or ())
        self._indices: dict[int, dict[str, BarrierMap]] = {}

    def resolve(self, query: WaypointQuery) -> tuple[SampleKey, Lattice]:
        """Return the key of a query and the lattice its coordinates are recorded in.

        The key is the query's own sample, else the dataset's, else the live key, which goes with
        the lattice of the cells.
        """
        found = self._find(query.grid_map)
        if query.sample is not None:
            return query.sample, found[1] if found else lattice_of(query.grid_map)
        if found is not None:
            barrier_map, lattice, scale = found
            for index, sample in enumerate(barrier_map.samples):
                cells = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
                if cells == (tuple(query.start), tuple(query.goal)):
                    return SampleKey(barrier_map.id, index, scale), lattice
        return query.live_key, Lattice()

    def _find(self, grid_map: GridMap) -> tuple[BarrierMap, Lattice, int] | None:
        """Return the scaled barrier map with exactly these cells, its lattice and its scale."""
        if not self._maps:
            return None
        digest = cells_digest(grid_map)
        sizes = {item.size for item in self._maps}
        for scale in range(1, MAX_SCALE + 1):
            if (grid_map.width, grid_map.height) not in {(w * scale, h * scale) for w, h in sizes}:
                continue
            if scale not in self._indices:
                scaled = [barrier_map.scale(scale) for barrier_map in self._maps]
                self._indices[scale] = {cells_digest(item.to_grid()): item for item in scaled}
            found = self._indices[scale].get(digest)
            if found is not None:
                return found, Lattice(*found.offset), scale
        return None


def dataset_digest(maps: Sequence[BarrierMap]) -> str:
    """Return the SHA-256 of maps with their samples, however their file is laid out.

    The queries of the samples, which are sentences, and the families of the maps, which depend on
    how a dataset is named, do not count. '' where there are no maps.
    """
    entries = [item.to_json() for item in maps]
    for entry in entries:
        entry.pop('family', None)
        entry['start_goal'] = [ends[:2] for ends in entry['start_goal']]
    text = json.dumps(entries, separators=(',', ':'))
    return hashlib.sha256(text.encode()).hexdigest() if entries else ''


def lattice_of(grid_map: GridMap) -> Lattice:
    """Return the lattice of a grid that was made from a barrier map; (0, 0) for other grids.

    A barrier map puts lattice point (x, y) at (x, y) * resolution.
    """
    offsets = [value / grid_map.resolution + 0.5 for value in grid_map.origin[:2]]
    if grid_map.origin.yaw != 0.0 or any(abs(v - round(v)) > 1e-6 for v in offsets):
        return Lattice()
    return Lattice(round(offsets[0]), round(offsets[1]))


def cells_digest(grid_map: GridMap) -> str:
    """Return a digest of the occupied cells alone: the same at any resolution and origin."""
    occupied = grid_map.blocked()
    return hashlib.sha256(str(occupied.shape).encode() + occupied.tobytes()).hexdigest()
