"""Waypoints made without a language model, to tell what a model's are worth.

`straight` is blind to the map, `oracle` knows the best way, `noisy` and `reversed` spoil the
oracle's, and `random` knows nothing. All answer the same question alike every time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from llm_astar_planner.search.visibility import LineOfSightChecker, walls_of
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

Cell = tuple[int, int]
Corners = tuple[Waypoint, ...]
# The published noisy oracle is off by up to three cells on the unscaled maps.
NOISE_CELLS = 3
RANDOM_POINTS = 4
# Time and memory grow with the square: 1600 corners take 8 s and 0.8 GB, 7800 over an hour.
MAX_CORNERS = 2000


class TooManyCornersError(RuntimeError):
    """A map with too many wall ends for a visibility graph."""


@dataclass(frozen=True)
class StraightSource:
    """Three points a quarter of the way apart on the straight line, whatever lies there."""

    name: str = 'straight'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Divide the line from start to goal; each point is rounded to its cell."""
        start, goal = np.array(query.start), np.array(query.goal)
        points = [start + (goal - start) * part for part in (0.25, 0.5, 0.75)]
        return _reply(self.name, [(float(round(x)), float(round(y))) for x, y in points])


@dataclass(frozen=True)
class OracleSource:
    """The corners of the shortest any-angle path, by a visibility graph."""

    name: str = 'oracle'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the corners in order, none where start sees goal or no way exists."""
        return _corners_reply(self.name, query, lambda corners: corners)


@dataclass(frozen=True)
class ReversedSource:
    """The oracle's corners in the wrong order."""

    name: str = 'reversed'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the oracle's corners, last first."""
        return _corners_reply(self.name, query, lambda corners: corners[::-1])


@dataclass(frozen=True)
class NoisySource:
    """The oracle's corners, each displaced by up to three cells (times the scale) a direction."""

    seed: int = 0
    name: str = 'noisy'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Displace every corner; nothing keeps the result off obstacles or on the map."""
        reach = NOISE_CELLS * (query.sample.scale if query.sample else 1)
        random = _generator(self.name, self.seed, query)

        def displace(corners: Corners) -> Corners:
            shifts = random.integers(-reach, reach, size=(len(corners), 2), endpoint=True)
            return tuple((x + dx, y + dy) for (x, y), (dx, dy) in zip(corners, shifts))

        return _corners_reply(self.name, query, displace)


@dataclass(frozen=True)
class RandomSource:
    """Free cells drawn at random."""

    seed: int = 0
    points: int = RANDOM_POINTS
    name: str = 'random'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Draw from all free cells alike, with replacement."""
        ys, xs = np.nonzero(~query.grid_map.blocked())
        drawn = _generator(self.name, self.seed, query).integers(len(xs), size=self.points)
        return _reply(self.name, [(float(xs[i]), float(ys[i])) for i in drawn])


def ablation_sources(seed: int = 0) -> dict[str, WaypointSource]:
    """Return every ablation source by name; `seed` is what the noisy and random ones draw from."""
    sources: list[WaypointSource] = [
        StraightSource(),
        OracleSource(),
        NoisySource(seed),
        RandomSource(seed),
        ReversedSource(),
    ]
    return {source.name: source for source in sources}


def shortest_corners(grid_map: GridMap, start: Cell, goal: Cell) -> tuple[Waypoint, ...]:
    """Return where the shortest any-angle path bends, as free cells beside wall ends.

    Empty where start sees goal and where no path exists.
    """
    return _route(grid_map, start, goal)[0]


def any_angle_length(grid_map: GridMap, start: Cell, goal: Cell) -> float:
    """Return the length in cells of the shortest any-angle path, infinity where there is none."""
    return _route(grid_map, start, goal)[1]


def _corners_reply(
    label: str, query: WaypointQuery, change: Callable[[Corners], Corners]
) -> WaypointReply:
    """Answer with the oracle's corners, changed; with an error where the map has too many."""
    try:
        corners = shortest_corners(query.grid_map, query.start, query.goal)
    except TooManyCornersError as error:
        return WaypointReply(label=label, status=SourceStatus.ERROR, detail=str(error))
    return _reply(label, change(corners))


def _reply(label: str, points: list[Waypoint] | Corners) -> WaypointReply:
    status = SourceStatus.OK if points else SourceStatus.NO_WAYPOINTS
    waypoints = tuple((float(x), float(y)) for x, y in points)
    return WaypointReply(waypoints, label=label, status=status)


def _generator(name: str, seed: int, query: WaypointQuery) -> np.random.Generator:
    """Seed by what is asked, so that no answer depends on what was asked before."""
    key = f'{name} {seed} {query.grid_map.digest} {query.start} {query.goal}'
    return np.random.default_rng(list(hashlib.sha256(key.encode()).digest()))


@dataclass(frozen=True, eq=False)
class _VisibilityGraph:
    """Corner cells [n, 2] and the distances [n, n] between those that see each other, else 0."""

    walls: LineOfSightChecker
    corners: NDArray[np.int64]
    distances: NDArray[np.float64]


def visibility_problem(grid_map: GridMap) -> str:
    """Say why a map is too large for the sources that need its visibility graph, or ''."""
    corners = len(_corner_cells(grid_map.blocked(), walls_of(grid_map)))
    if corners <= MAX_CORNERS:
        return ''
    return f'the map has {corners} corners, over {MAX_CORNERS}, for a visibility graph'


@lru_cache(maxsize=32)
def _visibility_graph(grid_map: GridMap) -> _VisibilityGraph:
    walls = walls_of(grid_map)
    corners = _corner_cells(grid_map.blocked(), walls)
    if len(corners) > MAX_CORNERS:
        raise TooManyCornersError(visibility_problem(grid_map))
    distances = np.zeros((len(corners), len(corners)))
    i, j = np.triu_indices(len(corners), 1)
    seen = walls.clear(corners[i], corners[j])
    i, j = i[seen], j[seen]
    distances[i, j] = distances[j, i] = np.hypot(*(corners[i] - corners[j]).T)
    return _VisibilityGraph(walls, corners, distances)


def _corner_cells(blocked: NDArray[np.bool_], walls: LineOfSightChecker) -> NDArray[np.int64]:
    """Return the free cells around the ends of walls, where shortest paths may bend.

    A path that keeps to cells often turns wider than one round the wall's very end.
    """
    ends = walls.ends[:, None, :]
    around = np.array([(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
    candidates = np.unique((ends + around).reshape(-1, 2), axis=0)
    height, width = blocked.shape
    inside = ((candidates >= 0) & (candidates < (width, height))).all(axis=1)
    candidates = candidates[inside]
    free = ~blocked[candidates[:, 1], candidates[:, 0]]
    return np.asarray(candidates[free], dtype=np.int64)


@lru_cache(maxsize=4096)
def _route(grid_map: GridMap, start: Cell, goal: Cell) -> tuple[tuple[Waypoint, ...], float]:
    """Return the corners of the shortest any-angle path and its length."""
    graph = _visibility_graph(grid_map)
    ends = np.array([start, goal])
    if graph.walls.clear(ends[:1], ends[1:])[0]:
        return (), float(np.hypot(*(ends[1] - ends[0])))
    count = len(graph.corners)
    # A zero is no edge, so an end that is itself a corner needs one of hardly any length.
    weights = np.zeros((count + 2, count + 2))
    weights[:count, :count] = graph.distances
    for index, end in enumerate(ends, start=count):
        seen = graph.walls.clear(np.broadcast_to(end, (count, 2)), graph.corners)
        away = np.maximum(np.hypot(*(graph.corners - end).T), 1e-9)
        weights[index, :count] = weights[:count, index] = np.where(seen, away, 0.0)
    lengths, before = dijkstra(csr_matrix(weights), indices=count, return_predecessors=True)
    return _trace(graph.corners, before, ends), float(lengths[count + 1])


def _trace(
    corners: NDArray[np.int64], before: NDArray[np.int32], ends: NDArray[np.int64]
) -> tuple[Waypoint, ...]:
    """Follow the predecessors back from the goal; corners on start or goal are left out."""
    points: list[Waypoint] = []
    node = before[len(corners) + 1]
    while 0 <= node < len(corners):
        corner = corners[node]
        if not (corner == ends).all(axis=1).any():
            points.append((float(corner[0]), float(corner[1])))
        node = before[node]
    return tuple(points[::-1])
