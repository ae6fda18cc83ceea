"""The embedded waypoint model: offline waypoints from a learned network, which is not an LLM.

It is told what a prompt tells an LLM: the map's size, its barriers, start and goal; no line of
sight. See docs/embedded-model.md for what it was trained on and where it stops being good.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_decomposition import decompose_barriers
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.search.visibility import walls_of
from llm_astar_planner.waypoints.learned.decoding import (
    Route,
    best_route,
    draw_routes,
    usable_nodes,
)
from llm_astar_planner.waypoints.learned.features import featurise, place_nodes
from llm_astar_planner.waypoints.learned.network import hop_logits, packaged_weights
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

# The most barriers it was trained on; a map of more is summarised by so many.
MAX_BARRIERS = 30
# A map of 4000 x 4000 cells takes 16 MB, and as much again for which of them are blocked.
MAPS_KEPT = 4


@dataclass(frozen=True)
class EmbeddedSource:
    """Answers with the network's route: the cells beyond barrier ends that it turns at.

    With one of `candidates` it answers with the greedy route, for which no line of sight is looked
    at. With several, the others are drawn by their probabilities, and the answer is the shortest
    whose legs are lines of sight, or none: a route known to be barred misleads more than silence.
    The same question has the same answer. Thread-safe; needs no network.
    """

    candidates: int = 1
    name: str = 'embedded'

    @property
    def label(self) -> str:
        """What answers, in words for reports, with the digest of its weights."""
        return f'embedded:learned waypoint model {packaged_weights().digest}, not an LLM'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return free cells to turn at, none where the way is straight or no route is in sight."""
        cells, routes = self._routes(query)
        route: Route | None = routes[0]
        if self.candidates > 1:
            route = best_route(routes, cells, walls_of(query.grid_map))
        turns = () if route is None else route[1:-1]
        points = tuple((float(x), float(y)) for x, y in cells[list(turns)])
        return WaypointReply(
            points,
            label=self.label,
            status=SourceStatus.OK if points else SourceStatus.NO_WAYPOINTS,
            detail='' if route else f'none of {len(routes)} routes drawn is in sight',
            model=packaged_weights().digest,
        )

    def _routes(self, query: WaypointQuery) -> tuple[NDArray[np.int32], list[Route]]:
        """Return the cells [N, 2] of the nodes and the routes over them, the greedy one first."""
        grid_map = query.grid_map
        barriers = _barriers_of(grid_map)[None]
        size = np.array([[grid_map.width, grid_map.height]], np.int32)
        ends = np.array([[query.start, query.goal]], np.int32)
        cells = place_nodes(barriers, ends)[0]
        logits = hop_logits(packaged_weights(), featurise(barriers, size, ends))[0]
        usable = usable_nodes(cells, _blocked_of(grid_map))
        return cells, draw_routes(logits, usable, self.candidates, _generator(query))


@lru_cache(maxsize=MAPS_KEPT)
def _barriers_of(grid_map: GridMap) -> NDArray[np.int32]:
    """Return a map's barriers [B, 4] as (horizontal, line, first, last), found once a map."""
    summary = decompose_barriers(grid_map.blocked(), MAX_BARRIERS)
    rows = [(1, *barrier) for barrier in summary.horizontal_barriers]
    rows += [(0, *barrier) for barrier in summary.vertical_barriers]
    return np.array(rows, np.int32).reshape(-1, 4)


@lru_cache(maxsize=MAPS_KEPT)
def _blocked_of(grid_map: GridMap) -> NDArray[np.bool_]:
    return grid_map.blocked()


def _generator(query: WaypointQuery) -> np.random.Generator:
    """Seed by what is asked, so that no answer depends on what was asked before."""
    key = f'{query.grid_map.digest} {query.start} {query.goal}'
    return np.random.default_rng(list(hashlib.sha256(key.encode()).digest()))
