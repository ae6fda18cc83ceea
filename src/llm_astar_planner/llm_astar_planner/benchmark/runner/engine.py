"""Run methods with waypoint sources over samples, rows as they come.

A task is one sample at one scale under all its cases. Each source is asked once a task and its
answer given to every method, so a sweep costs one request a sample, prompt and model. Tasks are
values and `run_task` a plain function, so any concurrent.futures executor can take them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Sample

from llm_astar_planner.benchmark.bags.recorded_plans import Occasion
from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample, ProblemMap
from llm_astar_planner.benchmark.points import format_points, parse_points, turning_points
from llm_astar_planner.benchmark.results import Case, Row
from llm_astar_planner.benchmark.runner.planner_cache import PlannerCache
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import NOT_ASKED, Plan, PlanRequest, ResultCode
from llm_astar_planner.search.paper import METHODS, WAYPOINT_METHODS, compile_kernels
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

BASELINE = Case('astar')
LLM_ONLY = 'llm_only'
ALL_METHODS = (*METHODS, LLM_ONLY)
_planners = PlannerCache()
NOTHING_EXPANDED = np.zeros((0, 0), dtype=np.bool_)


@dataclass(frozen=True)
class Asker:
    """A source under the name, prompt and model its rows are filed under."""

    source: WaypointSource | None = None
    name: str = 'none'
    prompt: str = ''
    model: str = ''


@dataclass(frozen=True)
class Settings:
    """What all cases of a run share; see PlanRequest and CostmapConfig.

    Without `rules` those of the kind of map hold: the paper's on barriers, MovingAI's on a grid.
    With `paper_corners` paths may cut corners where a map's barriers are known, whatever `rules`
    say of it.
    """

    heuristic: str = 'euclidean'
    weight: float = 2.0
    time_limit: float = 60.0
    max_suboptimality: float | None = None
    rules: CostmapConfig | None = None
    tolerance: float = 0.0
    start_tolerance: float = 0.0
    paper_corners: bool = False

    def rules_on(self, problem: ProblemMap) -> CostmapConfig | None:
        """Return the rules that hold on a map."""
        if self.rules and self.paper_corners and isinstance(problem, BarrierMap):
            return replace(self.rules, corner_cutting=True)
        return self.rules


@dataclass(frozen=True)
class Task:
    """One sample at one scale; `cases` pairs each case with the index of its asker.

    `occasion` is that of a bag's request, which sources are asked about as a benchmark's sample
    only if `is_sample`.
    """

    sample: BenchmarkSample
    scale: int
    cases: tuple[tuple[Case, int], ...]
    askers: tuple[Asker, ...]
    settings: Settings = field(default_factory=Settings)
    occasion: Occasion | None = None
    is_sample: bool = True


class Outcome(NamedTuple):
    """What came of one case of a task: its row, and the plan, if a planner made one."""

    row: Row
    plan: Plan | None = None


def plan_cases(methods: Sequence[str], askers: Sequence[Asker]) -> list[tuple[Case, int]]:
    """Pair methods with askers: waypoint methods with each, the others with none. A* is first.

    `askers[0]` must be the one of no source; `llm_only` leaves it out.
    """
    cases = [(BASELINE, 0)]
    for method in methods:
        if method not in WAYPOINT_METHODS and method != LLM_ONLY:
            cases.append((Case(method), 0))
            continue
        for index, asker in enumerate(askers):
            if asker.source is not None or method != LLM_ONLY:
                cases.append((Case(method, asker.name, asker.prompt, asker.model), index))
    return list(dict.fromkeys(cases))


def plan_tasks(
    samples: Iterable[tuple[BenchmarkSample, int]],
    cases: Sequence[tuple[Case, int]],
    askers: Sequence[Asker],
    settings: Settings,
    done: frozenset[tuple[int, int, int, Case]] = frozenset(),
) -> list[Task]:
    """Make the tasks of samples at scales, without the rows that are `done` (their keys)."""
    tasks = []
    for sample, scale in dict.fromkeys(samples):
        left = tuple(
            (case, index) for case, index in cases if (*sample.key, scale, case) not in done
        )
        if left:
            tasks.append(Task(sample, scale, left, tuple(askers), settings))
    return tasks


def run_tasks(
    tasks: Iterable[Task],
    executor: Executor,
    at_once: int,
    keep: Callable[[Task, list[Outcome]], None],
) -> None:
    """Run tasks with at most `at_once` in flight; `keep` gets each with what came of it.

    An exception, KeyboardInterrupt among them, cancels what has not begun and passes on.
    """
    for task, outcomes in _completed(tasks, executor, at_once):
        keep(task, outcomes)


def run_task(task: Task) -> list[Outcome]:
    """Ask each source of the task once and plan every case."""
    _warm_up()
    scaled = replace(task.sample.barrier_map, samples=(task.sample.sample,)).scale(task.scale)
    planner = _planners.get(replace(scaled, samples=()), task.settings.rules_on(scaled))
    sample = scaled.samples[0]
    ends = scaled.to_cell(sample.start), scaled.to_cell(sample.goal)
    key = SampleKey(*task.sample.key, task.scale)
    replies: dict[int, tuple[WaypointReply, float]] = {}
    known = {} if task.occasion is None else task.occasion.columns(planner)
    outcomes = []
    for case, index in task.cases:
        source = task.askers[index].source
        if source is not None and index not in replies:
            asked = key if task.is_sample else None
            query = WaypointQuery(planner.costmap, *ends, task.settings.time_limit, asked)
            replies[index] = query_source(source, query)
        reply, seconds = replies.get(index, (NOT_ASKED, 0.0))
        outcome = _run_case(planner, key, ends, case, reply=reply, settings=task.settings)
        row = replace(outcome.row, seconds_source=seconds, **known)
        outcomes.append(outcome._replace(row=row))
    return outcomes


def plan_again(barrier_map: ProblemMap, sample: Sample, row: Row, settings: Settings) -> Plan:
    """Plan a row of scale 1 once more with the waypoints it had, to see what it expanded."""
    planner = _planners.get(replace(barrier_map, samples=()), settings.rules_on(barrier_map))
    reply = WaypointReply(parse_points(row.waypoints), label=row.source)
    request = PlanRequest(
        barrier_map.to_cell(sample.start),
        barrier_map.to_cell(sample.goal),
        row.method,
        _Answered(row.source, reply) if row.waypoints else None,
        settings.heuristic,
        settings.weight,
        settings.time_limit,
        max_suboptimality=settings.max_suboptimality,
        tolerance=settings.tolerance,
        start_tolerance=settings.start_tolerance,
    )
    return planner.plan(request)


def _completed(
    tasks: Iterable[Task], executor: Executor, at_once: int
) -> Iterator[tuple[Task, list[Outcome]]]:
    waiting: dict[Future[list[Outcome]], Task] = {}
    left = iter(tasks)
    try:
        while True:
            while len(waiting) < at_once and (task := next(left, None)) is not None:
                waiting[executor.submit(run_task, task)] = task
            if not waiting:
                return
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield waiting.pop(future), future.result()
    finally:
        for future in waiting:
            future.cancel()


@lru_cache(maxsize=1)
def _warm_up() -> None:
    """Compile before anything is timed."""
    compile_kernels()


@dataclass(frozen=True)
class _Answered:
    """A source that has already been asked."""

    name: str
    reply: WaypointReply

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the answer there is."""
        del query
        return self.reply


def _run_case(
    planner: Planner,
    key: SampleKey,
    ends: tuple[Cell, Cell],
    case: Case,
    *,
    reply: WaypointReply,
    settings: Settings,
) -> Outcome:
    if case.method == LLM_ONLY:
        return Outcome(_llm_only(planner, key, ends, case, reply))
    source = None if reply is NOT_ASKED else _Answered(case.source, reply)
    request = PlanRequest(
        *ends,
        case.method,
        source,
        settings.heuristic,
        settings.weight,
        settings.time_limit,
        max_suboptimality=settings.max_suboptimality,
        want_expanded=False,
        sample=key,
        tolerance=settings.tolerance,
        start_tolerance=settings.start_tolerance,
    )
    plan = planner.plan(request)
    found = plan.code is ResultCode.NONE
    row = replace(
        _empty_row(key, case, reply, plan.code),
        operation=float(plan.expansions),
        storage=float(plan.storage),
        length=plan.length if found else float('nan'),
        seconds_search=plan.seconds_search,
        guided_by=plan.guided_by,
        verdicts=';'.join(point.status.value for point in plan.waypoints),
        path=format_points(turning_points(plan.path)),
        first_operation=float(plan.first_expansions) if found else float('nan'),
        ratio=plan.suboptimality_bound,
        clearance=plan.clearance if found else float('nan'),
        turns=float(plan.turns) if found else float('nan'),
        unknown_length=plan.unknown_length if found else float('nan'),
    )
    return Outcome(row, replace(plan, expanded=NOTHING_EXPANDED))


def _llm_only(
    planner: Planner, key: SampleKey, ends: tuple[Cell, Cell], case: Case, reply: WaypointReply
) -> Row:
    """Take the waypoints for the path: valid if every straight leg is a line of sight.

    An answer without points is the straight line; no answer is no path.
    """
    points = [ends[0], *(point for point in reply.waypoints if point not in ends), ends[1]]
    answered = reply.status in (SourceStatus.OK, SourceStatus.NO_WAYPOINTS)
    if not (answered and planner.costmap.line_of_sight.clear_along(points)):
        return _empty_row(key, case, reply, ResultCode.NO_VALID_PATH)
    steps = np.diff(np.array(points, dtype=float), axis=0)
    return replace(
        _empty_row(key, case, reply, ResultCode.NONE),
        length=float(np.hypot(*steps.T).sum()),
        path=format_points(points),
    )


def _empty_row(key: SampleKey, case: Case, reply: WaypointReply, code: ResultCode) -> Row:
    return Row(
        int(key.map),
        int(key.pair),
        key.scale,
        *case,
        code.name,
        source_status=reply.status.value,
        prompt_tokens=reply.prompt_tokens,
        completion_tokens=reply.completion_tokens,
        waypoints=format_points(reply.waypoints),
    )
