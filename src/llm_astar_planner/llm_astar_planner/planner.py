"""The planner as one object: a request in, a plan out, whatever happens in between.

The same Planner serves the node, the benchmark, the evaluation of bags and a plain caller.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from llm_astar_msgs_adapter.barrier_map import BarrierMap
from llm_astar_msgs_adapter.grid_map import GridMap
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner import targets
from llm_astar_planner.result_code import ResultCode
from llm_astar_planner.search.methods import (
    HEURISTICS,
    METHODS,
    WAYPOINT_METHODS,
    SearchOptions,
    no_stop,
)
from llm_astar_planner.search.result import Cell, SearchResult, SearchStatus
from llm_astar_planner.targets import JudgedWaypoint
from llm_astar_planner.validator import path_problem
from llm_astar_planner.waypoint_source.base import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

# The part of a request's time that a source may take; the rest is the search's.
SOURCE_SHARE = 0.8
NOT_ASKED = WaypointReply(status=SourceStatus.NONE)


@dataclass(frozen=True)
class GridRules:
    """Where a path may go: what counts as occupied, and whether it may cut corners."""

    occupied_threshold: int = 65
    allow_unknown: bool = True
    corner_cutting: bool = False


@dataclass(frozen=True)
class PlanRequest:
    """One question to the planner: a way from start to goal, both cells (x, y).

    `time_limit` is seconds for everything, of which the source gets at most `source_time_limit`.
    `sample` names the benchmark sample, where there is one.
    """

    start: Cell
    goal: Cell
    method: str = 'llm_astar'
    source: WaypointSource | None = None
    heuristic: str = 'euclidean'
    weight: float = 2.0
    time_limit: float = 5.0
    source_time_limit: float = float('inf')
    sample: SampleKey | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """What came of a request.

    `path` is int32 [n, 2], cells (x, y), empty unless `code` is NONE; `length` is in cells.
    `guided_by` names whose waypoints steered the search, `none` where nobody's did; `reply` is
    the source's whole answer. `expanded` is bool [height, width].
    """

    code: ResultCode
    message: str
    method: str
    path: NDArray[np.int32]
    expanded: NDArray[np.bool_]
    waypoints: tuple[JudgedWaypoint, ...] = ()
    guided_by: str = 'none'
    source: str = 'none'
    reply: WaypointReply = NOT_ASKED
    operation: int = 0
    storage: int = 0
    length: float = float('nan')
    seconds_source: float = 0.0
    seconds_search: float = 0.0

    @property
    def source_status(self) -> SourceStatus:
        """How asking the source went."""
        return self.reply.status


@dataclass
class _Draft:
    """What is known of a plan while it is being made."""

    request: PlanRequest
    deadline: float
    stop: NDArray[np.uint8] = field(default_factory=no_stop)
    reply: WaypointReply = NOT_ASKED
    judged: tuple[JudgedWaypoint, ...] = ()
    seconds_source: float = 0.0
    seconds_search: float = 0.0

    @property
    def time_left(self) -> float:
        return self.deadline - time.monotonic()


class Planner:
    """Plans on one map under one set of rules. Immutable, so safe to share between threads."""

    def __init__(
        self,
        grid_map: GridMap,
        rules: GridRules | None = None,
        barrier_map: BarrierMap | None = None,
    ) -> None:
        """Take a map; `barrier_map`, where the grid comes from one, makes LLM-A* exact on it."""
        self.grid_map = grid_map
        self.rules = rules or GridRules()
        self._barrier_map = barrier_map

    @classmethod
    def for_barrier_map(cls, barrier_map: BarrierMap) -> Planner:
        """Make a planner under the paper's rules: corners may be cut, its filter is exact."""
        return cls(barrier_map.to_grid(), GridRules(corner_cutting=True), barrier_map)

    @cached_property
    def blocked(self) -> NDArray[np.bool_]:
        """Where a path may not go: bool [height, width]."""
        return self.grid_map.blocked(
            self.rules.occupied_threshold, allow_unknown=self.rules.allow_unknown
        )

    @cached_property
    def components(self) -> NDArray[np.int32]:
        """The connected free cells, numbered from 1 (0 is blocked): int32 [height, width].

        A diagonal step that cuts no corner can be walked as two straight ones, so without corner
        cutting four neighbours decide, and with it eight.
        """
        neighbours = np.ones((3, 3)) if self.rules.corner_cutting else None
        labels, _ = ndimage.label(~self.blocked, structure=neighbours)
        components: NDArray[np.int32] = labels.astype(np.int32, copy=False)
        return components

    @cached_property
    def _waypoint_cells(self) -> NDArray[np.bool_]:
        return targets.waypoint_cells(self.blocked, self._barrier_map)

    def prepare(self) -> Planner:
        """Do the once-a-map work now instead of at the first plan."""
        _ = self.components, self._waypoint_cells
        return self

    def plan(self, request: PlanRequest, stop: NDArray[np.uint8] | None = None) -> Plan:
        """Answer a request. Never raises for what a request, a source or a map may hold.

        Another thread cancels by setting `stop[0] = 1`, which ends in TIMEOUT.
        """
        draft = _Draft(request, time.monotonic() + request.time_limit)
        if stop is not None:
            draft.stop = stop
        refusal = self._refusal(request)
        if refusal is not None:
            return self._failure(draft, *refusal)
        self._ask(draft)
        result = self._search(draft)
        return self._plan(draft, result)

    def _refusal(self, request: PlanRequest) -> tuple[ResultCode, str] | None:
        """Say why a request cannot be searched at all, or None."""
        if request.method not in METHODS:
            known = ', '.join(METHODS)
            return ResultCode.INVALID_PLANNER, f'no method {request.method!r}; there is {known}'
        if request.heuristic not in HEURISTICS:
            known = ', '.join(HEURISTICS)
            message = f'no heuristic {request.heuristic!r}; there is {known}'
            return ResultCode.INVALID_PLANNER, message
        ends = (
            ('start', request.start, ResultCode.START_OUTSIDE_MAP, ResultCode.START_OCCUPIED),
            ('goal', request.goal, ResultCode.GOAL_OUTSIDE_MAP, ResultCode.GOAL_OCCUPIED),
        )
        for name, cell, outside, _ in ends:
            if not self.grid_map.contains(cell):
                size = f'{self.grid_map.width} x {self.grid_map.height}'
                return outside, f'the {name} cell {cell} is outside the map of {size} cells'
        for name, (x, y), _, occupied in ends:
            if self.blocked[y, x]:
                value = self.grid_map.cells[y, x]
                return occupied, f'the {name} cell {(x, y)} is not free (occupancy {value})'
        start, goal = (self.components[y, x] for x, y in (request.start, request.goal))
        if start != goal:
            return ResultCode.NO_VALID_PATH, 'obstacles cut the goal off from the start'
        return None

    def _ask(self, draft: _Draft) -> None:
        """Ask the source for waypoints, where the method has a use for them, and judge them."""
        request = draft.request
        source = request.source
        needless = request.method not in WAYPOINT_METHODS or request.start == request.goal
        if source is None or needless:
            return
        begin = time.monotonic()
        time_limit = min(request.source_time_limit, SOURCE_SHARE * draft.time_left)
        query = WaypointQuery(
            self.grid_map, request.start, request.goal, time_limit, request.sample
        )
        try:
            draft.reply = source.waypoints(query)
        except Exception as error:  # noqa: BLE001 - no source may ever stop a plan
            detail = f'{type(error).__name__} in source {source.name}'
            draft.reply = WaypointReply(status=SourceStatus.ERROR, detail=detail)
        draft.seconds_source = time.monotonic() - begin
        draft.judged = targets.judge(
            draft.reply.waypoints, self._waypoint_cells, self.components, request.start
        )

    def _search(self, draft: _Draft) -> SearchResult:
        request = draft.request
        goals = targets.target_list(draft.judged, request.start, request.goal)[1:]
        options = SearchOptions(
            request.heuristic, request.weight, self.rules.corner_cutting, draft.stop
        )
        begin = time.monotonic()
        with _raised_after(draft.time_left, draft.stop):
            result = METHODS[request.method](
                self.blocked, request.start, request.goal, goals, options
            )
        draft.seconds_search = time.monotonic() - begin
        return result

    def _plan(self, draft: _Draft, result: SearchResult) -> Plan:
        """Turn a search's outcome into a plan; only a valid path leaves."""
        request = draft.request
        if result.status is SearchStatus.STOPPED:
            message = f'stopped after {result.operation} expansions, short of the goal'
            return self._failure(draft, ResultCode.TIMEOUT, message, result)
        if result.status is SearchStatus.EXHAUSTED:
            message = 'every reachable cell was searched'
            return self._failure(draft, ResultCode.NO_VALID_PATH, message, result)
        problem = path_problem(
            result.path,
            self.blocked,
            request.start,
            request.goal,
            corner_cutting=self.rules.corner_cutting,
        )
        if problem is not None:
            message = f'the path found was withheld: {problem}'
            return self._failure(draft, ResultCode.UNKNOWN, message, result)
        draft.judged = targets.mark_out_of_order(draft.judged, result.path)
        return replace(
            self._failure(draft, ResultCode.NONE, '', result),
            message=_success_message(draft, result),
            path=result.path,
            length=result.length,
        )

    def _failure(
        self,
        draft: _Draft,
        code: ResultCode,
        message: str,
        result: SearchResult | None = None,
    ) -> Plan:
        """Build a plan without a path."""
        source = draft.request.source
        return Plan(
            code=code,
            message=message,
            method=draft.request.method,
            path=np.empty((0, 2), dtype=np.int32),
            expanded=np.zeros_like(self.blocked) if result is None else result.expanded,
            waypoints=draft.judged,
            guided_by=_guided_by(draft),
            source='none' if source is None else source.name,
            reply=draft.reply,
            operation=0 if result is None else result.operation,
            storage=0 if result is None else result.storage,
            seconds_source=draft.seconds_source,
            seconds_search=draft.seconds_search,
        )


def _guided_by(draft: _Draft) -> str:
    used = any(point.verdict.used for point in draft.judged)
    return draft.reply.label if used else 'none'


def _success_message(draft: _Draft, result: SearchResult) -> str:
    path = f'{result.length:.2f} cells in {result.operation} expansions'
    used = sum(point.verdict.used for point in draft.judged)
    if draft.judged:
        path += f', {used} of {len(draft.judged)} waypoints used'
    if draft.reply.detail:
        path += f'; {draft.reply.detail}'
    return path


@contextmanager
def _raised_after(seconds: float, stop: NDArray[np.uint8]) -> Iterator[None]:
    """Raise the stop flag after so many seconds, unless the block has ended by then."""

    def expire() -> None:
        stop[0] = 1

    timer = threading.Timer(min(max(seconds, 0.0), threading.TIMEOUT_MAX), expire)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
