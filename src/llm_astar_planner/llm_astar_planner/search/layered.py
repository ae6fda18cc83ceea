"""Exact search for paths that visit regions, in an order or in any, and keep rules on the way.

An A* over pairs of a cell and a layer: the layer tells which of the regions that matter the path
has visited. Layers take memory only when the search enters them.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import chain

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as plain_kernels
from llm_astar_planner.search._kernels import layered as kernels
from llm_astar_planner.search.astar import ENDED
from llm_astar_planner.search.grid_graph import GridGraph, path_length, traced
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus, empty_path
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
# Caps on the cost of entering a region count paths that leave its box by so many cells, and are
# measured after so many expansions per cell of that.
CAP_MARGIN = 16
CAP_PATIENCE = 2
# Expansions between two looks at the deadline.
EXPANSION_SLICE = 8192


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
    """A bounded result of a visit problem: the optimum if found, but for rounding.

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
        tables, self._counts = make_tables(graph, goal, problem)
        count = tables.groups.base_group.size << int(tables.rules.first_mask[0]).bit_count()
        if count > MAX_LAYERS:
            raise LayersTooLargeError(
                f'{count} layers are over {MAX_LAYERS}: give fewer regions in any order'
            )
        self._limit = min(count, max(1, MAX_BYTES // (STATE_BYTES * graph.moves.size)))
        heads = np.zeros(kernels.LEVELS << kernels.DIGIT_BITS, dtype=np.int32)
        self._search = kernels.Search(
            tables, make_layers(count, self._limit),
            kernels.States(np.empty(0), np.zeros(0, dtype=np.uint8)),
            kernels.Queue(heads, *np.empty((2, 4096), dtype=np.int64)),
            np.zeros(kernels.C_SIZE, dtype=np.int64), np.full(1, np.inf),
        )  # fmt: skip

    def run(self, stop: StopFlag, deadline: float) -> SearchStatus:
        """Search to the end, or until stopped. Raises LayersTooLargeError."""
        graph, tables = self._graph, self._search.tables
        wanted = [region for group in self._problem.visits for region in group]
        if graph.blocked.reshape(-1)[self._start] or not all(
            self._counts[region] for region in (*wanted, MAX_REGIONS)
        ):
            return SearchStatus.EXHAUSTED
        self.add_slots()
        kernels.begin(self._search, self._start)
        prices = tables.rules.prices
        every_move = bool(tables.grid.cell_surcharge.size or tables.price.size)
        every_move |= bool(((prices > 0.0) & (prices < np.inf)).any())
        while not stop[0] and time.monotonic() < deadline:
            ended = kernels.advance(*self._search, every_move, EXPANSION_SLICE, stop)
            if ended == plain_kernels.NEED_SPACE:
                heads, *pool = self._search.queue
                longer = (np.concatenate((part, np.empty_like(part))) for part in pool)
                self._search = self._search._replace(queue=kernels.Queue(heads, *longer))
            elif ended == kernels.NEED_SLOT:
                self.add_slots()
            elif ended != plain_kernels.RUNNING:
                return ENDED[ended]
            else:
                kernels.measure_caps(self._search, CAP_MARGIN, CAP_PATIENCE)
        return SearchStatus.STOPPED

    def add_slots(self) -> None:
        """Make room for more layers. Raises LayersTooLargeError beyond the limit of memory."""
        cells = self._graph.moves.size
        have = self._search.states.tags.size // cells
        if have >= self._limit or cells * STATE_BYTES > MAX_BYTES:
            raise LayersTooLargeError(
                f'the layers of {cells} cells take over {MAX_BYTES / 1e9:g} GB'
            )
        slots = min(self._limit, max(4, 2 * have))
        costs, tags = np.empty(slots * cells), np.zeros(slots * cells, dtype=np.uint8)
        costs[: have * cells], tags[: have * cells] = self._search.states
        self._search = self._search._replace(states=kernels.States(costs, tags))

    def result(self, status: SearchStatus, *, want_expanded: bool) -> LayeredResult:
        """Describe how the search ended."""
        graph, control = self._graph, self._search.control
        slots = int(control[kernels.C_SLOTS])
        expanded: NDArray[np.bool_] = np.zeros((0, 0), dtype=np.bool_)
        if want_expanded and slots == 0:
            expanded = np.zeros_like(graph.blocked)
        elif want_expanded:
            tags = self._search.states.tags[: slots * graph.moves.size].reshape(slots, -1)
            every = np.bitwise_or.reduce(tags, axis=0)
            expanded = (every & kernels.EXPANDED).astype(np.bool_).reshape(graph.blocked.shape)
        counts = int(control[kernels.C_EXPANSIONS]), int(control[kernels.C_STORAGE])
        path = empty_path()
        visited_at: tuple[int, ...] = ()
        cost = ratio = math.inf
        lower_bound = (int(control[kernels.C_LAST]) << plain_kernels.BUCKET_BITS) / graph.straight
        if status is SearchStatus.EXHAUSTED:
            lower_bound = math.inf
        elif status is SearchStatus.FOUND:
            path, _ = traced(kernels.trace, self._search, self._start)
            visited_at = self.visited_at(path)
            cost = lower_bound = float(self._search.best[0]) / graph.straight
            ratio = graph.rounding
        return LayeredResult(
            status, *counts, expanded, path, path_length(path), cost, lower_bound, ratio,
            counts[0], cost, visited_at, slots,
        )  # fmt: skip

    def visited_at(self, path: NDArray[np.int32]) -> tuple[int, ...]:
        """Return for each region of the visits the index in the path where it counts."""
        cells = path[:, 1].astype(np.int64) * self._graph.width + path[:, 0]
        bits = self._search.tables.cell_bits[cells]
        indices: list[int] = []
        due = 0
        for group in self._problem.visits:
            counted = [due + int(np.argmax(bits[due:] >> region & 1)) for region in group]
            indices += counted
            due = max(counted, default=due)
        return tuple(indices)


def make_tables(
    graph: GridGraph, goal: int, problem: VisitProblem
) -> tuple[kernels.Tables, list[int]]:
    """Return the tables of a problem and the numbers of free cells of the regions.

    That of the goals is number MAX_REGIONS.
    """
    cell_bits = np.zeros(graph.moves.size, dtype=np.uint32)
    boxes = np.zeros((MAX_REGIONS + 1, 4), dtype=np.int64)
    counts = [0] * (MAX_REGIONS + 1)
    masks = dict(enumerate(problem.regions))
    if problem.goals is not None:
        masks[MAX_REGIONS] = problem.goals
    else:
        y, x = divmod(goal, graph.width)
        cell_bits[goal] = kernels.GOAL_BIT
        boxes[-1] = x, x, y, y
        counts[-1] = int(not graph.blocked[y, x])
    for region, mask in masks.items():
        rows = np.flatnonzero(mask.any(axis=1))
        if rows.size:
            first, end = rows[0], rows[-1] + 1
            free = mask[first:end] & ~graph.blocked[first:end]
            counts[region] = int(np.count_nonzero(free))
            bits = cell_bits.reshape(mask.shape)[first:end]
            np.bitwise_or(bits, np.uint32(1 << region), out=bits, where=free)
            ys, xs = (np.flatnonzero(free.any(axis=axis)) for axis in (1, 0))
            if counts[region]:
                boxes[region] = xs[0], xs[-1], first + ys[0], first + ys[-1]
            else:
                boxes[region] = graph.width, -1, end - 1, -1
    price = np.zeros(0, dtype=np.float32)
    if problem.price is not None:
        price = np.ascontiguousarray(problem.price, dtype=np.float32).reshape(-1)
    groups = make_groups(problem.visits)
    tables = kernels.Tables(
        graph.cells, price, cell_bits, groups, make_rules(problem.before),
        boxes, make_slopes(graph), np.empty((groups.candidates.size, kernels.SLOPES)),
    )  # fmt: skip
    kernels.fill_offsets(tables)
    return tables, counts


def make_rules(before: tuple[tuple[int, int, float], ...]) -> kernels.Rules:
    """Return the tables of the rules `before`."""
    firsts = np.array([first for first, _, _ in before], dtype=np.int64)
    seconds = np.array([second for _, second, _ in before], dtype=np.int64)
    masks = (np.bitwise_or.reduce(1 << numbers, keepdims=True) for numbers in (firsts, seconds))
    prices = np.array([price for _, _, price in before], dtype=np.float64)
    return kernels.Rules(firsts, seconds, prices, *masks)


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
    base_group = np.append(np.repeat(np.arange(len(groups)), sizes), len(groups))
    base_visited = np.array([*chain(*map(subsets, groups)), 0], dtype=np.int64)
    due = np.append(masks, 1 << MAX_REGIONS)[base_group] & ~base_visited
    rows, candidates = np.nonzero(due[:, None] >> np.arange(MAX_REGIONS + 1) & 1)
    begin = np.searchsorted(rows, np.arange(len(due) + 1))
    # Contiguous as the others, whatever their number: otherwise numba compiles all of it twice.
    candidates = np.ascontiguousarray(candidates)
    return kernels.Groups(masks, first_base, base_group, base_visited, begin, candidates)


def subsets(group: set[int]) -> list[int]:
    """Return the masks of the sets of regions of a group, all but the last, which is the group."""
    masks = [0]
    for region in sorted(group):
        masks += [mask | 1 << region for mask in masks]
    return masks[:-1]


def make_slopes(graph: GridGraph) -> NDArray[np.float64]:
    """Return the slopes for `Tables`, float64 [2, SLOPES].

    They are those of octile distances, and what the sums along a chain of boxes add to them.
    """
    long, short = graph.straight, graph.diagonal - graph.straight
    signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    slopes = [(long * a, short * b) for a, b in signs]
    slopes += [(short * b, long * a) for a, b in signs]
    slopes += [(long, 0), (-long, 0), (0, long), (0, -long)]
    slopes += [(short * a, short * b) for a, b in signs]
    return np.array(slopes, dtype=np.float64).T.copy()


def make_layers(count: int, slots: int) -> kernels.Layers:
    """Return the table of `count` layers, of which as many as `slots` may be entered."""
    numbers = np.zeros((6, slots), dtype=np.int64)
    caps = np.empty((slots, MAX_REGIONS))
    return kernels.Layers._make([np.full(count, -1, dtype=np.int32), *numbers, caps])
