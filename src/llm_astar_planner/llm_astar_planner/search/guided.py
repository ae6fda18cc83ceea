"""Guided search: waypoints steer it, plain A* limits its work, and its path carries a bound.

docs/guided-search.md describes the algorithm and proves its bounds. In short: one search follows
the waypoints, a plain A* next to it limits how much work they may cost, and the open cells of
both prove a lower bound on the cost of any path.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import astar as plain_kernels
from llm_astar_planner.search._kernels import guided as kernels
from llm_astar_planner.search.astar import PathTooLongError
from llm_astar_planner.search.grid_graph import GridGraph, as_grid, path_length, path_units
from llm_astar_planner.search.landmarks import NO_DISTANCES, NONE_ACTIVE, Landmarks
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus, empty_path
from llm_astar_planner.search.stop import StopFlag, no_stop

# How greedily waypoints are followed: the weight of the cost to go.
WEIGHT = 1.2
# The expansions that waypoints may cost, as a multiple of those surely needed without any.
WORK_FACTOR = 2.0
# A path passes a waypoint that it comes within so many cells of.
PASSING_RADIUS = 3.0
# Expansions between two looks at the stop flag and at new waypoints.
EXPANSION_SLICE = 4096
_BUCKETS = 2048
# The fewest expansions of plain A* at a time; later an eighth of those done.
_MIN_PLAIN_STEP = 4


@dataclass(frozen=True, eq=False)
class GuidedResult(BoundedResult):
    """A bounded result and what its expansions were for.

    `guided_expansions` followed the waypoints, `proof_expansions` proved the path found that
    way, `plain_expansions` are those of the plain A*.
    """

    guided_expansions: int = 0
    proof_expansions: int = 0
    plain_expansions: int = 0


@dataclass(frozen=True, eq=False)
class AnytimeSolution(BoundedResult):
    """A better path, found while the search goes on: its result if it were stopped here.

    Storage, expanded cells and the first path's figures are not counted yet.
    """


class GuidedSearch:
    """One search, guided by waypoints that may arrive while it runs.

    `solutions()` runs it and yields each better path; `result()` then returns the outcome.
    `guide(waypoints)` may be called before the run or during it, from any thread, and again;
    without waypoints the search is a plain exact A*. With `max_suboptimality` w >= 1 it ends
    when the path is proven to cost at most w times the optimum, without it at the first path.
    `landmarks`, which must be admissible on the grid, make search and proof cheap. It also ends
    at `deadline` (monotonic seconds, looked at between slices of the search) and when another
    thread sets `stop[0] = 1`; the expanded cells of a search cancelled that way are not returned.
    `weight` is how greedily waypoints are followed; `work_factor` limits the expansions that they
    may cost, as a multiple of those surely needed without any.
    """

    def __init__(
        self,
        blocked: GridGraph | NDArray[np.bool_],
        start: Cell,
        goal: Cell,
        *,
        corner_cutting: bool = False,
        max_suboptimality: float | None = None,
        landmarks: Landmarks | None = None,
        stop: StopFlag | None = None,
        deadline: float = math.inf,
        weight: float = WEIGHT,
        work_factor: float = WORK_FACTOR,
    ) -> None:
        """Take the query; nothing is searched yet.

        Raises ValueError for a cell off the grid and a number out of its range.
        """
        if max_suboptimality is not None and not 1.0 <= max_suboptimality <= 1000.0:
            raise ValueError(f'max_suboptimality: {max_suboptimality} is not in 1 to 1000')
        if not 1.0 <= weight <= 100.0:
            raise ValueError(f'weight: {weight} is not in 1 to 100')
        if not 0.0 <= work_factor <= 1000.0:
            raise ValueError(f'work_factor: {work_factor} is not in 0 to 1000')
        self._grid = as_grid(blocked, corner_cutting=corner_cutting)
        self._grid.index(start)
        self._grid.index(goal)
        if landmarks is not None and landmarks.distances.shape[1] != self._grid.moves.size:
            raise ValueError('landmarks: are of a map of another size')
        self._landmarks = landmarks
        stop = no_stop() if stop is None else stop
        self._query = _Query(start, goal, max_suboptimality, stop, deadline, weight, work_factor)
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
        self._query.inbox.append(points)

    def solutions(
        self, *, want_expanded: bool = False
    ) -> Generator[AnytimeSolution, None, GuidedResult]:
        """Run the search to its end, yield each better path as it is found, return the result.

        Call it once. The caller may close the iterator early; `result` is then of that moment.
        """
        grid, landmarks = self._grid, self._landmarks
        while True:
            run = _Run(self._query, grid, landmarks)
            try:
                yield from run.solutions()
                self._result = run.result(want_expanded=want_expanded)
                return self._result
            except OverflowError:
                # Too long for the fine units: restart in coarse ones, which landmarks are not in.
                if grid.coarse() is grid:
                    query = self._query
                    message = f'the cost of a path {query.start} to {query.goal} does not fit'
                    raise PathTooLongError(message) from None
                grid, landmarks = grid.coarse(), None
                if run.waypoints is not None:
                    self._query.inbox.appendleft(run.waypoints)
            except GeneratorExit:
                self._result = run.result(want_expanded=want_expanded)
                raise
            finally:
                for one in run.searches:
                    run.grid.give_back(one.workspace)

    def result(self) -> GuidedResult:
        """Return what the run found. Raises RuntimeError before it ended."""
        if self._result is None:
            raise RuntimeError('the search has not run to an end')
        return self._result


def guided(
    blocked: GridGraph | NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    waypoints: ArrayLike,
    *,
    corner_cutting: bool = False,
    max_suboptimality: float | None = None,
    landmarks: Landmarks | None = None,
    stop: StopFlag | None = None,
    weight: float = WEIGHT,
    work_factor: float = WORK_FACTOR,
    want_expanded: bool = True,
) -> GuidedResult:
    """Search along `waypoints` to the end; the other parameters are those of `GuidedSearch`."""
    search = GuidedSearch(
        blocked,
        start,
        goal,
        corner_cutting=corner_cutting,
        max_suboptimality=max_suboptimality,
        landmarks=landmarks,
        stop=stop,
        weight=weight,
        work_factor=work_factor,
    )
    search.guide(waypoints)
    for _ in search.solutions(want_expanded=want_expanded):
        pass
    return search.result()


@dataclass(frozen=True, eq=False)
class _Query:
    """What a search was asked for: the parameters of `GuidedSearch` and its waypoints."""

    start: Cell
    goal: Cell
    max_suboptimality: float | None
    stop: StopFlag
    deadline: float
    weight: float
    work_factor: float
    # Waypoints that the search has not taken yet, the newest last. Other threads append to it.
    inbox: deque[NDArray[np.float64]] = field(default_factory=deque)


class _Search:
    """One of a run's two searches: its records, its queue and its counts.

    While `proving` it is an A* by g + h without a work limit, else it follows the targets.
    """

    def __init__(
        self,
        query: _Query,
        grid: GridGraph,
        landmark_distances: NDArray[np.int32],
        active: NDArray[np.int64],
        *,
        proving: bool,
    ) -> None:
        self.workspace = grid.borrow()
        self._grid, self._active = grid, active
        self._landmark_distances = landmark_distances
        self.control = control = np.zeros(kernels.G_SIZE, dtype=np.int64)
        control[kernels.G_START], control[kernels.G_GOAL] = map(
            grid.index, (query.start, query.goal)
        )
        control[kernels.G_GENERATION] = self.workspace.next_generation()
        control[kernels.G_STRAIGHT], control[kernels.G_DIAGONAL] = grid.straight, grid.diagonal
        control[kernels.G_WIDTH] = grid.width
        control[kernels.G_SHIFT] = plain_kernels.BUCKET_BITS
        control[kernels.G_PROVING] = proving
        control[kernels.G_WEIGHT] = round(query.weight * kernels.ONE)
        control[kernels.G_RADIUS] = round(PASSING_RADIUS * grid.straight)
        work_factor = round(query.work_factor * kernels.ONE)
        control[kernels.G_WORK_FACTOR] = kernels.UNBOUNDED if proving else work_factor
        if query.max_suboptimality is not None:
            # Rounded down: the bound reported is never above the one asked for.
            bound = math.floor(query.max_suboptimality * kernels.ONE)
            control[kernels.G_SUBOPTIMALITY] = bound
        self._heads = np.zeros(_BUCKETS + 1, dtype=np.int32)
        self._keys: NDArray[np.int64] = np.empty(self.workspace.pool.size, dtype=np.int64)
        self._targets: NDArray[np.int64] = np.empty((0, 3), dtype=np.int64)
        kernels.begin(
            self.workspace.records, self.workspace.pool, self._keys, self._heads,
            grid.cell_surcharge.size > 0, landmark_distances, active, control,
        )  # fmt: skip
        self.best, self.bound, self.expansions = int(control[kernels.G_BEST]), 0, 0

    def learn(self, best: int, bound: int, plain_expansions: int = 0) -> None:
        """Take over what the other search knows: its best cost, its bound, its expansions."""
        control = self.control
        control[kernels.G_BEST] = min(control[kernels.G_BEST], best)
        control[kernels.G_BOUND] = max(control[kernels.G_BOUND], bound)
        control[kernels.G_LEAST] = max(control[kernels.G_LEAST], plain_expansions)
        self.best, self.bound = int(control[kernels.G_BEST]), int(control[kernels.G_BOUND])

    def advance(self, quota: int, stop: StopFlag) -> int:
        """Expand up to `quota` cells; return how that ended, after making room if needed.

        When a path is found, the lower bound becomes what the open cells prove.
        """
        workspace, control = self.workspace, self.control
        ended = int(kernels.advance(
            self._grid.moves, self._grid.cell_surcharge,
            workspace.records, workspace.pool, self._keys, self._heads, self._targets,
            self._landmark_distances, self._active, control, quota, stop,
        ))  # fmt: skip
        if ended == plain_kernels.NEED_SPACE:
            workspace.grow_pool()
            self._keys = np.concatenate((self._keys, np.empty_like(self._keys)))
            ended = plain_kernels.RUNNING
        elif ended == plain_kernels.FOUND and not control[kernels.G_PROVING]:
            kernels.raise_bound(
                workspace.records, workspace.pool, self._heads,
                self._landmark_distances, self._active, control,
            )  # fmt: skip
        self.best, self.bound = int(control[kernels.G_BEST]), int(control[kernels.G_BOUND])
        self.expansions = int(control[kernels.G_GUIDED] + control[kernels.G_PROOF])
        return ended

    def rekey(self, targets: NDArray[np.int64] | None, span: float = 0.0) -> None:
        """Follow new targets from here on; None: prove the best path, by g + h.

        `targets` is int64 [n, 3], see `make_targets`. The window of the queue covers a `span` of
        keys; keys beyond it only take more time.
        """
        shift = plain_kernels.BUCKET_BITS
        while _BUCKETS << shift < span:
            shift += 1
        if targets is not None:
            self._targets = targets
        kernels.rekey(
            self.workspace.records, self.workspace.pool, self._keys, self._heads, self._targets,
            self._landmark_distances, self._active, targets is None, shift, self.control,
        )  # fmt: skip


class _Run:
    """One run of a guided search on one grid: the waypoint search and the plain A* next to it."""

    def __init__(self, query: _Query, grid: GridGraph, landmarks: Landmarks | None) -> None:
        self.query = query
        self.grid = grid
        self.waypoints: NDArray[np.float64] | None = None
        self.status: SearchStatus | None = None
        self.landmarks = NO_DISTANCES, NONE_ACTIVE
        if landmarks is not None:
            active = landmarks.active(grid, query.start, query.goal)
            if active is None:
                self.status = SearchStatus.EXHAUSTED
            else:
                self.landmarks = landmarks.distances, active
        (x, y), (goal_x, goal_y) = query.start, query.goal
        enclosed = query.start != query.goal and not grid.moves[grid.index(query.goal)]
        if enclosed or grid.blocked[y, x] or grid.blocked[goal_y, goal_x]:
            self.status = SearchStatus.EXHAUSTED
        self.waypoint_search = _Search(query, grid, *self.landmarks, proving=False)
        # The search along waypoints and, once it is needed, the plain A*.
        self.searches = [self.waypoint_search]
        self.best_search = self.waypoint_search
        self.best_solution: AnytimeSolution | None = None
        self.plain_expansions = 0
        self.first_expansions = 0
        self.first_cost = math.inf

    def solutions(self) -> Iterator[AnytimeSolution]:
        """Search to the end; yield each better path."""
        while self.status is None:
            before = self.waypoint_search.best
            if before == 0:  # the start is the goal
                self.status = SearchStatus.FOUND
                before = plain_kernels.NO_PATH
            elif self.query.stop[0] or time.monotonic() >= self.query.deadline:
                self.status = SearchStatus.STOPPED
            else:
                self.step()
            if self.waypoint_search.best < before:
                solution = self.take_solution()
                if solution is not None:
                    yield solution

    def step(self) -> None:
        """Search one slice; set the status if that ends the search."""
        search, points = self.waypoint_search, None
        while self.query.inbox:
            points = self.query.inbox.popleft()
        # Waypoints count for nothing once a path is known.
        if points is not None and len(points) and search.best == plain_kernels.NO_PATH:
            self.waypoints = points
            targets = make_targets(self.grid, points, self.query.start, self.query.goal)
            # The keys of the queue: from the bound to half as much again as the way along these.
            way = 1.5 * self.query.weight * float(targets[:, 2].max(initial=0))
            search.rekey(targets, way + 64.0 * self.grid.straight)
        if self.waypoints is None:
            self.step_plain(EXPANSION_SLICE)
            return
        before = search.best
        ended = search.advance(EXPANSION_SLICE, self.query.stop)
        if search.best < before:
            self.best_search = search
        if ended == plain_kernels.FOUND:
            if self.query.max_suboptimality is None or kernels.is_met(search.control):
                self.status = SearchStatus.FOUND
            else:
                search.rekey(None)
        elif ended == kernels.WORK_LIMIT:
            self.step_plain(max(_MIN_PLAIN_STEP, self.plain_expansions // 8))
        else:
            self.end(ended)

    def step_plain(self, quota: int) -> None:
        """Let the plain A* expand `quota` cells, which also raises the work limit."""
        if len(self.searches) == 1:
            self.searches.append(_Search(self.query, self.grid, *self.landmarks, proving=True))
        search, plain = self.searches
        plain.learn(search.best, 0)  # prunes the plain A* too
        ended = plain.advance(quota, self.query.stop)
        if plain.best < search.best:
            self.best_search = plain
        self.plain_expansions = plain.expansions
        search.learn(plain.best, plain.bound, plain.expansions)
        if ended == plain_kernels.FOUND or kernels.is_met(search.control):
            self.status = SearchStatus.FOUND
        else:
            self.end(ended)

    def end(self, ended: int) -> None:
        """Set the status if a kernel code ends the search. Raises OverflowError."""
        if ended == plain_kernels.OVERFLOW:
            raise OverflowError
        if ended == plain_kernels.STOPPED:
            self.status = SearchStatus.STOPPED
        elif ended == plain_kernels.EXHAUSTED:
            found = self.waypoint_search.best < plain_kernels.NO_PATH
            self.status = SearchStatus.FOUND if found else SearchStatus.EXHAUSTED

    def take_solution(self) -> AnytimeSolution | None:
        """Note the path that the records now hold and return it, None if it is a worse one.

        A path may cost less than the goal's g, since a cell on it may have improved after g was
        set. So a path that improves on g may still cost more than the path noted before.
        """
        endpoints = map(self.grid.index, (self.query.start, self.query.goal))
        path = self.best_search.workspace.trace(self.grid.width, *endpoints)
        cost, lower_bound, suboptimality_bound = self.costs(path)
        expansions = self.waypoint_search.expansions + self.plain_expansions
        if self.best_solution is None:
            self.first_expansions, self.first_cost = expansions, cost
        elif cost > self.best_solution.cost:
            return None
        self.best_solution = AnytimeSolution(
            SearchStatus.STOPPED,
            expansions,
            0,
            np.zeros((0, 0), dtype=np.bool_),
            path,
            path_length(path),
            cost,
            lower_bound,
            suboptimality_bound,
        )
        return self.best_solution

    def costs(self, path: NDArray[np.int32]) -> tuple[float, float, float]:
        """Return the cost of a path and the lower bound, in cells, and their proven ratio."""
        units, bound = path_units(self.grid, path), self.waypoint_search.bound
        proven = max(1.0, units / bound) if bound > 0 else 1.0
        return units / self.grid.straight, min(bound, units) / self.grid.straight, proven

    def result(self, *, want_expanded: bool) -> GuidedResult:
        """Return what is known now."""
        grid, control = self.grid, self.waypoint_search.control
        status = SearchStatus.STOPPED if self.status is None else self.status
        expanded = np.zeros(grid.blocked.shape if want_expanded else (0, 0), dtype=np.bool_)
        storage = 0
        for search in self.searches:
            storage += int(search.control[kernels.G_STORAGE])
            if want_expanded and not self.query.stop[0]:
                workspace = search.workspace
                plain_kernels.add_expanded(workspace.records, workspace.generation, expanded)
        best, length = self.best_solution, math.nan
        cost, lower_bound, suboptimality_bound = math.inf, math.inf, math.inf
        if best is not None:
            length = best.length
            cost, lower_bound, suboptimality_bound = self.costs(best.path)
        elif status is not SearchStatus.EXHAUSTED:
            lower_bound = self.waypoint_search.bound / grid.straight
        return GuidedResult(
            status,
            self.waypoint_search.expansions + self.plain_expansions,
            storage,
            expanded,
            empty_path() if best is None else best.path,
            length,
            cost,
            lower_bound,
            suboptimality_bound,
            self.first_expansions,
            self.first_cost,
            int(control[kernels.G_GUIDED]),
            int(control[kernels.G_PROOF]),
            self.plain_expansions,
        )


def make_targets(
    grid: GridGraph, points: NDArray[np.float64], start: Cell, goal: Cell
) -> NDArray[np.int64]:
    """Turn waypoints into targets: int64 [n, 3], x, y and units from there to the goal."""
    finite = points[np.isfinite(points).all(axis=1)]
    border = (grid.width - 1, grid.height - 1)
    cells = np.clip(np.rint(finite), 0, border).astype(np.int64)
    cells = np.concatenate(([start], cells, [goal])).astype(np.int64)
    moved = (np.diff(cells, axis=0) != 0).any(axis=1)
    cells = cells[1:][moved] if moved.any() else cells[-1:]
    if len(cells) > kernels.MAX_TARGETS:
        kept = np.linspace(0, len(cells) - 1, kernels.MAX_TARGETS).round().astype(np.int64)
        cells = cells[kept]
    delta = np.abs(np.diff(cells, axis=0))
    segments = grid.straight * delta.max(axis=1, initial=0)
    segments += (grid.diagonal - grid.straight) * delta.min(axis=1, initial=2**40)
    rest = np.concatenate((segments[::-1].cumsum()[::-1], [0]))
    return np.ascontiguousarray(np.column_stack((cells, rest)), dtype=np.int64)
