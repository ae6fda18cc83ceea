# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs methods with waypoint sources over samples.

A task is one sample at one scale with all its variants. Each source is asked once per task and
its answer is given to every method, so a run costs one request per sample, prompt and model.
Any concurrent.futures executor can run them.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.caches import cached
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zone_layer import with_zones
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import NOT_ASKED, PlanRequest, ResultCode
from llm_astar_planner.search.methods import METHODS, uses_waypoints
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.source import (
    SampleKey,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

from llm_astar_lab.analysis.replies import problems_column
from llm_astar_lab.datasets.named import GRID_CONFIG, BenchmarkSample
from llm_astar_lab.results import row as rows
from llm_astar_lab.results.row import PAPER_ASTAR, WAYPOINTS_ONLY, Row, Variant
from llm_astar_lab.results.stored_rows import Finished
from llm_astar_lab.runner.sources import SourceSpec

ALL_METHODS = (*METHODS, WAYPOINTS_ONLY)
# What a run asks where it says nothing else.
REQUEST = PlanRequest((0, 0), (0, 0), time_limit=60.0)
# Variants, each with the index of its source.
Variants = tuple[tuple[Variant, int], ...]
# Bounds of the planner cache. A cell of a planner takes about 40 bytes with its landmarks.
MAX_CACHED_CELLS = 2_000_000
MAX_CACHED_PLANNERS = 16


@dataclass(frozen=True)
class SearchSettings:
    """What all variants of a run share: of the `request` all but ends, method and source.

    Without `costmap` the kind of map decides: the paper's rules on barrier maps, MovingAI's on
    grids. With `paper_corners` paths may cut corners on maps whose barriers are known, whatever
    `costmap` says. `zones` is the text of a GeoJSON file, '' for none.
    """

    request: PlanRequest = REQUEST
    costmap: CostmapConfig | None = None
    paper_corners: bool = False
    zones: str = ''

    def costmap_for(self, problem: ProblemMap) -> CostmapConfig:
        """Return the costmap rules for a map."""
        has_barriers = isinstance(problem, BarrierMap)
        if self.costmap is None:
            return CostmapConfig(corner_cutting=True) if has_barriers else GRID_CONFIG
        if self.paper_corners and has_barriers:
            return replace(self.costmap, corner_cutting=True)
        return self.costmap


@dataclass(frozen=True, slots=True)
class Task:
    """One sample at one scale; `variants` pairs each variant with the index of its source.

    `recorded` is of a request from a bag: on the map of a planner it returns the columns of a row
    that describe what the robot's own stack planned. Sources see the sample's key only if
    `is_sample`, that is if the request is a sample of a known dataset.
    """

    sample: BenchmarkSample
    scale: int
    variants: Variants
    sources: tuple[SourceSpec, ...]
    settings: SearchSettings = field(default_factory=SearchSettings)
    recorded: Callable[[Planner], dict[str, Any]] | None = None
    is_sample: bool = True


@dataclass(frozen=True)
class AnsweredSource:
    """A waypoint source that returns an answer which is already known."""

    name: str
    reply: WaypointReply

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the known answer."""
        del query
        return self.reply


def list_variants(
    methods: Sequence[str], sources: Sequence[SourceSpec]
) -> list[tuple[Variant, int]]:
    """Combine methods with sources and return each variant with the index of its source.

    A* comes first. Methods that use waypoints are combined with every source, the others only
    with `sources[0]`, which must be the one without waypoints; `waypoints_only` skips that one.
    """
    variants = [(PAPER_ASTAR, 0)]
    for method in methods:
        if method != WAYPOINTS_ONLY and not uses_waypoints(method):
            variants.append((Variant(method), 0))
            continue
        for index, spec in enumerate(sources):
            if spec.source is not None or method != WAYPOINTS_ONLY:
                variants.append((Variant(method, spec.name, spec.prompt, spec.model), index))
    return list(dict.fromkeys(variants))


def make_tasks(
    samples: Iterable[tuple[BenchmarkSample, int]],
    variants: Sequence[tuple[Variant, int]],
    sources: Sequence[SourceSpec],
    settings: SearchSettings,
    done: Finished | None = None,
) -> list[Task]:
    """Make one task per pair of sample and scale, without the variants that are `done` for it.

    A source with `samples` is run on these alone.
    """
    # A task goes to its worker without the samples of the others.
    plain = tuple(replace(spec, samples=None) for spec in sources)
    # Most tasks have the same variants: they share one tuple.
    shared: dict[Variants, Variants] = {}
    tasks = []
    for key, (sample, scale) in {(*pair[0].key, pair[1]): pair for pair in samples}.items():
        finished = (done or {}).get(key, frozenset())
        left = tuple(
            (variant, index)
            for variant, index in variants
            if variant not in finished and sources[index].covers(key)
        )
        if left:
            tasks.append(Task(sample, scale, shared.setdefault(left, left), plain, settings))
    return tasks


def run_tasks(
    tasks: Iterable[Task],
    executor: Executor,
    max_pending: int,
    keep: Callable[[list[Row]], None],
) -> None:
    """Run tasks, at most `max_pending` of them submitted; give `keep` the rows of each.

    An exception, KeyboardInterrupt included, cancels the tasks that have not started and
    propagates.
    """
    pending: list[Future[list[Row]]] = []
    left = iter(tasks)
    try:
        while True:
            free = max_pending - len(pending)
            pending += [executor.submit(run_task, task) for task in islice(left, free)]
            if not pending:
                return
            done, running = wait(pending, return_when=FIRST_COMPLETED)
            # These are sets; rows are kept in the order of the tasks.
            for future in [future for future in pending if future in done]:
                keep(future.result())
            pending = [future for future in pending if future in running]
    finally:
        for future in pending:
            future.cancel()


def run_task(task: Task) -> list[Row]:
    """Ask each source of the task once and plan every variant; return the rows."""
    compile_once()
    scaled = replace(task.sample.barrier_map, samples=(task.sample.sample,)).scale(task.scale)
    planner = planner_of(scaled, task.settings)
    sample, key = scaled.samples[0], SampleKey(*task.sample.key, task.scale)
    ends = scaled.to_cell(sample.start), scaled.to_cell(sample.goal)
    known = key if task.is_sample else None
    query = WaypointQuery(planner.costmap, *ends, task.settings.request.time_limit, known)
    recorded = {} if task.recorded is None else task.recorded(planner)
    replies: dict[int, tuple[WaypointReply, dict[str, Any]]] = {}
    found = []
    for variant, index in task.variants:
        if index not in replies:
            replies[index] = ask(task.sources[index].source, query)
        reply, of_reply = replies[index]
        if variant.method == WAYPOINTS_ONLY:
            columns = waypoints_only_columns(planner, ends, reply)
        else:
            source = None if reply is NOT_ASKED else AnsweredSource(variant.source, reply)
            request = make_request(ends, variant.method, source, task.settings)
            request = replace(request, want_expanded=False, sample=key)
            plan = planner.plan(request)
            statuses = [point.status.value for point in plan.checked_waypoints]
            columns = rows.plan_columns(plan.to_dict(), statuses, plan.path)
        columns |= of_reply | recorded | {'family': task.sample.barrier_map.family}
        found.append(Row(*task.sample.key, task.scale, *variant, **columns))
    return found


def ask(
    source: WaypointSource | None, query: WaypointQuery
) -> tuple[WaypointReply, dict[str, Any]]:
    """Return the reply of a source, and the columns of a row that describe it."""
    if source is None:
        return NOT_ASKED, {'source_status': 'NONE'}
    reply, seconds = query_source(source, query)
    problems = problems_column(reply, query.costmap, query.start, query.goal)
    return reply, {
        'seconds_source': seconds, 'source_status': reply.status.value,
        'prompt_tokens': reply.prompt_tokens, 'completion_tokens': reply.completion_tokens,
        'waypoints': rows.format_points(reply.waypoints), 'reply_problems': problems,
        'seconds_reply': reply.seconds if problems and reply.seconds > 0 else math.nan,
    }  # fmt: skip


def make_request(
    ends: tuple[Cell, Cell], method: str, source: WaypointSource | None, settings: SearchSettings
) -> PlanRequest:
    """Return the request for a sample with the settings of the run."""
    start, goal = ends
    return replace(settings.request, start=start, goal=goal, method=method, source=source)


def waypoints_only_columns(
    planner: Planner, endpoints: tuple[Cell, Cell], reply: WaypointReply
) -> dict[str, Any]:
    """Take the waypoints as the path: valid if every straight segment is a line of sight.

    An answer without waypoints is the straight line; without an answer there is no path.
    """
    start, goal = endpoints
    points = [start, *(point for point in reply.waypoints if point not in endpoints), goal]
    answered = reply.status.value in ('OK', 'NO_WAYPOINTS')
    if not (answered and planner.costmap.line_of_sight.clear_along(points)):
        return {'code': ResultCode.NO_VALID_PATH.name}
    steps = np.diff(np.array(points, dtype=float), axis=0)
    return {
        'code': ResultCode.NONE.name,
        'length': float(np.hypot(*steps.T).sum()),
        'path': rows.format_points(points),
    }


def cache_size(planner: Planner) -> int:
    """Return the share of the cache that a planner takes, at most all of it."""
    cells = planner.grid_map.cells.size
    return min(max(cells, MAX_CACHED_CELLS // MAX_CACHED_PLANNERS), MAX_CACHED_CELLS)


def planner_of(problem: ProblemMap, settings: SearchSettings) -> Planner:
    """Return the planner for a map with the rules and zones of a run."""
    return planner_for(replace(problem, samples=()), settings.costmap_for(problem), settings.zones)


@cached(MAX_CACHED_CELLS, key=lambda *arguments: arguments, cost=cache_size)
def planner_for(problem: ProblemMap, costmap: CostmapConfig, zones: str = '') -> Planner:
    """Return the planner for a map with zones, from the cache of the last ones. Thread-safe."""
    barriers = problem if isinstance(problem, BarrierMap) else None
    grid_map = problem.to_grid()
    grid_map = with_zones(grid_map, zones, costmap) if zones else grid_map
    return Planner(grid_map, costmap, barriers).prepare()


@lru_cache(maxsize=1)
def compile_once() -> None:
    """Compile the search kernels before anything is timed."""
    compile_kernels()
