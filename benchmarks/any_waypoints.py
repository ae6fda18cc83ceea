"""How much time any waypoints can cost: good, bad, random and hostile ones against none at all.

The guided search is within its bound and its time is divided by that of `exact_astar` on the
same query, as medians of interleaved turns.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.source import WaypointQuery
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.cases import Query, SpeedCase
from benchmarks.ours import BOUND, Prepared, run_guided

Points = NDArray[np.float64]
TURNS = 3
MOST_QUERIES = 40
# The embedded model is for maps of few barriers and takes long elsewhere.
EMBEDDED_CELLS = 20_000
SOURCES = ('coarse', 'embedded', 'straight')


def measure(case: SpeedCase) -> list[dict[str, object]]:
    """Return a row for each query, waypoint set, and with or without landmarks."""
    rows: list[dict[str, object]] = []
    queries = 0
    for problem in case.problems:
        prepared = Prepared(problem)
        for query in problem.queries[: max(1, MOST_QUERIES // len(case.problems))]:
            queries += 1
            sets = dict(waypoint_sets(prepared, query, np.random.default_rng(queries)))
            rows.extend(measure_query(prepared, query, sets))
    return rows


def measure_query(
    prepared: Prepared, query: Query, sets: dict[str, Points]
) -> Iterator[dict[str, object]]:
    """Time every set and the exact search in turns on one query; yield their rows."""
    runs: dict[tuple[str, bool], Callable[[], object]] = {
        ('exact', False): partial(exact_astar, prepared.grid, *query, want_expanded=False)
    }
    for name, points in sets.items():
        for landmarks in (True, False):
            runs[name, landmarks] = partial(
                run_guided, prepared, *query, points, BOUND, landmarks=landmarks
            )
    times: dict[tuple[str, bool], list[float]] = {key: [] for key in runs}
    for turn in range(TURNS + 1):
        for key, run in runs.items():
            begin = time.thread_time_ns()
            run()
            if turn:
                times[key].append((time.thread_time_ns() - begin) * 1e-6)
    exact = statistics.median(times.pop(('exact', False)))
    for (name, landmarks), own in times.items():
        ratio = statistics.median(own) / exact
        yield {'waypoints': name, 'landmarks': landmarks, 'exact_ms': exact, 'ratio': ratio}


def waypoint_sets(
    prepared: Prepared, query: Query, random: np.random.Generator
) -> Iterator[tuple[str, Points]]:
    """Yield waypoint sets by name: every source, the oracle displaced, random and hostile ones."""
    turns, blocked = prepared.turns[query], prepared.problem.blocked
    height, width = blocked.shape
    yield 'none', np.empty((0, 2))
    yield 'oracle', turns
    yield 'oracle displaced by 5', turns + random.normal(0.0, 5.0, turns.shape)
    yield 'oracle displaced by 20', turns + random.normal(0.0, 20.0, turns.shape)
    yield 'oracle reversed', turns[::-1]
    yield 'random 1', random.uniform(0.0, (width, height), (1, 2))
    yield 'random 8', random.uniform(0.0, (width, height), (8, 2))
    for name in SOURCES:
        if name != 'embedded' or blocked.size <= EMBEDDED_CELLS:
            source = make_source(SourceSettings(source=name))
            reply = source.waypoints(WaypointQuery(prepared.planner.costmap, *query))
            yield name, np.array(reply.waypoints, dtype=np.float64).reshape(-1, 2)
    yield from hostile_sets(prepared, query)


def hostile_sets(prepared: Prepared, query: Query) -> Iterator[tuple[str, Points]]:
    """Yield waypoints meant to mislead: far corners, a zigzag, unreachable ones, a dead end."""
    blocked = prepared.problem.blocked
    height, width = blocked.shape
    start, goal = np.array(query, dtype=np.float64)
    corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]])
    far = np.argsort(-np.hypot(*(corners - goal).T), kind='stable')
    yield 'far corners', corners[far].astype(np.float64)
    along = np.linspace(0.1, 0.9, 8)[:, None]
    across = (goal - start)[::-1] * (0.5, -0.5)
    side = np.where(np.arange(8) % 2, 1.0, -1.0)[:, None]
    yield 'zigzag', start + along * (goal - start) + side * across
    obstacles = np.argwhere(blocked)[:, ::-1]
    if len(obstacles):
        middle = (start + goal) / 2
        near = np.argsort(np.hypot(*(obstacles - middle).T), kind='stable')
        yield 'in obstacles', obstacles[near[:: max(1, len(near) // 64)][:8]].astype(np.float64)
    dead_end = tempting_dead_end(prepared, query)
    if dead_end is not None:
        yield 'dead end', np.repeat(dead_end[None], 8, axis=0) + np.arange(8)[:, None] % 3


def tempting_dead_end(prepared: Prepared, query: Query) -> Points | None:
    """Return the end of a blind alley, seen from a landmark, that lies nearest to the query."""
    landmarks, shape = prepared.landmarks, prepared.problem.blocked.shape
    if landmarks is None:
        return None
    distances = landmarks.distances[0].reshape(shape)
    highest = (distances == ndimage.maximum_filter(distances, 9)) & (distances > 0)
    ends = np.argwhere(highest)[:, ::-1]
    if not len(ends):
        return None
    detours = sum(np.hypot(*(ends - np.array(cell)).T) for cell in query)
    nearest: Points = ends[np.argmin(detours)].astype(np.float64)
    return nearest
