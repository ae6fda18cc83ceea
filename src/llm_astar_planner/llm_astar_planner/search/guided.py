# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Guided search: waypoints steer it, plain A* limits its work, and its path carries a bound.

docs/guided-search.md describes the algorithm and proves its bounds. In short: one search follows
the waypoints, an exact A* next to it limits how much work they may cost, and proves how good the
path is.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from llm_astar_planner.search._kernels import astar as plain_kernels
from llm_astar_planner.search._kernels import guided as kernels
from llm_astar_planner.search.arrays import Bools, Float64s, Int64s
from llm_astar_planner.search.astar import (
    EXPANSION_SLICE,
    JumpSearch,
    PathTooLongError,
    PlainSearch,
    SlicedSearch,
    problem_of,
)
from llm_astar_planner.search.borders import Borders, Crossing, is_far
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import NONE_ACTIVE, Landmarks
from llm_astar_planner.search.problem import SearchProblem, search_method
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus, empty_path

if TYPE_CHECKING:
    from llm_astar_planner.search.expansion_order import ExpansionRecorder

# How greedily waypoints are followed: the weight of the cost to go.
WEIGHT = 1.2
# The search along waypoints may always expand so many cells per move that a path needs at least.
# Most good waypoints lead to the goal with fewer, and a plain A* expands one cell per move.
HEAD_START = 2.0
# After that it may expand so many cells per expansion of the plain search, which are cheaper: the
# fewer where neither landmarks nor jump points help. So both take about the same time; what bad
# waypoints cost is measured in docs/performance.md.
WORK_FACTOR = 0.35
WORK_FACTOR_PLAIN = 0.1
# For goals at least FAR moves away the plain search goes first, with PLAIN_FIRST expansions or one
# per move: an easy query is answered before waypoints cost anything.
FAR = 64
PLAIN_FIRST = 1024
# Jump points pay where there are so few, in parts of the cells (docs/guided-search.md).
MOST_JUMP_POINTS = 0.35
# The least suboptimality for which a route over borders is followed: the borders prove no more.
LEAST_OF_ROUTE = 1.06
# How greedily such a route is followed, whose costs are known: at first, after so many expansions
# per move that a path needs at least, after twice as many, and so on; then it is given up.
ROUTE_WEIGHTS = (1.02, 1.06, 1.1, 1.2)
ROUTE_WORK = 32
# Cells that are more than so many targets of a route behind wait until those ahead lead nowhere.
ROUTE_LAG = 1
# A path passes a waypoint that it comes within so many cells of.
PASSING_RADIUS = 3.0
# The fewest expansions of the plain search at a time; later this share of those done.
_MIN_PLAIN_STEP = 4
_PLAIN_SHARE = 4


@dataclass(eq=False)
class GuidedResult(BoundedResult):
    """A bounded result and what its expansions were for.

    `guided_expansions` followed the waypoints or a route over borders, `plain_expansions` are
    those of the plain A*.
    """

    guided_expansions: int = 0
    plain_expansions: int = 0


class GuidedSearch:
    """One search, guided by waypoints that may arrive while it runs.

    `solutions()` runs it and yields each better path; `result()` then returns the outcome.
    `guide(waypoints)` may be called before the run or during it, from any thread, and again;
    without waypoints the search is a plain exact A*, after one along a route where the landmarks
    have `borders` and that is enough. With `max_suboptimality` w >= 1 it ends when the path is
    proven to cost at most w times the optimum, without it at the first path.
    The landmarks of the problem, which must be admissible on the grid, make search and proof
    cheap. It also ends at the problem's deadlines, looked at between slices of the search, and
    when another thread sets `stop[0] = 1`; the expanded cells of a search cancelled that way are
    not returned.
    `weight` is how greedily waypoints are followed; `work_factor` limits the expansions that they
    may cost, as a multiple of those of the search without any (None: as many as take its time).
    A `recorder` notes in which order cells are expanded.
    """

    def __init__(
        self,
        problem: SearchProblem,
        weight: float = WEIGHT,
        work_factor: float | None = None,
        recorder: ExpansionRecorder | None = None,
    ) -> None:
        """Take the query; nothing is searched yet. Raises ValueError for a number out of range."""
        bound = problem.max_suboptimality
        if bound is not None and not 1.0 <= bound <= 1000.0:
            raise ValueError(f'max_suboptimality: {bound} is not in 1 to 1000')
        if not 1.0 <= weight <= 100.0:
            raise ValueError(f'weight: {weight} is not in 1 to 100')
        if work_factor is not None and not 0.0 <= work_factor <= 1000.0:
            raise ValueError(f'work_factor: {work_factor} is not in 0 to 1000')
        grid, landmarks = problem.grid, problem.landmarks
        if landmarks is not None and landmarks.distances.shape[1] != grid.moves.size:
            raise ValueError('landmarks: are of a map of another size')
        self.problem, self.weight, self.work_factor = problem, weight, work_factor
        self.start, self.goal, self.recorder = problem.start, problem.goal, recorder
        # Waypoints that the search has not taken yet, the newest last. Other threads append to it.
        self.inbox = problem.arrivals
        self._result: GuidedResult | None = None

    def guide(self, waypoints: ArrayLike) -> None:
        """Guide the search along waypoints: float [n, 2] grid coordinates (x, y), n >= 0.

        Any values may be given: points that are not finite are dropped, points off the map are
        moved to its border, and too many points are thinned out evenly. They take effect from
        the next slice of the search on, and no more once a path was found. An empty list
        changes nothing. Raises ValueError for an array of another shape.
        """
        points = np.asarray(waypoints, dtype=np.float64)
        if points.size == 0:
            points = points.reshape(0, 2)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f'waypoints: shape {points.shape} is not [n, 2]')
        if len(points):
            self.inbox.append(points)

    def solutions(self) -> Generator[BoundedResult, None, GuidedResult]:
        """Run the search to its end, yield each better path as it is found, return the result.

        Of a better path, storage, expanded cells and the first path's figures are not counted yet.
        Call it once. The caller may close the iterator early; `result` is then of that moment.
        Raises ValueError for a cell off the grid.
        """
        grid, landmarks = self.problem.grid, self.problem.landmarks
        while True:
            self._begin(grid, landmarks)
            try:
                while self._status is None:
                    solution = self._step()
                    if solution is not None:
                        yield solution
                self._result = self._describe()
                return self._result
            except OverflowError:
                # Too long for the fine units: restart in coarse ones, which landmarks are not in.
                if grid.coarse() is grid:
                    message = f'the cost of a path {self.start} to {self.goal} does not fit'
                    raise PathTooLongError(message) from None
                grid, landmarks = grid.coarse(), None
                if self._waypoints is not None:
                    self.inbox.appendleft(self._waypoints)
            except GeneratorExit:
                self._result = self._describe()
                raise
            finally:
                for search in filter(None, (self._plain, self._led, self._along)):
                    search.grid.give_back(search.workspace)

    def result(self) -> GuidedResult:
        """Return what the run found. Raises RuntimeError before it ended."""
        if self._result is None:
            raise RuntimeError('the search has not run to an end')
        return self._result

    def _begin(self, grid: GridGraph, landmarks: Landmarks | None) -> None:
        """Begin on one grid: an exact search and, when there are waypoints, theirs."""
        # Jump points pay for far goals, on uniform costs without corner cutting, unless the map
        # is full of them. They know no rules of the road.
        (x, y), (goal_x, goal_y) = self.start, self.goal
        self._fewest_moves = max(abs(x - goal_x), abs(y - goal_y))
        jumps = self._fewest_moves >= FAR and not (grid.cell_surcharge.size or grid.corner_cutting)
        jumps = jumps and not grid.has_rules
        jumps = jumps and grid.packed.jump_points <= MOST_JUMP_POINTS * grid.moves.size
        exact_search = JumpSearch if jumps else PlainSearch
        self._plain = exact_search(grid, self.start, self.goal, landmarks)
        self._led: WaypointSearch | None = None
        self._waypoints: Float64s | None = None
        self._expansions = self._plain_first = 0
        self._status = self._plain.status
        self._best = self._units = plain_kernels.NO_PATH
        self._solution: BoundedResult | None = None
        self._first = (0, math.inf)
        is_plain = not jumps and not len(self._plain.active)
        measured = WORK_FACTOR_PLAIN if is_plain else WORK_FACTOR
        self._work_factor = measured if self.work_factor is None else self.work_factor
        # Rounded down: the bound reported is never above the one asked for.
        limit = (self.problem.max_suboptimality or 0.0) / grid.rounding * kernels.ONE
        self._limit = math.floor(limit)
        self._along: RouteSearch | None = None
        borders = None if landmarks is None else landmarks.borders
        pays = self._limit >= LEAST_OF_ROUTE * kernels.ONE and not self.inbox
        if borders and pays and self._status is None and is_far(self.start, self.goal):
            most = ROUTE_WORK * self._fewest_moves
            self._along = RouteSearch(self, self._plain, borders, most)

    def _step(self) -> BoundedResult | None:
        """Search one slice; return the path that it found, None if it is not better."""
        problem = self.problem
        deadline = problem.deadline
        if self._best == plain_kernels.NO_PATH:
            deadline = max(deadline, problem.first_path_deadline)
        if problem.stop[0] or time.monotonic() >= deadline:
            self._status = SearchStatus.STOPPED
            return None
        if self.inbox and (self._along is None or self._along.status is not None):
            self._take_waypoints()
        searched, quota = self._next()
        if self.recorder is None:
            searched.advance(quota)
        else:
            self.recorder.advance(searched, quota, self._expansions - searched.expansions)
        self._expansions = self._plain.expansions
        for other in filter(None, (self._led, self._along)):
            self._expansions += other.expansions
        if searched is self._plain:
            self._status = searched.status
        elif searched is self._led and (
            searched.status is SearchStatus.EXHAUSTED
            or (searched.status is SearchStatus.FOUND and problem.max_suboptimality is None)
        ):
            is_known = searched.best < plain_kernels.NO_PATH
            self._status = SearchStatus.FOUND if is_known else SearchStatus.EXHAUSTED
        best, enough = self._plain.best, self._plain.bound * self._limit
        if self._status is None and best < plain_kernels.NO_PATH and best * kernels.ONE <= enough:
            self._status = SearchStatus.FOUND
        return self._take_solution(searched) if searched.best < self._best else None

    def _next(self) -> tuple[PlainSearch | WaypointSearch, int]:
        """Return which search goes on, and how many cells it may expand."""
        plain, led = self._plain, self._led
        if self._along is not None and self._along.status is None:
            return self._along, EXPANSION_SLICE
        if self._waypoints is None or (led is not None and led.status is not None):
            return plain, EXPANSION_SLICE
        if plain.expansions < self._plain_first:
            return plain, self._plain_first - plain.expansions
        if led is None:
            led = self._led = WaypointSearch(self, plain, self.weight)
            led.follow(self._waypoints)
        allowed = max(HEAD_START * self._fewest_moves, self._work_factor * plain.expansions)
        quota = min(int(allowed) - led.expansions, EXPANSION_SLICE)
        if quota > 0:
            return led, quota
        return plain, max(_MIN_PLAIN_STEP, plain.expansions // _PLAIN_SHARE)

    def _take_waypoints(self) -> None:
        """Follow the newest waypoints, unless a path is known: then they count for nothing."""
        points = self.inbox.pop()
        self.inbox.clear()
        if self._best < plain_kernels.NO_PATH:
            return
        self._waypoints = points
        if self._led is not None:
            self._led.follow(points)
            return
        moves, grid = self._fewest_moves, self._plain.grid
        if not grid.cell_surcharge.size:
            moves = max(moves, self._plain.bound // grid.diagonal)
        self._fewest_moves = moves
        self._plain_first = max(moves, PLAIN_FIRST) if moves >= FAR else 0

    def _take_solution(self, searched: PlainSearch | WaypointSearch) -> BoundedResult | None:
        """Note the path that the records now hold and return it, None if it is a worse one.

        A path may cost less than the goal's g, since a cell on it may have improved after g was
        set. So a path that improves on g may still cost more than the path noted before.
        """
        self._best = searched.best
        path, length, units = searched.path()
        proven = self._plain.grid.proven(path, units, self._plain.bound)
        cost = proven[0]
        if self._solution is None:
            self._first = self._expansions, cost
        elif cost > self._solution.cost:
            return None
        nothing = np.zeros((0, 0), dtype=np.bool_)
        self._solution = BoundedResult(
            SearchStatus.STOPPED, self._expansions, 0, nothing, path, length, *proven
        )
        self._units = units
        return self._solution

    def _describe(self) -> GuidedResult:
        """Return what is known now."""
        want_expanded = self.problem.want_expanded
        plain, best = self._plain, self._solution
        searches = [*filter(None, (plain, self._led, self._along))]
        status = SearchStatus.STOPPED if self._status is None else self._status
        expanded = np.zeros(plain.grid.blocked.shape if want_expanded else (0, 0), dtype=np.bool_)
        if want_expanded and not self.problem.stop[0]:
            for search in searches:
                search.add_expanded(expanded)
        costs = math.inf, math.inf, math.inf
        if best is not None:
            costs = plain.grid.proven(best.path, self._units, plain.bound, best.cost)
        elif status is not SearchStatus.EXHAUSTED:
            costs = math.inf, plain.bound / plain.grid.diagonal * math.sqrt(2.0), math.inf
        storage = 0
        for search in searches:
            storage += search.storage
        found = (best.path, best.length) if best else (empty_path(), math.nan)
        return GuidedResult(
            status, self._expansions, storage, expanded, *found, *costs,
            *self._first, self._expansions - plain.expansions, plain.expansions,
        )  # fmt: skip


@search_method(uses_waypoints=True, takes_late_waypoints=True)
def guided_method(problem: SearchProblem) -> Generator[BoundedResult, None, GuidedResult]:
    """Search along the waypoints of a problem, those included that come in meanwhile."""
    if problem.waypoints:
        problem.arrivals.appendleft(np.array(problem.waypoints, dtype=np.float64))
    return GuidedSearch(problem).solutions()


def guided(
    blocked: GridGraph | Bools,
    start: Cell,
    goal: Cell,
    waypoints: ArrayLike,
    **options: Any,  # noqa: ANN401 - fields of a SearchProblem
) -> GuidedResult:
    """Search along `waypoints` to the end.

    The options are those of `GuidedSearch`, the fields of its problem, and those of a `GridGraph`
    where `blocked` is bool [height, width].
    """
    own = {name: options.pop(name) for name in ('weight', 'work_factor') if name in options}
    search = GuidedSearch(problem_of(blocked, start, goal, options), **own)
    search.guide(waypoints)
    deque(search.solutions(), maxlen=0)
    return search.result()


class WaypointSearch(SlicedSearch):
    """The search along waypoints: its records, its queue and its counts.

    It ends when it reaches the goal (FOUND) or cannot find a path cheaper than the best known.
    """

    def __init__(self, query: GuidedSearch, plain: PlainSearch, weight: float) -> None:
        """Search the grid of the plain search, with its estimate; `follow` starts it."""
        super().__init__(plain.grid, query.start, query.goal)
        self._plain, self._active = plain, plain.active
        self._control = np.array([
            self.start, self.goal, self.generation, round(weight * kernels.ONE),
            round(PASSING_RADIUS * plain.grid.straight),
            plain_kernels.EVERY_MOVE if plain.grid.has_rules else plain_kernels.FORWARD,
            kernels.MAX_TARGETS,
            *[0] * (kernels.G_SIZE - kernels.G_FREE),
        ])  # fmt: skip
        self._heads = np.zeros(0, dtype=np.int32)
        self._targets: Int64s = np.empty((0, 4), dtype=np.int64)

    def follow(self, waypoints: Float64s) -> None:
        """Follow new waypoints [n, 2] from here on; see `GuidedSearch.guide`."""
        self.head_for(kernels.make_targets(self._cells, waypoints, self._control))

    def head_for(self, targets: Int64s, *, same: bool = False) -> None:
        """Head for targets [n, 4] from here on, or for the same as before; see the kernel."""
        workspace, plain = self.workspace, self._plain
        self._targets = targets
        self._heads = kernels.follow(
            self._cells, targets, workspace.records, workspace.pool, workspace.keys,
            self._heads, plain.distances, self._active, self._control, same,
        )  # fmt: skip

    def advance(self, quota: int) -> None:
        """Expand up to `quota` cells, looking only for paths cheaper than the plain search's.

        Sets `status` if that ends the search; the plain one then learns what it has found. Raises
        OverflowError.
        """
        workspace, plain, control = self.workspace, self._plain, self._control
        control[kernels.G_BEST] = min(control[kernels.G_BEST], plain.best)
        ended = kernels.advance(
            self._cells, workspace.records, workspace.pool, workspace.keys,
            self._heads, self._targets, plain.distances, self._active, control, quota,
        )  # fmt: skip
        self.best, self.expansions, self.storage = control[kernels.G_BEST :].tolist()
        self.work = self.expansions
        self.note(ended)
        if self.status is not None:
            # An exhausted one proves that no path costs less than the best one known, if any.
            is_exhausted = self.status is SearchStatus.EXHAUSTED
            plain.learn(self.best, self.best if is_exhausted else 0)


class RouteSearch(WaypointSearch):
    """The search along a route over borders; these also prove how good its path is.

    Its status is FOUND at its end, with or without a path.
    """

    def __init__(
        self, query: GuidedSearch, plain: PlainSearch, borders: Borders, most: int
    ) -> None:
        """Search for `plain`, which learns the result; be greedier after `most` expansions."""
        first, *self._weights = ROUTE_WEIGHTS
        super().__init__(query, plain, first)
        crossing = Crossing(borders, plain.grid, query.start, query.goal)
        self._lower_bound, self._most = crossing.lower_bound, most
        # What is left of the route is more than landmarks prove.
        self._active = NONE_ACTIVE
        self._control[kernels.G_LAG] = ROUTE_LAG
        self.head_for(crossing.targets(kernels.MAX_TARGETS))

    def advance(self, quota: int) -> None:
        """Expand up to `quota` cells; see `WaypointSearch.advance`."""
        super().advance(quota)
        if self.status is None and self.expansions >= self._most and self._weights:
            self._most *= 2
            self._control[kernels.G_WEIGHT] = round(self._weights.pop(0) * kernels.ONE)
            self.head_for(self._targets, same=True)
        elif self.status is not None or self.expansions >= self._most:
            self.status = SearchStatus.FOUND
            found = self.best < plain_kernels.NO_PATH
            self._plain.learn(self.best, min(self.best, self._lower_bound) * found)
