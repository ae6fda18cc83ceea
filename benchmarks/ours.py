"""Our own rows of the comparison: the same queries by each of our searches."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.any_angle import string_pull
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.landmarks import LandmarkManager, Landmarks
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.source import WaypointQuery
from numpy.typing import NDArray

from benchmarks.cases import Problem, Query
from benchmarks.peers import Plan

# The row that all others are divided by.
EXACT = 'exact_astar'
# How far from the cheapest a path may be, as planner_node's default is.
BOUND = 1.1
PATIENCE_S = 120.0


class Prepared:
    """What our searches need on one map, made once, with the CPU milliseconds that took.

    `grid_ms` is for the moves alone, `packed_ms` for the bits of the search for jump points,
    `coarse_ms` for the graph of coarse routes, `planner_ms` for all that `Planner` prepares in the
    calling thread, `landmarks_ms` for the landmarks, which a thread measures in the background.
    """

    def __init__(self, problem: Problem) -> None:
        """Prepare a map."""
        self.problem = problem
        self.manager = LandmarkManager()
        begin, process = time.thread_time(), time.process_time()
        self.planner = Planner(problem.grid_map, problem.config, landmarks=self.manager)
        self.planner.prepare(wait=False)
        self.planner_ms = (time.thread_time() - begin) * 1e3
        self.manager.wait(PATIENCE_S)
        self.landmarks_ms = (time.process_time() - process) * 1e3 - self.planner_ms
        costmap = self.planner.costmap
        self.grid = costmap.grid_graph
        begin = time.thread_time()
        grid = GridGraph(costmap.blocked, cost=costmap.cost if problem.graded else None)
        self.grid_ms = (time.thread_time() - begin) * 1e3
        begin = time.thread_time()
        _ = problem.graded or grid.packed
        self.packed_ms = (time.thread_time() - begin) * 1e3
        begin = time.thread_time()
        _ = costmap.coarse_graph
        self.coarse_ms = (time.thread_time() - begin) * 1e3

    @cached_property
    def landmarks(self) -> Landmarks | None:
        """The landmarks that are ready for the map."""
        return ready_landmarks(self.manager, self.grid)

    @cached_property
    def turns(self) -> dict[Query, NDArray[np.float64]]:
        """The turns of each query's cheapest path, straightened: an oracle's waypoints."""
        return {
            query: string_pull(
                self.grid, exact_astar(self.grid, *query, want_expanded=False).path
            ).points[1:-1].astype(np.float64)
            for query in self.problem.queries
        }  # fmt: skip


def ready_landmarks(manager: LandmarkManager, grid: GridGraph) -> Landmarks | None:
    """Return the landmarks that are admissible on a grid, if there are any."""
    with manager.lend(grid) as landmarks:
        return landmarks


class Ours(NamedTuple):
    """One of our rows: how to plan with what was prepared, and which preparation it needs."""

    name: str
    prepare: Callable[[Prepared], Plan]
    preparation_ms: Callable[[Prepared], float]


def prepare_exact(prepared: Prepared) -> Plan:
    """Return the plain exact A*."""
    grid = prepared.grid
    return lambda start, goal: exact_astar(grid, start, goal, want_expanded=False).path


def prepare_guided(prepared: Prepared, *, landmarks: bool) -> Plan:
    """Return the guided search without waypoints, which is exact."""
    return lambda start, goal: run_guided(prepared, start, goal, landmarks=landmarks)


def prepare_oracle(prepared: Prepared, bound: float | None) -> Plan:
    """Return the guided search with the turns of the cheapest path; finding them is not timed."""
    turns = prepared.turns
    return lambda start, goal: run_guided(prepared, start, goal, turns[start, goal], bound)


def prepare_coarse(prepared: Prepared, bound: float | None) -> Plan:
    """Return the guided search with the waypoints of `coarse`, whose time is included."""
    source, costmap = make_source(SourceSettings(source='coarse')), prepared.planner.costmap

    def plan(start: Cell, goal: Cell) -> NDArray[Any]:
        reply = source.waypoints(WaypointQuery(costmap, start, goal))
        return run_guided(prepared, start, goal, np.array(reply.waypoints).reshape(-1, 2), bound)

    return plan


def prepare_planner(prepared: Prepared, *, any_angle: bool) -> Plan:
    """Return `Planner.plan` as a robot calls it, without a waypoint source."""

    def plan(start: Cell, goal: Cell) -> NDArray[Any]:
        request = PlanRequest(
            start,
            goal,
            max_suboptimality=BOUND,
            any_angle=any_angle,
            want_expanded=False,
            time_limit=PATIENCE_S,
        )
        return prepared.planner.plan(request).path

    return plan


def run_guided(
    prepared: Prepared,
    start: Cell,
    goal: Cell,
    waypoints: NDArray[np.float64] | tuple[()] = (),
    bound: float | None = None,
    *,
    landmarks: bool = True,
) -> NDArray[np.int32]:
    """Return the path of one guided search."""
    return guided(
        prepared.grid,
        start,
        goal,
        waypoints,
        max_suboptimality=bound,
        landmarks=prepared.landmarks if landmarks else None,
        want_expanded=False,
    ).path


def moves_ms(prepared: Prepared) -> float:
    """Return what preparing the moves took, in milliseconds."""
    return prepared.grid_ms


def search_ms(prepared: Prepared) -> float:
    """Return what the guided search needs without landmarks, in milliseconds."""
    return prepared.grid_ms + prepared.packed_ms


def landmarks_ms(prepared: Prepared) -> float:
    """Return what the guided search needs with landmarks, in milliseconds."""
    return search_ms(prepared) + prepared.landmarks_ms


def planner_ms(prepared: Prepared) -> float:
    """Return what a `Planner` needs, landmarks included, in milliseconds."""
    return prepared.planner_ms + prepared.packed_ms + prepared.landmarks_ms


def coarse_ms(prepared: Prepared) -> float:
    """Return what a `Planner` with coarse waypoints needs, in milliseconds."""
    return planner_ms(prepared) + prepared.coarse_ms


def our_rows() -> list[Ours]:
    """Return our rows."""
    return [
        Ours(EXACT, prepare_exact, moves_ms),
        Ours('guided', partial(prepare_guided, landmarks=True), landmarks_ms),
        Ours('guided, no landmarks', partial(prepare_guided, landmarks=False), search_ms),
        Ours('guided, oracle, 1.1', partial(prepare_oracle, bound=BOUND), landmarks_ms),
        Ours('guided, oracle, best effort', partial(prepare_oracle, bound=None), landmarks_ms),
        Ours('guided, coarse, 1.1', partial(prepare_coarse, bound=BOUND), coarse_ms),
        Ours('guided, coarse, best effort', partial(prepare_coarse, bound=None), coarse_ms),
        Ours('Planner.plan', partial(prepare_planner, any_angle=False), planner_ms),
        Ours('Planner.plan, any_angle', partial(prepare_planner, any_angle=True), planner_ms),
    ]
