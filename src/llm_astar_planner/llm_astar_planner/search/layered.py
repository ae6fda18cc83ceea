"""Exact search for paths that visit regions, in an order or in any, and keep rules on the way.

An A* over pairs of a cell and a layer: the layer tells which of the regions that matter the path
has visited. Layers take memory only when the search enters them.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as plain_kernels
from llm_astar_planner.search._kernels import layered as kernels
from llm_astar_planner.search.grid_graph import GridGraph, path_length
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus
from llm_astar_planner.search.stop import StopFlag, no_stop

MAX_REGIONS = kernels.MAX_REGIONS
# A price that counts before all lengths; higher ones are refused.
MAX_PRICE = 1e6
MAX_RULES = 32
# Layers that a problem may have, whether the search enters them or not.
MAX_LAYERS = 1 << 16
# Bytes that the states of one search may take: 9 for each cell of each layer that it enters.
MAX_BYTES = 2_000_000_000
STATE_BYTES = 9
# Expansions between two looks at the deadline.
EXPANSION_SLICE = 16384

_STATUS = {
    plain_kernels.FOUND: SearchStatus.FOUND,
    plain_kernels.EXHAUSTED: SearchStatus.EXHAUSTED,
    plain_kernels.STOPPED: SearchStatus.STOPPED,
}


class VisitProblemError(LlmAstarError, ValueError):
    """A visit problem whose arrays or numbers cannot be used; says which field and why."""


class LayersTooLargeError(LlmAstarError, RuntimeError):
    """A search that would need more layers or memory than the limits of this module."""


@dataclass(frozen=True, eq=False)
class VisitProblem:
    """What a path must do besides joining start and goal.

    `regions` are bool masks [height, width], at most 16; their blocked cells do not count.
    `visits` are groups of region numbers: the groups in this order, the regions of a group in any
    order. A region is visited when the path enters one of its cells while its group is due; the
    start cell counts, and one cell may count for several regions and groups at once. `before` has
    (first, second, price): until a cell of `first` was entered, the cells of `second` cost
    `price` per cell of length more, or are forbidden if it is inf. Entering a cell of both
    counts as entering `first`. `goals` is a mask of goal cells, any of which will do; None: the
    goal cell. `price` is float32 [height, width], 0 to 1e6: what a cell costs more per cell of
    length; a move pays the mean of its two ends.
    """

    regions: tuple[NDArray[np.bool_], ...]
    visits: tuple[tuple[int, ...], ...] = ()
    before: tuple[tuple[int, int, float], ...] = ()
    goals: NDArray[np.bool_] | None = None
    price: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False)
class LayeredResult(BoundedResult):
    """A bounded result of a visit problem: the optimum if found, its bound 1.0.

    `visited_at` has for each region of `visits`, group by group, the index in the path of the
    cell where it counts; empty without a path. `layers` is the number of layers entered.
    """

    visited_at: tuple[int, ...] = ()
    layers: int = 0


def visit_search(
    graph: GridGraph,
    start: Cell,
    goal: Cell,
    problem: VisitProblem,
    *,
    stop: StopFlag | None = None,
    deadline: float = math.inf,
    want_expanded: bool = True,
) -> LayeredResult:
    """Find a cheapest path from `start` to the goal that does what `problem` asks.

    A move of length d costs d * (1 + mean surcharge + mean price). The status is EXHAUSTED if
    there is no such path, and STOPPED, without a path, if `stop` was raised or the `deadline`
    (monotonic seconds) has passed. `goal` is not looked at if `problem.goals` is given. Raises
    ValueError for a cell off the grid, VisitProblemError for a problem that does not fit the grid
    and LayersTooLargeError if the states would take over 2 GB.
    """
    check_problem(graph, problem)
    first = graph.index(start)
    last = -1 if problem.goals is not None else graph.index(goal)
    search = LayeredSearch(graph, first, last, problem)
    status = search.run(no_stop() if stop is None else stop, deadline)
    return search.result(status, want_expanded=want_expanded)


def check_problem(graph: GridGraph, problem: VisitProblem) -> None:
    """Raise VisitProblemError if a problem is not one of the graph."""
    shape = graph.blocked.shape
    if len(problem.regions) > MAX_REGIONS:
        raise VisitProblemError(f'regions: {len(problem.regions)} are over {MAX_REGIONS}')
    masks = [(f'regions[{index}]', mask) for index, mask in enumerate(problem.regions)]
    for name, array in (*masks, ('goals', problem.goals), ('price', problem.price)):
        if array is not None and array.shape != shape:
            raise VisitProblemError(
                f'{name}: shape {array.shape} is not that of the grid, {shape}'
            )
    numbers = [number for group in problem.visits for number in group]
    numbers += [number for rule in problem.before for number in rule[:2]]
    for number in numbers:
        if not 0 <= number < len(problem.regions):
            raise VisitProblemError(f'there is no region {number}: {len(problem.regions)} given')
    if len(problem.before) > MAX_RULES:
        raise VisitProblemError(f'before: {len(problem.before)} rules are over {MAX_RULES}')
    for *_, rate in problem.before:
        if not (0.0 <= rate <= MAX_PRICE or rate == math.inf):
            raise VisitProblemError(f'before: price {rate} is not inf or in 0 to {MAX_PRICE:g}')
    price = problem.price
    if price is not None and not (price.min() >= 0.0 and price.max() <= MAX_PRICE):
        raise VisitProblemError(f'price: not all values are in 0 to {MAX_PRICE:g}')


class LayeredSearch:
    """One run of the layered search on one grid."""

    def __init__(self, graph: GridGraph, start: int, goal: int, problem: VisitProblem) -> None:
        """Prepare the tables; `start` and `goal` are cell numbers, `goal` -1 if a mask is given.

        Raises LayersTooLargeError.
        """
        self._graph, self._start, self._problem = graph, start, problem
        self._tables, self._possible = make_tables(graph, goal, problem)
        firsts = int(self._tables.first_mask[0]).bit_count()
        count = self._tables.groups.base_group.size << firsts
        if count > MAX_LAYERS:
            raise LayersTooLargeError(
                f'{count} layers are over {MAX_LAYERS}: give fewer regions in any order'
            )
        self._limit = min(count, max(1, MAX_BYTES // (STATE_BYTES * graph.moves.size)))
        self._layers = kernels.Layers(
            np.full(count, -1, dtype=np.int32),
            *(np.zeros(self._limit, dtype=np.int64) for _ in range(3)),
        )
        self._costs = np.empty(0, dtype=np.float64)
        self._tags = np.zeros(0, dtype=np.uint8)
        self.grow_slots()
        self._queue = make_queue(4096)
        self._control = np.zeros(kernels.C_SIZE, dtype=np.int64)
        self._best = np.full(1, np.inf)

    def run(self, stop: StopFlag, deadline: float) -> SearchStatus:
        """Search to the end, or until stopped. Raises LayersTooLargeError."""
        graph, tables = self._graph, self._tables
        if not self._possible or graph.blocked.reshape(-1)[self._start]:
            return SearchStatus.EXHAUSTED
        kernels.begin(
            tables, self._layers, self._queue, self._costs, self._tags, graph.width, self._start,
            self._control, self._best,
        )  # fmt: skip
        every_move = bool(tables.cell_surcharge.size or tables.price.size)
        every_move |= bool(((tables.before_price > 0.0) & (tables.before_price < np.inf)).any())
        while not stop[0] and time.monotonic() < deadline:
            ended = kernels.advance(
                tables, self._layers, self._queue, self._costs, self._tags,
                graph.width, graph.straight, graph.diagonal, every_move,
                self._control, self._best, EXPANSION_SLICE, stop,
            )  # fmt: skip
            if ended == plain_kernels.NEED_SPACE:
                self._queue = grown_queue(self._queue)
            elif ended == kernels.NEED_SLOT:
                self.grow_slots()
            elif ended != plain_kernels.RUNNING:
                return _STATUS[ended]
        return SearchStatus.STOPPED

    def grow_slots(self) -> None:
        """Make room for more layers. Raises LayersTooLargeError beyond the limit of memory."""
        cells = self._graph.moves.size
        have = self._tags.size // cells
        if have == self._limit or cells * STATE_BYTES > MAX_BYTES:
            raise LayersTooLargeError(
                f'the layers of {cells} cells take over {MAX_BYTES / 1e9:g} GB'
            )
        count = min(self._limit, max(9, 2 * have))
        costs, tags = np.empty(count * cells), np.zeros(count * cells, dtype=np.uint8)
        costs[: self._costs.size] = self._costs
        tags[: self._tags.size] = self._tags
        self._costs, self._tags = costs, tags

    def result(self, status: SearchStatus, *, want_expanded: bool) -> LayeredResult:
        """Describe how the search ended."""
        graph, control = self._graph, self._control
        slots = int(control[kernels.C_SLOTS])
        expanded = np.zeros(graph.blocked.shape if want_expanded else (0, 0), dtype=np.bool_)
        if want_expanded:
            kernels.add_expanded(self._tags, slots, expanded)
        counts = int(control[kernels.C_EXPANSIONS]), int(control[kernels.C_STORAGE])
        if status is not SearchStatus.FOUND:
            floor = int(control[kernels.C_LAST]) << plain_kernels.BUCKET_BITS
            bound = math.inf if status is SearchStatus.EXHAUSTED else floor / graph.straight
            return LayeredResult(status, *counts, expanded, lower_bound=bound, layers=slots)
        path, cost = self.path(), float(self._best[0]) / graph.straight
        return LayeredResult(
            status,
            *counts,
            expanded,
            path,
            path_length(path),
            cost=cost,
            lower_bound=cost,
            suboptimality_bound=1.0,
            first_expansions=counts[0],
            first_cost=cost,
            visited_at=self.visited_at(path),
            layers=slots,
        )

    def path(self) -> NDArray[np.int32]:
        """Return the path found: int32 [n, 2]."""
        graph, path = self._graph, np.empty((1024, 2), dtype=np.int32)
        while True:
            count = kernels.trace(
                self._tables, self._layers, self._costs, self._tags,
                graph.width, graph.straight, graph.diagonal, self._start, self._control, path,
            )  # fmt: skip
            if count <= len(path):
                return path[-count:].copy()
            path = np.empty((count, 2), dtype=np.int32)

    def visited_at(self, path: NDArray[np.int32]) -> tuple[int, ...]:
        """Return for each region of the visits the index in the path where it counts."""
        bits = self._tables.cell_bits[path[:, 1].astype(np.int64) * self._graph.width + path[:, 0]]
        indices: list[int] = []
        due = 0
        for group in self._problem.visits:
            counted = [due + int(np.argmax(bits[due:] >> region & 1)) for region in group]
            indices += counted
            due = max(counted, default=due)
        return tuple(indices)


def make_tables(graph: GridGraph, goal: int, problem: VisitProblem) -> tuple[kernels.Tables, bool]:
    """Return the tables of a problem, and whether it may have a path.

    There surely is none if a region to visit or the goals have no free cell.
    """
    cells = graph.moves.size
    cell_bits = np.zeros(cells, dtype=np.uint32)
    boxes = np.zeros((MAX_REGIONS + 1, 4), dtype=np.int64)
    counts = [
        kernels.mark_region(mask, graph.blocked, 1 << index, cell_bits, boxes[index])
        for index, mask in enumerate(problem.regions)
    ]
    possible = all(counts[region] for group in problem.visits for region in group)
    if problem.goals is None:
        y, x = divmod(goal, graph.width)
        cell_bits[goal] |= kernels.GOAL_BIT
        boxes[-1] = x, x, y, y
        possible &= not graph.blocked[y, x]
    else:
        possible &= (
            kernels.mark_region(
                problem.goals, graph.blocked, kernels.GOAL_BIT, cell_bits, boxes[-1]
            )
            > 0
        )
    seconds = np.zeros(cells if problem.before else 0, dtype=np.uint32)
    for index, (_, second, _) in enumerate(problem.before):
        mask = problem.regions[second].reshape(-1)
        seconds[mask] |= np.uint32(1 << index)
        cell_bits[mask] |= np.uint32(kernels.SECOND_BIT)
    price = np.zeros(0, dtype=np.float32)
    if problem.price is not None:
        price = np.ascontiguousarray(problem.price, dtype=np.float32).reshape(-1)
    groups = make_groups(problem.visits)
    point = bool((boxes[-1, ::2] == boxes[-1, 1::2]).all())
    slopes = make_slopes(graph, point=point)
    first_mask = 0
    for first, *_ in problem.before:
        first_mask |= 1 << first
    tables = kernels.Tables(
        graph.moves,
        graph.cell_surcharge,
        price,
        cell_bits,
        seconds,
        np.array([rule[0] for rule in problem.before], dtype=np.int64),
        np.array([rule[2] for rule in problem.before], dtype=np.float64),
        np.array([first_mask], dtype=np.int64),
        groups,
        slopes,
        np.empty((groups.candidates.size, len(slopes))),
    )
    kernels.fill_offsets(tables, boxes.astype(np.float64))
    return tables, possible


def make_groups(visits: tuple[tuple[int, ...], ...]) -> kernels.Groups:
    """Return the tables of the base layers. Raises LayersTooLargeError."""
    groups = [set(group) for group in visits if group]
    sizes = [(1 << len(group)) - 1 for group in groups]
    first_base = np.cumsum([0, *sizes], dtype=np.int64)
    if first_base[-1] >= MAX_LAYERS:
        raise LayersTooLargeError(
            f'visits: too many regions in any order, {first_base[-1]} layers'
        )
    masks = np.array([sum(1 << region for region in group) for group in groups], dtype=np.int64)
    base_group, base_visited = np.zeros((2, first_base[-1] + 1), dtype=np.int64)
    none = np.empty(0, dtype=np.int64)
    tables = kernels.Groups(masks, first_base, base_group, base_visited, none, none)
    kernels.fill_bases(tables)
    due = np.append(masks, 1 << MAX_REGIONS)[base_group] & ~base_visited
    rows, candidates = np.nonzero(due[:, None] >> np.arange(MAX_REGIONS + 1) & 1)
    begin = np.searchsorted(rows, np.arange(len(due) + 1))
    return tables._replace(candidate_begin=begin, candidates=candidates)


def make_slopes(graph: GridGraph, *, point: bool) -> NDArray[np.float64]:
    """Return the slopes for `Tables`, float64 [n, 2]; fewer do if the goal is a `point`."""
    straight, extra = graph.straight, graph.diagonal - graph.straight
    values = (
        (straight, extra, -extra, -straight) if point else (straight, extra, 0, -extra, -straight)
    )
    return np.array(
        [(a, b) for a in values for b in values if abs(a) + abs(b) <= graph.diagonal],
        dtype=np.float64,
    )


def make_queue(size: int) -> kernels.Queue:
    """Return an empty queue with room for `size` entries."""
    return kernels.Queue(
        np.zeros(kernels.LEVELS << kernels.DIGIT_BITS, dtype=np.int32),
        np.empty(size, dtype=np.int64),
        np.empty(size, dtype=np.int64),
        np.empty(size, dtype=np.int32),
    )


def grown_queue(queue: kernels.Queue) -> kernels.Queue:
    """Return a queue with the same content and twice the room."""
    return kernels.Queue(
        queue.heads,
        np.concatenate((queue.keys, np.empty_like(queue.keys))),
        np.concatenate((queue.states, np.empty_like(queue.states))),
        np.concatenate((queue.following, np.empty_like(queue.following))),
    )
