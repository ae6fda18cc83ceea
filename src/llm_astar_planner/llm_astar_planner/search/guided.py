"""The guided search: waypoints steer it, A* backs it, and what it returns carries a bound.

docs/guided-search.md tells what it does and proves its bounds.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import astar as plain_kernels
from llm_astar_planner.search._kernels import guided as kernels
from llm_astar_planner.search.any_angle import can_see, shorten
from llm_astar_planner.search.grid_graph import (
    BoundedResult,
    GridGraph,
    PathTooLongError,
    as_grid,
    exact_astar,
    path_length,
    path_units,
)
from llm_astar_planner.search.landmarks import NO_MARKS, NONE_ACTIVE, Landmarks
from llm_astar_planner.search.result import STOP_CANCELLED, Cell, SearchStatus

# How greedily the waypoints are followed: the weight of the way still to go.
WEIGHT = 1.2
# The expansions that waypoints may cost, as a part of those the search surely needs without any.
SLACK = 2.0
# Within how many cells a waypoint counts as met.
RADIUS = 3.0
# Expansions between two looks at the clock and at new waypoints.
SLICE = 4096
_BUCKETS = 2048
# The least plain A* expansions at a time; later an eighth of those done.
_PLAIN_STEP = 4


@dataclass(frozen=True, eq=False)
class GuidedResult(BoundedResult):
    """A bounded result with where its expansions went: led by waypoints, proof, plain A*."""

    guided_expansions: int = 0
    proof_expansions: int = 0
    plain_expansions: int = 0


@dataclass(frozen=True, eq=False)
class AnytimeSolution:
    """A better path while the search goes on.

    `path` is int32 [n, 2], `cost` and `lower_bound` are in cells, `suboptimality_bound` = cost /
    lower_bound is proven, `expansions` counts the expansions so far.
    """

    path: NDArray[np.int32]
    cost: float
    lower_bound: float
    suboptimality_bound: float
    expansions: int


class GuidedSearch:
    """One search, led by waypoints that may come while it runs.

    `improvements()` runs it and yields each better path; `result()` then tells what it found.
    `guide(waypoints)` may be called before the run or during it, from any thread, and again;
    without waypoints the search is a plain exact A*. With `max_suboptimality` w >= 1 it ends
    when the path is proven within w of the optimum, without it at the first path. `landmarks`,
    which must hold on the grid, make search and proof cheap. `weight` is how greedily waypoints
    are followed, `slack` how much work they may cost, as a part of the search's without any.
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
        stop: NDArray[np.uint8] | None = None,
        weight: float = WEIGHT,
        slack: float = SLACK,
    ) -> None:
        """Take the query; nothing is searched yet.

        Raises ValueError for a cell off the grid and a number out of its range.
        """
        if max_suboptimality is not None and not 1.0 <= max_suboptimality <= 1000.0:
            raise ValueError(f'max_suboptimality: {max_suboptimality} is not in 1 to 1000')
        if not 1.0 <= weight <= 100.0:
            raise ValueError(f'weight: {weight} is not in 1 to 100')
        if not 0.0 <= slack <= 1000.0:
            raise ValueError(f'slack: {slack} is not in 0 to 1000')
        self._grid = as_grid(blocked, corner_cutting=corner_cutting)
        if landmarks is not None and len(landmarks.marks) != self._grid.moves.size:
            raise ValueError('landmarks: are of a map of another size')
        self._start, self._goal = start, goal
        self._max_suboptimality = max_suboptimality
        self._landmarks = landmarks
        self._stop = np.zeros(1, dtype=np.uint8) if stop is None else stop
        self._weight, self._slack = weight, slack
        self._grid.index(start)
        self._grid.index(goal)
        self._lock = threading.Lock()
        self._pending: NDArray[np.float64] | None = None
        self._run: _Run | None = None
        self._result: GuidedResult | None = None

    def guide(self, waypoints: ArrayLike) -> None:
        """Lead the search along waypoints: float [n, 2] grid coordinates (x, y), n >= 0.

        Any values may be given: what is not finite is dropped, what is off the map is moved
        to its border, and more than the search can count are thinned out evenly. They count
        from the next slice of the search on, and for nothing once a path was found. An empty
        list changes nothing.
        Raises ValueError for an array of another shape.
        """
        points = np.asarray(waypoints, dtype=np.float64)
        if points.size == 0:
            points = points.reshape(0, 2)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f'waypoints: shape {points.shape} is not [n, 2]')
        with self._lock:
            self._pending = points

    def improvements(self, *, want_expanded: bool = False) -> Iterator[AnytimeSolution]:
        """Run the search to its end and yield each better path as it is found.

        Call it once. A caller may drop the iterator early; `result` then is of that moment.
        """
        grid, landmarks = self._grid, self._landmarks
        while True:
            run = _Run(self, grid, landmarks)
            try:
                yield from run.search()
                self._result = run.result(want_expanded=want_expanded)
                return
            except OverflowError:
                # Too long for the fine units: begin again in coarse ones, landmarks being fine.
                if grid.coarse() is grid:
                    message = f'the cost of a path {self._start} to {self._goal} does not fit'
                    raise PathTooLongError(message) from None
                grid, landmarks = grid.coarse(), None
                self._restore(run)
            except GeneratorExit:
                self._result = run.result(want_expanded=want_expanded)
                raise
            finally:
                run.close()

    def result(self) -> GuidedResult:
        """Return what the run found. Raises RuntimeError before it ended."""
        if self._result is None:
            raise RuntimeError('the search has not run to an end')
        return self._result

    def _take_pending(self) -> NDArray[np.float64] | None:
        with self._lock:
            points, self._pending = self._pending, None
        return points

    def _restore(self, run: _Run) -> None:
        with self._lock:
            if self._pending is None:
                self._pending = run.waypoints


def guided(
    blocked: GridGraph | NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    waypoints: ArrayLike,
    *,
    corner_cutting: bool = False,
    max_suboptimality: float | None = None,
    landmarks: Landmarks | None = None,
    stop: NDArray[np.uint8] | None = None,
    weight: float = WEIGHT,
    slack: float = SLACK,
    want_expanded: bool = True,
) -> GuidedResult:
    """Search along `waypoints` to the end; see `GuidedSearch` for the rest of the parameters."""
    search = GuidedSearch(
        blocked,
        start,
        goal,
        corner_cutting=corner_cutting,
        max_suboptimality=max_suboptimality,
        landmarks=landmarks,
        stop=stop,
        weight=weight,
        slack=slack,
    )
    search.guide(waypoints)
    for _ in search.improvements(want_expanded=want_expanded):
        pass
    return search.result()


def warm_up() -> None:
    """Compile, or load from the cache, all that a plan needs."""
    # A wall between start and goal: its proof takes every kernel, with and without landmarks.
    blocked = np.zeros((24, 24), dtype=np.bool_)
    blocked[4:, 12] = True
    start, goal = (2, 20), (21, 20)
    for cost in (None, np.ones(blocked.shape)):
        grid = GridGraph(blocked, cost=cost)
        for landmarks in (Landmarks.build(grid), None):
            for wanted in (None, 1.0):
                guided(
                    grid, start, goal, [[2.0, 2.0]], max_suboptimality=wanted, landmarks=landmarks
                )
        guided(grid, start, goal, [[2.0, 2.0]], slack=0.0)
        result = exact_astar(grid, start, goal)
        can_see(grid, start, goal)
        shorten(grid, result.path)


class _Search:
    """One of a run's two searches: its records, its queue, its counts."""

    def __init__(
        self,
        grid: GridGraph,
        ends: tuple[int, int],
        marks: NDArray[np.int32],
        active: NDArray[np.int64],
    ) -> None:
        self.workspace = grid.borrow()
        self._grid, self._marks, self._active = grid, marks, active
        self.control = control = np.zeros(kernels.G_SIZE, dtype=np.int64)
        control[kernels.G_START], control[kernels.G_GOAL] = ends
        control[kernels.G_GENERATION] = self.workspace.next_generation()
        control[kernels.G_STRAIGHT], control[kernels.G_DIAGONAL] = grid.straight, grid.diagonal
        control[kernels.G_WIDTH] = grid.width
        control[kernels.G_SHIFT] = plain_kernels.BUCKET_BITS
        self._heads = np.zeros(_BUCKETS + 1, dtype=np.int32)
        self._keys: NDArray[np.int64] = np.empty(self.workspace.pool.size, dtype=np.int64)
        self.targets: NDArray[np.int64] = np.empty((0, 3), dtype=np.int64)
        kernels.begin(
            self.workspace.records,
            self.workspace.pool,
            self._keys,
            self._heads,
            grid.price.size > 0,
            marks,
            active,
            control,
        )

    @property
    def best(self) -> int:
        """The cost of the best path known to it, in units."""
        return int(self.control[kernels.G_BEST])

    @property
    def expansions(self) -> int:
        """Expansions so far."""
        return int(self.control[kernels.G_GUIDED] + self.control[kernels.G_PROOF])

    def advance(self, quota: int, stop: NDArray[np.uint8]) -> int:
        """Expand up to `quota` cells; tell how that ended, room being made where it needs some."""
        workspace = self.workspace
        ended = kernels.advance(
            self._grid.moves,
            self._grid.price,
            workspace.records,
            workspace.pool,
            self._keys,
            self._heads,
            self.targets,
            self._marks,
            self._active,
            self.control,
            quota,
            stop,
        )
        if ended != plain_kernels.NEED_SPACE:
            return int(ended)
        workspace.grow_pool()
        self._keys = np.concatenate((self._keys, np.empty_like(self._keys)))
        return plain_kernels.RUNNING

    def rekey(self, shift: int, *, proving: bool) -> None:
        """Queue the open cells anew: for the proof, or for new targets."""
        kernels.rekey(
            self.workspace.records,
            self.workspace.pool,
            self._keys,
            self._heads,
            self.targets,
            self._marks,
            self._active,
            proving,
            shift,
            self.control,
        )

    def raise_bound(self) -> None:
        """Take what the open cells prove."""
        kernels.raise_bound(
            self.workspace.records,
            self.workspace.pool,
            self._heads,
            self._marks,
            self._active,
            self.control,
        )


class _Run:
    """One run of a guided search on one grid: the led search and the plain A* behind it."""

    def __init__(self, search: GuidedSearch, grid: GridGraph, landmarks: Landmarks | None) -> None:
        self.search_for = search
        self.grid = grid
        self.stop = search._stop
        self.ends = grid.index(search._start), grid.index(search._goal)
        self.waypoints: NDArray[np.float64] | None = None
        self.status: SearchStatus | None = None
        self.marks: NDArray[np.int32] = NO_MARKS
        self.active: NDArray[np.int64] = NONE_ACTIVE
        if landmarks is not None:
            active = landmarks.active(grid, search._start, search._goal)
            if active is None:
                self.status = SearchStatus.EXHAUSTED
            else:
                self.marks, self.active = landmarks.marks, active
        walled_in = self.ends[0] != self.ends[1] and not grid.moves[self.ends[1]]
        if walled_in or any(grid.blocked[y, x] for x, y in (search._start, search._goal)):
            self.status = SearchStatus.EXHAUSTED
        self.led = self._make_search()
        self.led.control[kernels.G_WEIGHT] = round(search._weight * kernels.ONE)
        self.led.control[kernels.G_SLACK] = round(search._slack * kernels.ONE)
        self.led.control[kernels.G_RADIUS] = round(RADIUS * grid.straight)
        self.plain: _Search | None = None
        self.best_of = self.led
        self.best_path: NDArray[np.int32] | None = None
        self.first_expansions = 0
        self.first_cost = math.inf

    def _make_search(self) -> _Search:
        made = _Search(self.grid, self.ends, self.marks, self.active)
        # Rounded down: the suboptimality_bound reported is never over the one asked for.
        wanted = self.search_for._max_suboptimality
        made.control[kernels.G_RATIO] = 0 if wanted is None else math.floor(wanted * kernels.ONE)
        return made

    @property
    def expansions(self) -> int:
        """Expansions so far."""
        return self.led.expansions + self.plain_expansions

    @property
    def plain_expansions(self) -> int:
        """Those of the plain A*."""
        return 0 if self.plain is None else self.plain.expansions

    def close(self) -> None:
        """Give the workspaces back."""
        for one in (self.led, self.plain):
            if one is not None:
                self.grid.give_back(one.workspace)

    def search(self) -> Iterator[AnytimeSolution]:
        """Search to the end; yield each better path."""
        while self.status is None:
            before = self.led.best
            if before == 0:  # the start is the goal
                self.status = SearchStatus.FOUND
                before = plain_kernels.NO_PATH
            elif self.stop[0]:
                self.status = SearchStatus.STOPPED
            else:
                self._step()
            if self.led.best < before:
                yield self._improvement()

    def result(self, *, want_expanded: bool) -> GuidedResult:
        """Return what is known now."""
        control, grid = self.led.control, self.grid
        status = SearchStatus.STOPPED if self.status is None else self.status
        expanded = np.zeros(grid.blocked.shape if want_expanded else (0, 0), dtype=np.bool_)
        drawn = want_expanded and self.stop[0] != STOP_CANCELLED
        storage = 0
        for one in filter(None, (self.led, self.plain)):
            storage += int(one.control[kernels.G_STORAGE])
            if drawn:
                workspace = one.workspace
                plain_kernels.add_expanded(workspace.records, workspace.generation, expanded)
        path, bound = self.best_path, int(control[kernels.G_BOUND])
        length, cost, suboptimality_bound = math.nan, math.inf, math.inf
        lower_bound = bound / grid.straight
        if path is not None:
            units = path_units(grid, path)
            length, cost, suboptimality_bound = (
                path_length(path),
                units / grid.straight,
                _ratio(units, bound),
            )
            lower_bound = min(bound, units) / grid.straight
        elif status is SearchStatus.EXHAUSTED:
            lower_bound = math.inf
        return GuidedResult(
            status,
            self.expansions,
            storage,
            expanded,
            np.empty((0, 2), dtype=np.int32) if path is None else path,
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

    def _step(self) -> None:
        """Search one slice; set the status when that ends the search."""
        points = self.search_for._take_pending()
        if points is not None:
            self._lead(points)
        if self.waypoints is None:
            self._step_plain(SLICE)
            return
        led = self.led
        before = led.best
        ended = led.advance(SLICE, self.stop)
        if led.best < before:
            self.best_of = led
        if ended == plain_kernels.FOUND:
            led.raise_bound()
            if led.control[kernels.G_RATIO] == 0 or kernels.is_met(led.control):
                self.status = SearchStatus.FOUND
            else:
                led.rekey(plain_kernels.BUCKET_BITS, proving=True)
        elif ended == kernels.WORKED:
            self._step_plain(max(_PLAIN_STEP, self.plain_expansions // 8))
        else:
            self._end(ended)

    def _step_plain(self, quota: int) -> None:
        """Let the plain A* expand `quota` cells, for its own sake and for the led search's."""
        if self.plain is None:
            self.plain = self._make_search()
            self.plain.control[kernels.G_PROVING] = 1
            self.plain.control[kernels.G_SLACK] = kernels.UNBOUNDED
        known, control = self.plain.control, self.led.control
        # The led search's path prunes this one's too.
        known[kernels.G_BEST] = min(self.plain.best, self.led.best)
        ended = self.plain.advance(quota, self.stop)
        if self.plain.best < self.led.best:
            control[kernels.G_BEST] = self.plain.best
            self.best_of = self.plain
        control[kernels.G_BOUND] = max(control[kernels.G_BOUND], known[kernels.G_BOUND])
        control[kernels.G_LEAST] = max(control[kernels.G_LEAST], self.plain.expansions)
        if ended == plain_kernels.FOUND or kernels.is_met(control):
            self.status = SearchStatus.FOUND
        else:
            self._end(ended)

    def _end(self, ended: int) -> None:
        if ended == plain_kernels.OVERFLOW:
            raise OverflowError
        if ended == plain_kernels.STOPPED:
            self.status = SearchStatus.STOPPED
        elif ended == plain_kernels.EXHAUSTED:
            found = self.led.best < plain_kernels.NO_PATH
            self.status = SearchStatus.FOUND if found else SearchStatus.EXHAUSTED

    def _lead(self, points: NDArray[np.float64]) -> None:
        """Follow new waypoints from here on, unless there are none or a path is known already."""
        if not len(points) or self.led.best < plain_kernels.NO_PATH:
            return
        self.waypoints, led = points, self.led
        led.targets = _targets(self.grid, points, self.search_for._start, self.search_for._goal)
        # The window spans the keys from the least the path may cost to half as much again
        # as the way along the list; the search copes with those beyond, more slowly.
        way = 1.5 * self.search_for._weight * float(led.targets[:, 2].max(initial=0))
        shift = plain_kernels.BUCKET_BITS
        while _BUCKETS << shift < way + 64.0 * self.grid.straight:
            shift += 1
        led.rekey(shift, proving=False)

    def _improvement(self) -> AnytimeSolution:
        path = self.best_of.workspace.trace(self.grid.width, *self.ends)
        units = path_units(self.grid, path)
        cost = units / self.grid.straight
        bound = int(self.led.control[kernels.G_BOUND])
        if self.best_path is None:
            self.first_expansions, self.first_cost = self.expansions, cost
        self.best_path = path
        lower_bound = min(bound, units) / self.grid.straight
        return AnytimeSolution(path, cost, lower_bound, _ratio(units, bound), self.expansions)


def _ratio(units: int, bound: int) -> float:
    return max(1.0, units / bound) if bound > 0 else 1.0


def _targets(
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
    legs = grid.straight * delta.max(axis=1, initial=0)
    legs += (grid.diagonal - grid.straight) * delta.min(axis=1, initial=2**40)
    rest = np.concatenate((legs[::-1].cumsum()[::-1], [0]))
    return np.ascontiguousarray(np.column_stack((cells, rest)), dtype=np.int64)
