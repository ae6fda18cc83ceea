# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Baseline sources: waypoints computed without a language model, to compare a model's with.

`coarse` is the turns of a cheapest route on tiles of 4 to 16 cells a side, in which parts that do
not connect are kept apart, so it passes wherever the cells connect, through doors of one cell too;
it is pulled taut on the cells themselves. `straight` ignores the map, `oracle` returns the corners
of the shortest any-angle path, `noisy` and `reversed` degrade the oracle's answer, and `random`
draws free cells. Every source gives the same answer to the same query.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError

from llm_astar_planner.caches import cached
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.arrays import Float64s, Int64s
from llm_astar_planner.search.coarse import EVERY_NODE, compile_routes
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.config import SourceContext, SourceSettings, make_source
from llm_astar_planner.waypoints.source import SourceStatus, Waypoint, WaypointQuery, WaypointReply

Corners = tuple[Waypoint, ...]
# The published noisy oracle displaces a point by up to three cells on the unscaled maps.
NOISE_CELLS = 3
RANDOM_POINTS = 4
# Time and memory grow with the square: 1600 corners take 8 s and 0.8 GB, 7800 over an hour.
MAX_CORNERS = 2000
GRAPHS_KEPT = 32
ROUTES_KEPT = 4096
# How many nodes of the coarse map are surely expanded in a second.
NODES_A_SECOND = 500_000


class TooManyCornersError(LlmAstarError, RuntimeError):
    """The map has too many wall ends for a visibility graph."""


@dataclass(frozen=True)
class BaselineSource:
    """A source that computes its points from the query alone, one of POINTS.

    `seed` is that of what is drawn at random. Equal queries get equal answers. Thread-safe.
    """

    name: str
    seed: int = 0

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the points, or why there are none."""
        try:
            points = POINTS[self.name](query, self.seed)
        except TooManyCornersError as error:
            return WaypointReply(label=self.name, status=SourceStatus.ERROR, detail=str(error))
        except TimeoutError as error:
            return WaypointReply(label=self.name, status=SourceStatus.TIMEOUT, detail=str(error))
        status = SourceStatus.OK if points else SourceStatus.NO_WAYPOINTS
        detail = 'no cells connect start and goal' if points is None else ''
        waypoints = tuple((float(x), float(y)) for x, y in points or ())
        return WaypointReply(waypoints, label=self.name, status=status, detail=detail)


def baseline_sources(seed: int = 0) -> dict[str, sources.WaypointSource]:
    """Return every baseline source by name; `noisy` and `random` draw from `seed`."""
    settings = [SourceSettings(source=name) for name in sources.BASELINE_NAMES]
    return {item.source: make_source(item, seed=seed) for item in settings}


def make_baseline(context: SourceContext) -> BaselineSource:
    """Make the source that the settings name; compiles what it needs, so that no query has to."""
    if context.settings.source == 'coarse':
        compile_routes()
    return BaselineSource(context.settings.source, context.seed)


def coarse_points(query: WaypointQuery) -> Sequence[Cell] | None:
    """Return the cells at which a cheapest route over the costmap's tiles turns.

    They are free and connected to the start; there are none where the way is straight, and None
    where it is missing. The first query on a map prepares its graph: about as long as an exact
    search takes. Raises TimeoutError.
    """
    deadline = time.monotonic() + query.time_limit
    graph = query.costmap.coarse_graph
    left = deadline - time.monotonic()
    most = EVERY_NODE if left == math.inf else max(0, int(left * NODES_A_SECOND))
    turns = graph.turns(query.start, query.goal, most)
    return None if turns is None else [(x, y) for x, y in turns.tolist()]


def straight_points(query: WaypointQuery) -> list[Waypoint]:
    """Return the cells at a quarter, a half and three quarters of the line from start to goal."""
    start, goal = np.array(query.start), np.array(query.goal)
    points = [start + (goal - start) * part for part in (0.25, 0.5, 0.75)]
    return [(round(x), round(y)) for x, y in points]


def oracle_points(query: WaypointQuery) -> Corners:
    """Return the corners of the shortest any-angle path, found in a visibility graph.

    Empty where start sees the goal or no path exists. Raises TooManyCornersError.
    """
    return shortest_route(query.costmap, query.start, query.goal)[0]


def noisy_points(query: WaypointQuery, seed: int) -> list[Waypoint]:
    """Return the oracle's corners, each displaced by up to three cells in x and y.

    On a scaled map the displacement is scaled too. The points may lie on obstacles or off the map.
    """
    corners = oracle_points(query)
    reach = NOISE_CELLS * (query.sample.scale if query.sample else 1)
    random = query.random_generator(f'noisy {seed}')
    shifts = random.integers(-reach, reach, size=(len(corners), 2), endpoint=True)
    return [(x + dx, y + dy) for (x, y), (dx, dy) in zip(corners, shifts)]


def random_points(query: WaypointQuery, seed: int) -> list[Waypoint]:
    """Return RANDOM_POINTS free cells, drawn with equal probability and with replacement."""
    ys, xs = np.nonzero(~query.costmap.blocked)
    drawn = query.random_generator(f'random {seed}').integers(len(xs), size=RANDOM_POINTS)
    return list(zip(xs[drawn], ys[drawn]))


# The points of each source by its name, of a query and a seed.
POINTS: dict[str, Callable[[WaypointQuery, int], Sequence[Waypoint] | None]] = {
    'coarse': lambda query, _: coarse_points(query),
    'straight': lambda query, _: straight_points(query),
    'oracle': lambda query, _: oracle_points(query),
    'noisy': noisy_points,
    'random': random_points,
    'reversed': lambda query, _: oracle_points(query)[::-1],
}


def corner_cells(costmap: Costmap) -> Int64s:
    """Return the free cells [n, 2] around wall ends, where shortest paths may bend.

    A path over cell centres often turns wider than at the cell next to the wall's end.
    """
    ends = costmap.line_of_sight.ends[:, None, :]
    around = np.array([(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
    candidates = np.unique((ends + around).reshape(-1, 2), axis=0)
    height, width = costmap.blocked.shape
    inside = ((candidates >= 0) & (candidates < (width, height))).all(axis=1)
    candidates = candidates[inside]
    free = ~costmap.blocked[candidates[:, 1], candidates[:, 0]]
    return np.asarray(candidates[free], dtype=np.int64)


def visibility_problem(costmap: Costmap) -> str | None:
    """Return why a map is too large for a visibility graph, None where it is not."""
    corners = len(corner_cells(costmap))
    if corners <= MAX_CORNERS:
        return None
    return f'the map has {corners} corners, over {MAX_CORNERS}, for a visibility graph'


@cached(GRAPHS_KEPT, key=lambda costmap: costmap.key)
def visibility_graph(costmap: Costmap) -> tuple[Int64s, Float64s]:
    """Return the corners [n, 2] of a map and the distances [n, n] of those in sight, else 0.

    Raises TooManyCornersError.
    """
    problem = visibility_problem(costmap)
    if problem:
        raise TooManyCornersError(problem)
    corners = corner_cells(costmap)
    distances = np.zeros((len(corners), len(corners)))
    i, j = np.triu_indices(len(corners), 1)
    seen = costmap.line_of_sight.clear(corners[i], corners[j])
    i, j = i[seen], j[seen]
    distances[i, j] = distances[j, i] = np.hypot(*(corners[i] - corners[j]).T)
    return corners, distances


@cached(ROUTES_KEPT, key=lambda costmap, start, goal: (costmap.key, start, goal))
def shortest_route(costmap: Costmap, start: Cell, goal: Cell) -> tuple[Corners, float]:
    """Return the corners of the shortest any-angle path, and its length in cells.

    The corners are free cells near wall ends, in order; there are none where start sees the goal,
    and where no path exists: the length is then infinite. Raises TooManyCornersError.
    """
    from scipy.sparse import csr_matrix  # noqa: PLC0415 - takes a tenth of a second
    from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415

    (corners, distances), sight = visibility_graph(costmap), costmap.line_of_sight
    endpoints, count = np.array([start, goal]), len(corners)
    if sight.clear(endpoints[:1], endpoints[1:])[0]:
        return (), float(np.hypot(*(endpoints[1] - endpoints[0])))
    weights = np.zeros((count + 2, count + 2))
    weights[:count, :count] = distances
    for index, endpoint in enumerate(endpoints, start=count):
        seen = sight.clear(np.broadcast_to(endpoint, (count, 2)), corners)
        # Zero means "no edge", so an endpoint that is itself a corner gets a tiny distance.
        away = np.maximum(np.hypot(*(corners - endpoint).T), 1e-9)
        weights[index, :count] = weights[:count, index] = np.where(seen, away, 0.0)
    lengths, before = dijkstra(csr_matrix(weights), indices=count, return_predecessors=True)
    points: list[Waypoint] = []
    node = before[count + 1]
    while 0 <= node < count:
        x, y = corners[node].tolist()
        if (x, y) not in (start, goal):
            points.insert(0, (float(x), float(y)))
        node = before[node]
    return tuple(points), float(lengths[count + 1])
