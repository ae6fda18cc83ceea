"""From next-hop logits to routes: greedy, or several drawn and the best of them judged."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.visibility import LineOfSightChecker
from llm_astar_planner.waypoints.learned.features import GOAL, START, Floats

Route = tuple[int, ...]
# A route that has not come to the goal by then goes straight there.
MOST_HOPS = 24
# How often a draw may give a route that is there already.
DRAWS_A_CANDIDATE = 4


def usable_nodes(cells: NDArray[np.int32], blocked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which nodes [N] a route may visit: free cells [N, 2] on the map, no cell twice.

    `blocked` is bool [height, width]. The goal is always one, whatever lies there.
    """
    height, width = blocked.shape
    x, y = cells.T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    on_map = np.where(inside[:, None], cells, 0)
    first = np.zeros(len(cells), dtype=np.bool_)
    # A node lies at most one cell off the map, so no two cells share a number.
    first[np.unique(y * (width + 2) + x, return_index=True)[1]] = True
    usable: NDArray[np.bool_] = inside & ~blocked[on_map[:, 1], on_map[:, 0]] & first
    usable[GOAL] = True
    return usable


def draw_routes(
    logits: Floats, usable: NDArray[np.bool_], count: int, random: np.random.Generator
) -> list[Route]:
    """Return up to `count` different routes of nodes, from start to goal: the greedy one first.

    The others follow hops drawn by their probabilities; `logits` is [N, N].
    """
    routes = [follow(logits, usable)]
    for _ in range(DRAWS_A_CANDIDATE * (count - 1)):
        if len(routes) == count:
            break
        route = follow(logits, usable, random)
        if route not in routes:
            routes.append(route)
    return routes


def best_route(
    routes: Iterable[Route], cells: NDArray[np.int32], walls: LineOfSightChecker
) -> Route | None:
    """Return the shortest route whose every leg is a line of sight, None where there is none."""

    def length(route: Route) -> float:
        return float(np.hypot(*np.diff(cells[list(route)], axis=0).T).sum())

    shortest_first = sorted(routes, key=length)
    return next((r for r in shortest_first if walls.clear_along(cells[list(r)])), None)


def follow(
    logits: Floats, usable: NDArray[np.bool_], random: np.random.Generator | None = None
) -> Route:
    """Return a route by the likeliest hops, or by drawn ones; no node is visited twice.

    `logits` is [N, N], `usable` [N].
    """
    left = usable.copy()
    route = [START]
    while route[-1] != GOAL:
        left[route[-1]] = False
        row = np.where(left, logits[route[-1]], -np.inf)
        if len(route) > MOST_HOPS:
            route.append(GOAL)
        elif random is None:
            route.append(int(row.argmax()))
        else:
            # The largest after Gumbel noise is a draw from the softmax.
            route.append(int((row + random.gumbel(size=len(row))).argmax()))
    return tuple(route)
