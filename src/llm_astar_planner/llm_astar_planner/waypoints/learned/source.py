# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The embedded waypoint model: waypoints from a learned network, offline; it is not an LLM.

The network gets what a prompt tells an LLM: the map's size, its barriers, start and goal, but no
lines of sight. docs/embedded-model.md describes its training data and its limits.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_decomposition import decompose_barriers

from llm_astar_planner.caches import cached
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.any_angle import LineOfSightChecker
from llm_astar_planner.search.arrays import Bools, Float32s, Int32s
from llm_astar_planner.waypoints.config import SourceContext
from llm_astar_planner.waypoints.learned import network
from llm_astar_planner.waypoints.learned.network import GOAL, START
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

# A route is a list of node numbers, START first and GOAL last.
Route = tuple[int, ...]
# The most barriers in the training data; a map with more is approximated by this many.
MAX_BARRIERS = 30
MAPS_KEPT = 4
# A route with this many hops goes straight to the goal from there.
MAX_HOPS = 24
# How many routes are drawn for each candidate; draws may repeat a route.
DRAWS_PER_CANDIDATE = 4


def make_embedded(context: SourceContext) -> EmbeddedSource:
    """Make the source with the `candidates` of the settings.

    Reads the weights, so that a broken file is reported now and not at the first query.
    """
    network.packaged_weights()
    return EmbeddedSource(context.settings.candidates)


@dataclass(frozen=True)
class EmbeddedSource:
    """Answers with the network's route: the cells next to barrier ends where it turns.

    With one candidate the answer is the greedy route, whose lines of sight are not checked. With
    more, the others are drawn by their probabilities, and the answer is the shortest route whose
    segments are all lines of sight, or none: a blocked route misleads more than no waypoints.
    Equal queries get equal answers. Thread-safe; needs no network connection.
    """

    candidates: int = 1
    name: str = 'embedded'

    @property
    def label(self) -> str:
        """Name of the model for reports, with the digest of its weights."""
        return f'embedded:learned waypoint model {network.packaged_weights().digest}, not an LLM'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return free cells to turn at; none where the path is straight or no route is found."""
        cells, routes = self._routes(query)
        route: Route | None = routes[0]
        if self.candidates > 1:
            route = shortest_in_sight(routes, cells, query.costmap.line_of_sight)
        turns = () if route is None else route[1:-1]
        points = tuple((float(x), float(y)) for x, y in cells[list(turns)])
        status = SourceStatus.OK if points else SourceStatus.NO_WAYPOINTS
        detail = '' if route else f'none of {len(routes)} routes drawn is in sight'
        model = network.packaged_weights().digest
        return WaypointReply(points, self.label, status, detail, model=model)

    def _routes(self, query: WaypointQuery) -> tuple[Int32s, list[Route]]:
        """Return the cells [N, 2] of the nodes, and routes over them, the greedy one first."""
        height, width = query.costmap.blocked.shape
        barriers = barriers_of(query.costmap)[None]
        size = np.array([[width, height]], np.int32)
        endpoints = np.array([[query.start, query.goal]], np.int32)
        cells = network.place_nodes(barriers, endpoints)[0]
        features = network.featurise(barriers, size, endpoints)
        logits = network.hop_logits(network.packaged_weights(), features)[0]
        usable = usable_nodes(cells, query.costmap.blocked)
        return cells, draw_routes(logits, usable, self.candidates, query.random_generator())


@cached(MAPS_KEPT, key=lambda costmap: costmap.key)
def barriers_of(costmap: Costmap) -> Int32s:
    """Return a costmap's barriers [B, 4] as (horizontal, line, first, last), computed once."""
    found = decompose_barriers(costmap.blocked, MAX_BARRIERS)
    rows = [(1, *barrier) for barrier in found.horizontal_barriers]
    rows += [(0, *barrier) for barrier in found.vertical_barriers]
    return np.array(rows, np.int32).reshape(-1, 4)


def usable_nodes(cells: Int32s, blocked: Bools) -> Bools:
    """Return which nodes [N] a route may visit: free cells [N, 2] on the map, no cell twice.

    `blocked` is bool [height, width]. The goal is always usable.
    """
    height, width = blocked.shape
    x, y = cells.T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    on_map = np.where(inside[:, None], cells, 0)
    first = np.zeros(len(cells), dtype=np.bool_)
    # A node is at most one cell off the map, so different cells get different numbers.
    first[np.unique(y * (width + 2) + x, return_index=True)[1]] = True
    usable: Bools = inside & ~blocked[on_map[:, 1], on_map[:, 0]] & first
    usable[GOAL] = True
    return usable


def draw_routes(
    logits: Float32s, usable: Bools, count: int, random: np.random.Generator
) -> list[Route]:
    """Return up to `count` different routes from start to goal, the greedy one first.

    The others follow hops drawn by their probabilities. `logits` is [N, N], `usable` [N].
    """
    routes = [follow(logits, usable)]
    for _ in range(DRAWS_PER_CANDIDATE * (count - 1)):
        if len(routes) == count:
            break
        route = follow(logits, usable, random)
        if route not in routes:
            routes.append(route)
    return routes


def follow(logits: Float32s, usable: Bools, random: np.random.Generator | None = None) -> Route:
    """Return a route of the most probable hops, or of hops drawn with `random`.

    No node is visited twice. `logits` is [N, N], `usable` [N].
    """
    left = usable.copy()
    route = [START]
    while route[-1] != GOAL:
        left[route[-1]] = False
        row = np.where(left, logits[route[-1]], -np.inf)
        if len(route) > MAX_HOPS:
            route.append(GOAL)
        elif random is None:
            route.append(int(row.argmax()))
        else:
            # The argmax after adding Gumbel noise is a draw from the softmax.
            route.append(int((row + random.gumbel(size=len(row))).argmax()))
    return tuple(route)


def shortest_in_sight(
    routes: Iterable[Route], cells: Int32s, sight: LineOfSightChecker
) -> Route | None:
    """Return the shortest route whose segments are all lines of sight, None if there is none."""

    def length(route: Route) -> float:
        return float(np.hypot(*np.diff(cells[list(route)], axis=0).T).sum())

    shortest_first = sorted(routes, key=length)
    return next((r for r in shortest_first if sight.clear_along(cells[list(r)])), None)
