"""The planner as one object: a request in, a plan out, whatever happens in between.

The same Planner serves the node, the benchmark, the evaluation of bags and a plain caller.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning import waypoint_filter as targets
from llm_astar_planner.planning.collision_checker import CollisionChecker
from llm_astar_planner.planning.endpoints import (
    Ends,
    PlanningFailure,
    resolve_endpoints,
    via_refusal,
)
from llm_astar_planner.planning.instruction import plan_with_wish
from llm_astar_planner.planning.path_metrics import turns, unknown_length
from llm_astar_planner.planning.path_validator import (
    legs_problem,
    path_problem,
    shift_problem,
    via_problem,
)
from llm_astar_planner.planning.request_check import request_problem
from llm_astar_planner.planning.segment import Leg, Watcher, joined
from llm_astar_planner.planning.types import NOT_ASKED, Plan, PlanRequest, ResultCode
from llm_astar_planner.search.any_angle import AnyAnglePath, string_pull
from llm_astar_planner.search.astar import PathTooLongError
from llm_astar_planner.search.guided import AnytimeSolution
from llm_astar_planner.search.landmarks import LandmarkManager
from llm_astar_planner.search.paper import GUIDED
from llm_astar_planner.search.result import BoundedResult, Cell, SearchResult, SearchStatus
from llm_astar_planner.search.stop import no_stop
from llm_astar_planner.waypoints.source import Waypoint

__all__ = ['NOT_ASKED', 'CostmapConfig', 'Plan', 'PlanRequest', 'Planner']


@dataclass
class _Draft:
    """What is known of a plan while it is being made."""

    request: PlanRequest
    deadline: float
    stop: NDArray[np.uint8]
    ends: Ends
    legs: list[Leg] = field(default_factory=list)
    results: list[SearchResult] = field(default_factory=list)

    @property
    def places(self) -> list[tuple[str, Cell]]:
        """The cells between which the legs run, with their names."""
        via = [(f'via {number}', cell) for number, cell in enumerate(self.request.via, start=1)]
        return [('the start', self.ends.start), *via, ('the goal', self.ends.goal)]


class Planner:
    """Plans on one map under one set of rules. Immutable, so safe to share between threads."""

    def __init__(
        self,
        grid_map: GridMap,
        config: CostmapConfig | None = None,
        barrier_map: BarrierMap | None = None,
        landmarks: LandmarkManager | None = None,
    ) -> None:
        """Take a map.

        `barrier_map`, where the grid comes from one, makes LLM-A* exact on it. `landmarks` carries
        the landmarks over from map to map.
        """
        self.grid_map = grid_map
        self.costmap = Costmap(grid_map, config, barrier_map)
        self.landmarks = landmarks or LandmarkManager()
        self._checker = CollisionChecker(grid_map, self.config)

    @property
    def config(self) -> CostmapConfig:
        """The rules of the costmap."""
        return self.costmap.config

    @classmethod
    def for_barrier_map(cls, barrier_map: BarrierMap) -> Planner:
        """Make a planner under the paper's rules: corners may be cut, its filter is exact."""
        return cls(barrier_map.to_grid(), CostmapConfig(corner_cutting=True), barrier_map)

    def prepare(self, *, wait: bool = True) -> Planner:
        """Do the once-a-map work now instead of at the first plan.

        Landmarks are measured in the background; plans made before they are there go without.
        `wait` waits for them.
        """
        self.costmap.prepare()
        self._checker.prepare()
        self.landmarks.update(self.costmap.grid_graph)
        if wait:
            self.landmarks.wait()
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
        plan's is; none where there are `via` cells, as the legs before the last have no whole
        path. A wish is honoured where it can be and never costs a plan; see `instruction`.
        """
        stop = no_stop() if stop is None else stop
        if request.instruction:
            make = partial(self._answer, stop=stop)
            return plan_with_wish(request, make, self._judge, stop)
        return self._answer(request, stop, on_improvement)

    def _judge(
        self, waypoints: Sequence[Waypoint], start: Cell
    ) -> tuple[targets.CheckedWaypoint, ...]:
        return targets.judge(waypoints, self.costmap.blocked, self.costmap.components, start, 0)

    def _answer(
        self,
        request: PlanRequest,
        stop: NDArray[np.uint8],
        on_improvement: Watcher | None = None,
    ) -> Plan:
        draft = _Draft(
            request,
            time.monotonic() + request.time_limit,
            stop,
            Ends(request.start, request.goal),
        )
        refusal = self._find_ends(draft)
        if refusal is not None:
            return self._failure(draft, *refusal)
        try:
            failure = self._search(draft, on_improvement)
        except PathTooLongError as error:
            return self._failure(draft, ResultCode.UNKNOWN, str(error))
        return failure or self._plan(draft, joined(draft.results))

    def path_problem(self, path: NDArray[np.int32], start: Cell, goal: Cell) -> str | None:
        """Say what is wrong with a path of cells [n, 2] on this map, under its rules, or None.

        The robot's body is considered, apart from the inflation that the searches work on.
        """
        ground, corner_cutting = self._checker, self.config.corner_cutting
        return path_problem(path, ground, start, goal, corner_cutting=corner_cutting)

    def legs_problem(self, points: NDArray[np.int32]) -> str | None:
        """Say what is wrong with straight legs between cells [n, 2], as `path_problem` does."""
        ground, corner_cutting = self._checker, self.config.corner_cutting
        return legs_problem(points, ground, corner_cutting=corner_cutting)

    def _find_ends(self, draft: _Draft) -> PlanningFailure | None:
        """Settle where to plan from and to, or say why a request cannot be searched at all."""
        request = draft.request
        problem = request_problem(request)
        if problem:
            return PlanningFailure(ResultCode.INVALID_PLANNER, problem)
        ends = resolve_endpoints(self.costmap, request)
        if isinstance(ends, PlanningFailure):
            return ends
        draft.ends = ends
        return via_refusal(self.costmap, request.via, ends.start)

    def _search(self, draft: _Draft, on_improvement: Watcher | None) -> Plan | None:
        """Search leg by leg; return a failure, or None where every leg has a path.

        The deadline is one for all: of the time left a leg may take its share, half of it in
        equal parts and half by straight length.
        """
        places = draft.places
        lengths = [math.dist(start, goal) for (_, start), (_, goal) in pairwise(places)]
        parts = [1.0 + length + sum(lengths) / len(lengths) for length in lengths]
        for number, ((_, start), (_, goal)) in enumerate(pairwise(places)):
            leg = self._leg(draft, start, goal, parts[number] / sum(parts[number:]))
            draft.legs.append(leg)
            draft.results.append(leg.search(self._watcher(draft, on_improvement)))
            if _failed(draft.results[-1]):
                return self._without_path(draft, places[number : number + 2])
        return None

    def _leg(self, draft: _Draft, start: Cell, goal: Cell, share: float) -> Leg:
        """Return a leg; where there are several, the via cells are the waypoints: none asked."""
        request, now = draft.request, time.monotonic()
        guided = request.method == GUIDED
        return Leg(
            self.costmap,
            replace(
                request,
                start=start,
                goal=goal,
                source=None if request.via else request.source,
            ),
            now + share * (draft.deadline - now),
            draft.stop,
            self.landmarks.current(self.costmap.grid_graph) if guided else None,
        )

    def _watcher(self, draft: _Draft, on_improvement: Watcher | None) -> Watcher | None:
        if on_improvement is None or draft.request.via:
            return None

        def watch(better: AnytimeSolution) -> None:
            if self._problem(draft, better.path) is None:
                on_improvement(better)

        return watch

    def _problem(self, draft: _Draft, path: NDArray[np.int32]) -> str | None:
        """Say why a path does not answer the request, or None: the last check."""
        request, ends, resolution = draft.request, draft.ends, self.grid_map.resolution
        return (
            shift_problem('start', request.start, ends.start, request.start_tolerance / resolution)
            or shift_problem('goal', request.goal, ends.goal, request.tolerance / resolution)
            or self.path_problem(path, ends.start, ends.goal)
            or via_problem(path, request.via)
        )

    def _without_path(self, draft: _Draft, places: Sequence[tuple[str, Cell]]) -> Plan:
        """Say how the last leg searched, between these places, came to no path."""
        result = draft.results[-1]
        expansions = sum(one.expansions for one in draft.results)
        code, message = ResultCode.NO_VALID_PATH, 'every reachable cell was searched'
        if result.status is SearchStatus.STOPPED:
            code = ResultCode.TIMEOUT
            why = 'cancelled' if draft.stop[0] else 'out of time'
            message = f'{why} after {expansions} expansions, short of the goal'
        if draft.request.via:
            (start, _), (goal, _) = places
            message += f', from {start} to {goal}'
        storage = sum(one.storage for one in draft.results)
        whole = replace(result, expansions=expansions, storage=storage)
        return self._failure(draft, code, message, whole)

    def _plan(self, draft: _Draft, result: SearchResult) -> Plan:
        """Turn a search's outcome into a plan; only a valid path leaves."""
        problem = self._problem(draft, result.path)
        if problem is not None:
            message = f'the path found was withheld: {problem}'
            return self._failure(draft, ResultCode.UNKNOWN, message, result)
        leg = draft.legs[0]
        leg.judged = targets.mark_out_of_order(leg.judged, result.path)
        bounded = result if isinstance(result, BoundedResult) else None
        resolution = self.grid_map.resolution
        return replace(
            self._failure(draft, ResultCode.NONE, _success_message(leg, result), result),
            path=result.path,
            length=result.length,
            cost=result.length if bounded is None else bounded.cost,
            suboptimality_bound=float('nan') if bounded is None else bounded.suboptimality_bound,
            first_expansions=result.expansions if bounded is None else bounded.first_expansions,
            any_angle=self._shorten(draft) if draft.request.any_angle else None,
            unknown_length=unknown_length(result.path, self.grid_map),
            clearance=float(self._checker.distances(result.path).min()) * resolution,
            turns=turns(result.path),
        )

    def _shorten(self, draft: _Draft) -> AnyAnglePath | None:
        """Pull each leg taut, or return None where the check does not let the result pass."""
        legs = [string_pull(self.costmap.grid_graph, result.path) for result in draft.results]
        points = np.concatenate([legs[0].points, *(leg.points[1:] for leg in legs[1:])])
        if self.legs_problem(points) is not None:
            return None
        return AnyAnglePath(points, sum(leg.length for leg in legs), sum(leg.cost for leg in legs))

    def _failure(
        self,
        draft: _Draft,
        code: ResultCode,
        message: str,
        result: SearchResult | None = None,
    ) -> Plan:
        """Build a plan without a path."""
        cells, source, ends = self.grid_map.cells, draft.request.source, draft.ends
        leg = draft.legs[0] if draft.legs else None
        return Plan(
            code=code,
            message=message,
            method=draft.request.method,
            start=ends.start,
            goal=ends.goal,
            path=np.empty((0, 2), dtype=np.int32),
            expanded=np.zeros(cells.shape, dtype=bool) if result is None else result.expanded,
            waypoints=leg.judged if leg else (),
            guided_by=leg.reply.label if leg and leg.used else 'none',
            source='none' if source is None else source.name,
            reply=leg.reply if leg else NOT_ASKED,
            expansions=0 if result is None else result.expansions,
            storage=0 if result is None else result.storage,
            seconds_source=sum(leg.seconds_source for leg in draft.legs),
            seconds_search=sum(leg.seconds_search for leg in draft.legs),
            start_shift=ends.start_shift,
            goal_shift=ends.goal_shift,
            warnings=ends.warnings,
            via=draft.request.via,
        )


def _failed(result: SearchResult) -> bool:
    """Tell whether a search says itself that it has no path."""
    if result.status is SearchStatus.STOPPED:
        return len(result.path) == 0
    return result.status is SearchStatus.EXHAUSTED


def _success_message(leg: Leg, result: SearchResult) -> str:
    message = f'{result.length:.2f} cells in {result.expansions} expansions'
    if isinstance(result, BoundedResult):
        message += f', proven within {result.suboptimality_bound:.4f} of the shortest'
    if leg.judged:
        message += f', {len(leg.used)} of {len(leg.judged)} waypoints used'
    if result.status is SearchStatus.STOPPED:
        message += '; stopped before more could be proven'
    if leg.reply.detail:
        message += f'; {leg.reply.detail}'
    return message
