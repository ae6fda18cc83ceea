"""The planner as one object: a request in, a plan out, whatever happens in between.

The same Planner serves the node, the benchmark, the evaluation of bags and a plain caller.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from llm_astar_msgs_adapter.barrier_map import BarrierMap
from llm_astar_msgs_adapter.grid_map import GridMap
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner import targets
from llm_astar_planner.asking import Asking, ask
from llm_astar_planner.plan import NOT_ASKED, GridRules, Plan, PlanRequest
from llm_astar_planner.result_code import ResultCode
from llm_astar_planner.search.fast_grid import (
    BoundedResult,
    FastGrid,
    PathTooLongError,
    exact_astar,
)
from llm_astar_planner.search.guided import GuidedResult, GuidedSearch, Improvement
from llm_astar_planner.search.landmarks import LandmarkKeeper
from llm_astar_planner.search.methods import (
    EXACT,
    GUIDED,
    HEURISTICS,
    METHODS,
    PAPER_METHODS,
    WAYPOINT_METHODS,
    SearchOptions,
    no_stop,
)
from llm_astar_planner.search.result import Cell, SearchResult, SearchStatus
from llm_astar_planner.search.shortcut import AnyAnglePath, shorten
from llm_astar_planner.targets import JudgedWaypoint
from llm_astar_planner.validator import legs_problem, path_problem
from llm_astar_planner.waypoint_source.base import Waypoint, WaypointQuery, WaypointReply

__all__ = ['NOT_ASKED', 'GridRules', 'Plan', 'PlanRequest', 'Planner']

# The part of a request's time that a source may take; the rest is the search's.
SOURCE_SHARE = 0.8
MAX_BOUND = 1000.0
Watcher = Callable[[Improvement], None]


@dataclass
class _Draft:
    """What is known of a plan while it is being made."""

    request: PlanRequest
    deadline: float
    stop: NDArray[np.uint8] = field(default_factory=no_stop)
    reply: WaypointReply = NOT_ASKED
    judged: tuple[JudgedWaypoint, ...] = ()
    led: bool = True  # whether the search took up what waypoints there were
    seconds_source: float = 0.0
    seconds_search: float = 0.0

    @property
    def time_left(self) -> float:
        return self.deadline - time.monotonic()

    @property
    def used(self) -> list[JudgedWaypoint]:
        """The waypoints that led the search."""
        if not self.led:
            return []
        if self.request.method == GUIDED:
            return [point for point in self.judged if point.verdict in targets.GUIDING]
        return [point for point in self.judged if not point.verdict.drops]


class Planner:
    """Plans on one map under one set of rules. Immutable, so safe to share between threads."""

    def __init__(
        self,
        grid_map: GridMap,
        rules: GridRules | None = None,
        barrier_map: BarrierMap | None = None,
        keeper: LandmarkKeeper | None = None,
    ) -> None:
        """Take a map.

        `barrier_map`, where the grid comes from one, makes LLM-A* exact on it. `keeper` carries
        the landmarks over from map to map.
        """
        self.grid_map = grid_map
        self.rules = rules or GridRules()
        self.keeper = keeper or LandmarkKeeper()
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

    @cached_property
    def fast_grid(self) -> FastGrid:
        """The grid as our own searches want it."""
        graded = self.rules.cost_multiplier > 0 and _is_graded(self.grid_map, self.rules)
        return FastGrid(
            self.blocked,
            corner_cutting=self.rules.corner_cutting,
            cost=self.grid_map.cells if graded else None,
            cost_multiplier=self.rules.cost_multiplier,
        )

    def prepare(self, *, wait: bool = True) -> Planner:
        """Do the once-a-map work now instead of at the first plan.

        Landmarks are measured in the background; plans made before they are there go without.
        `wait` waits for them.
        """
        _ = self.components, self._waypoint_cells
        self.keeper.update(self.fast_grid)
        if wait:
            self.keeper.wait()
        return self

    def plan(
        self,
        request: PlanRequest,
        stop: NDArray[np.uint8] | None = None,
        on_improvement: Watcher | None = None,
    ) -> Plan:
        """Answer a request. Never raises for what a request, a source or a map may hold.

        Another thread cancels by setting `stop[0] = 1`: the best path so far is the answer, or
        TIMEOUT. `on_improvement` gets each better path of `guided` as it is found, checked as a
        plan's is.
        """
        draft = _Draft(request, time.monotonic() + request.time_limit)
        if stop is not None:
            draft.stop = stop
        refusal = self._refusal(request)
        if refusal is not None:
            return self._failure(draft, *refusal)
        try:
            result = self._search(draft, on_improvement)
        except PathTooLongError as error:
            return self._failure(draft, ResultCode.UNKNOWN, str(error))
        return self._plan(draft, result)

    def _refusal(self, request: PlanRequest) -> tuple[ResultCode, str] | None:
        """Say why a request cannot be searched at all, or None."""
        problem = _problem(request)
        if problem:
            return ResultCode.INVALID_PLANNER, problem
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

    def _query(self, draft: _Draft) -> WaypointQuery | None:
        """Return the question for the source, None where there is none to ask."""
        request = draft.request
        needless = request.method not in WAYPOINT_METHODS or request.start == request.goal
        if request.source is None or needless:
            return None
        time_limit = min(request.source_time_limit, SOURCE_SHARE * draft.time_left)
        return WaypointQuery(
            self.grid_map, request.start, request.goal, time_limit, request.sample
        )

    def _ask(self, draft: _Draft) -> None:
        """Ask the source for waypoints and judge them."""
        query = self._query(draft)
        if query is not None and draft.request.source is not None:
            draft.reply, draft.seconds_source = ask(draft.request.source, query)
            draft.judged = self._judge(draft, draft.reply)

    def _judge(self, draft: _Draft, reply: WaypointReply) -> tuple[JudgedWaypoint, ...]:
        request = draft.request
        if request.method == GUIDED:
            arguments = self.blocked, self.components, request.start, 0
        else:
            edge = targets.PAPER_EDGE
            arguments = self._waypoint_cells, self.components, request.start, edge
        return targets.judge(reply.waypoints, *arguments)

    def _search(self, draft: _Draft, on_improvement: Watcher | None) -> SearchResult:
        if draft.request.method == GUIDED:
            return self._search_guided(draft, on_improvement)
        self._ask(draft)
        request = draft.request
        with _raised_after(draft.time_left, draft.stop), _timed(draft):
            if request.method == EXACT:
                return exact_astar(
                    self.fast_grid,
                    request.start,
                    request.goal,
                    stop=draft.stop,
                    want_expanded=request.want_expanded,
                )
            goals = targets.target_list(draft.judged, request.start, request.goal)[1:]
            options = SearchOptions(
                request.heuristic, request.weight, self.rules.corner_cutting, draft.stop
            )
            return PAPER_METHODS[request.method](
                self.blocked, request.start, request.goal, goals, options
            )

    def _search_guided(self, draft: _Draft, on_improvement: Watcher | None) -> GuidedResult:
        """Search by `guided`, asking for waypoints before or while."""
        request = draft.request
        search = GuidedSearch(
            self.fast_grid,
            request.start,
            request.goal,
            max_suboptimality=request.max_suboptimality,
            landmarks=self.keeper.current(self.fast_grid),
            stop=draft.stop,
        )
        query = self._query(draft) if request.search_while_waiting else None
        asking = None
        if query is not None and request.source is not None:
            asking = Asking(
                request.source,
                query,
                lambda reply: search.guide(_points(self._judge(draft, reply))),
            )
        else:
            self._ask(draft)
            search.guide(_points(draft.judged))
        with _raised_after(draft.time_left, draft.stop), _timed(draft):
            for better in search.improvements(want_expanded=request.want_expanded):
                problem = self.path_problem(better.path, request.start, request.goal)
                if on_improvement is not None and not problem:
                    on_improvement(better)
        result = search.result()
        if asking is not None and request.source is not None:
            draft.reply, draft.seconds_source = asking.close(request.source.name)
            draft.judged = self._judge(draft, draft.reply)
        draft.led = result.guided_operation > 0
        return result

    def _plan(self, draft: _Draft, result: SearchResult) -> Plan:
        """Turn a search's outcome into a plan; only a valid path leaves."""
        request = draft.request
        if len(result.path) == 0 and result.status is SearchStatus.STOPPED:
            message = f'stopped after {result.operation} expansions, short of the goal'
            return self._failure(draft, ResultCode.TIMEOUT, message, result)
        if result.status is SearchStatus.EXHAUSTED:
            message = 'every reachable cell was searched'
            return self._failure(draft, ResultCode.NO_VALID_PATH, message, result)
        problem = self.path_problem(result.path, request.start, request.goal)
        if problem is not None:
            message = f'the path found was withheld: {problem}'
            return self._failure(draft, ResultCode.UNKNOWN, message, result)
        draft.judged = targets.mark_out_of_order(draft.judged, result.path)
        bounded = result if isinstance(result, BoundedResult) else None
        return replace(
            self._failure(draft, ResultCode.NONE, '', result),
            message=_success_message(draft, result),
            path=result.path,
            length=result.length,
            cost=result.length if bounded is None else bounded.cost,
            ratio=float('nan') if bounded is None else bounded.ratio,
            first_operation=result.operation if bounded is None else bounded.first_operation,
            any_angle=self._shorten(result.path) if request.any_angle else None,
        )

    def path_problem(self, path: NDArray[np.int32], start: Cell, goal: Cell) -> str | None:
        """Say what is wrong with a path of cells [n, 2] on this map, under its rules, or None."""
        corner_cutting = self.rules.corner_cutting
        return path_problem(path, self.blocked, start, goal, corner_cutting=corner_cutting)

    def _shorten(self, path: NDArray[np.int32]) -> AnyAnglePath | None:
        """Pull a path taut, or return None where the check does not let the result pass."""
        shortened = shorten(self.fast_grid, path)
        problem = legs_problem(
            shortened.points, self.blocked, corner_cutting=self.rules.corner_cutting
        )
        return shortened if problem is None else None

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
            start=draft.request.start,
            goal=draft.request.goal,
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


def _problem(request: PlanRequest) -> str:
    """Say what about a request no map could make good, or ''."""
    if request.method not in METHODS:
        return f'no method {request.method!r}; there is {", ".join(METHODS)}'
    if request.heuristic not in HEURISTICS:
        return f'no heuristic {request.heuristic!r}; there is {", ".join(HEURISTICS)}'
    bound = request.max_suboptimality
    if bound is not None and not 1.0 <= bound <= MAX_BOUND:
        return f'max_suboptimality {bound} is not in 1 to {MAX_BOUND:g}'
    return ''


def _guided_by(draft: _Draft) -> str:
    return draft.reply.label if draft.used else 'none'


def _points(judged: tuple[JudgedWaypoint, ...]) -> list[Waypoint]:
    """Return the waypoints that may lead `guided`: those a path can be at."""
    return [(point.x, point.y) for point in judged if point.verdict in targets.GUIDING]


def _is_graded(grid_map: GridMap, rules: GridRules) -> bool:
    """Tell whether any cell that is not blocked costs something."""
    cells = grid_map.cells
    return bool(((cells > 0) & (cells < rules.occupied_threshold)).any())


def _success_message(draft: _Draft, result: SearchResult) -> str:
    message = f'{result.length:.2f} cells in {result.operation} expansions'
    if isinstance(result, BoundedResult):
        message += f', proven within {result.ratio:.4f} of the shortest'
    if draft.judged:
        message += f', {len(draft.used)} of {len(draft.judged)} waypoints used'
    if result.status is SearchStatus.STOPPED:
        message += '; stopped before more could be proven'
    if draft.reply.detail:
        message += f'; {draft.reply.detail}'
    return message


@contextmanager
def _timed(draft: _Draft) -> Iterator[None]:
    """Note how long the search takes."""
    begin = time.monotonic()
    try:
        yield
    finally:
        draft.seconds_search = time.monotonic() - begin


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
