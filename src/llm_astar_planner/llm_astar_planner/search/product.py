# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Exact search for paths that automata over regions accept.

An A* over pairs of a cell and a product state, the tuple of the automata's states. What the search
enters of the product takes memory, and nothing else does.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, NamedTuple, cast

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as plain_kernels
from llm_astar_planner.search._kernels import product as kernels
from llm_astar_planner.search.arrays import (
    Bools,
    Float32s,
    Float64s,
    Int32s,
    Int64s,
    StopFlag,
    Uint16s,
    no_stop,
)
from llm_astar_planner.search.astar import ENDED
from llm_astar_planner.search.automata import MAX_PRICE, Automaton
from llm_astar_planner.search.grid_graph import GridGraph, path_length, traced
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus, empty_path

MAX_REGIONS = 32
MAX_AUTOMATA = 64
# Product states that a search may enter, and bytes that all that it has entered may take.
MAX_STATES = 1 << 16
MAX_BYTES = 2_000_000_000
# Product states times places twice that the guide may plan over: a few milliseconds.
GUIDE_SIZE = 1 << 21
# Expansions between two looks at the deadline.
EXPANSION_SLICE = 8192
# Tiles that a letter's cells are parted into are 1 << TILE_BITS cells a side, larger where that
# makes more than MAX_PLACES.
TILE_BITS = 4
MAX_PLACES = 90
FAR = 2**31 - 1

Mask = Bools


class ProductProblemError(LlmAstarError, ValueError):
    """A problem whose arrays or numbers cannot be used; says which field and why."""


class ProductTooLargeError(LlmAstarError, RuntimeError):
    """A search that would need more product states or memory than the limits of this module."""


@dataclass(frozen=True, eq=False)
class ProductProblem:
    """What a path must do besides joining start and goal.

    `regions` are bool masks [height, width], at most 32; the `automata` read which of them each
    cell of the path is in, and all must accept it. `goals` is a mask of goal cells, any of which
    will do; None: the goal cell. `price` is float32 [height, width], 0 to 1e6: what a cell costs
    more per cell of length; a move pays the mean of its two ends.
    """

    regions: tuple[Mask, ...] = ()
    automata: tuple[Automaton, ...] = ()
    goals: Mask | None = None
    price: Float32s | None = None


@dataclass(eq=False)
class ProductResult(BoundedResult):
    """A bounded result of a product problem: the optimum if found, but for rounding.

    `states` is the number of product states that the search entered. `trace` is int32
    [path cells, automata], the state of each automaton after each cell of the path.
    """

    states: int = 0
    trace: Int32s = field(default_factory=empty_path)


def product_search(
    graph: GridGraph,
    start: Cell,
    goal: Cell,
    problem: ProductProblem,
    *,
    landmarks: Landmarks | None = None,
    stop: StopFlag | None = None,
    deadline: float = math.inf,
    want_expanded: bool = True,
) -> ProductResult:
    """Find a cheapest path from `start` to the goal that the automata of `problem` accept.

    A move of length d costs d * (1 + mean surcharge + mean price). The status is EXHAUSTED if
    there is no such path, and STOPPED, without a path, if `stop` was raised or the `deadline`
    (monotonic seconds) has passed. `goal` is not looked at if `problem.goals` is given.
    `landmarks`, which must be admissible on the grid, save expansions. Raises ValueError for a
    cell off the grid, ProductProblemError for a problem that does not fit the grid and
    ProductTooLargeError if the search would take over 2 GB.
    """
    check_problem(graph, problem)
    first = graph.index(start)
    last = -1 if problem.goals is not None else graph.index(goal)
    search = ProductSearch(graph, first, last, problem, landmarks)
    status = search.run(no_stop() if stop is None else stop, deadline)
    return search.result(status, want_expanded=want_expanded)


def check_problem(graph: GridGraph, problem: ProductProblem) -> None:
    """Raise ProductProblemError if a problem is not one of the graph."""
    shape = graph.blocked.shape
    for name, most in (('regions', MAX_REGIONS), ('automata', MAX_AUTOMATA)):
        count = len(getattr(problem, name))
        if count > most:
            raise ProductProblemError(f'{name}: {count} are over {most}')
    masks = [(f'regions[{index}]', mask) for index, mask in enumerate(problem.regions)]
    for name, array in (*masks, ('goals', problem.goals), ('price', problem.price)):
        if array is not None and array.shape != shape:
            problem_of = f'shape {array.shape} is not that of the grid, {shape}'
            raise ProductProblemError(f'{name}: {problem_of}')
    for number in chain.from_iterable(automaton.regions for automaton in problem.automata):
        if not 0 <= number < len(problem.regions):
            raise ProductProblemError(f'there is no region {number}: {len(problem.regions)} given')
    price = problem.price
    if price is not None and not (price.min() >= 0.0 and price.max() <= MAX_PRICE):
        raise ProductProblemError(f'price: not all values are in 0 to {MAX_PRICE:g}')


class ProductSearch:
    """One run of the product search on one grid."""

    def __init__(
        self,
        graph: GridGraph,
        start: int,
        goal: int,
        problem: ProductProblem,
        landmarks: Landmarks | None,
    ) -> None:
        """Prepare the tables; `start` and `goal` are cell numbers, `goal` -1 if a mask is given.

        Raises ProductProblemError where the regions make too many sets.
        """
        self._graph, self._start, self._problem = graph, start, problem
        reading = Reading.of(graph, goal, problem)
        automata = [Rows.of(automaton, reading.sets) for automaton in problem.automata]
        price = np.zeros(0, dtype=np.float32)
        if problem.price is not None:
            price = np.ascontiguousarray(problem.price, dtype=np.float32).reshape(-1)
        sizes = np.cumsum([0, *(rows.after.size for rows in automata)])
        tables = kernels.Tables(
            graph.cells, price, reading.letters, sizes[:-1],
            joined([rows.after for rows in automata], np.int32),
            joined([rows.rates for rows in automata], np.float64),
            joined([rows.accepting for rows in automata], np.bool_),
        )  # fmt: skip
        self._priced = bool(price.size or tables.rates.any())
        self._every_move = bool(price.size or graph.cell_surcharge.size or graph.has_rules)
        guide = make_guide(graph, start, reading, automata, landmarks)
        self._search = make_search(tables, guide, reading.sets.size)

    def run(self, stop: StopFlag, deadline: float) -> SearchStatus:
        """Search to the end, or until stopped. Raises ProductTooLargeError."""
        if self._graph.blocked.reshape(-1)[self._start]:
            return SearchStatus.EXHAUSTED
        kernels.begin(self._search, self._start)
        while not stop[0] and time.monotonic() < deadline:
            how = self._every_move, self._priced, EXPANSION_SLICE, stop
            ended = kernels.advance(self._search, *how)
            if ended == plain_kernels.NEED_SPACE:
                self.add_space()
            elif ended != plain_kernels.RUNNING:
                return ENDED[ended]
        return SearchStatus.STOPPED

    def add_space(self) -> None:
        """Make what is nearly full twice as long. Raises ProductTooLargeError."""
        search, used = self._search, [kernels.C_TOP, kernels.C_BLOCKS, kernels.C_SLOTS]
        top, blocks, slots = search.control[used].tolist()
        if slots + 8 > MAX_STATES:
            raise ProductTooLargeError(f'the search enters over {MAX_STATES} states of automata')
        queue, states, layers = search.queue, search.states, search.layers
        if top + 8 > len(queue.keys):
            queue = kernels.Queue(*map(doubled, queue))
        if blocks + 8 > len(states.origins):
            states = kernels.States(*map(doubled, cast('Any', states)))
        if slots + 8 > len(layers.is_final):
            layers = kernels.Layers(*map(doubled, cast('Any', layers)))
        self._search = search._replace(queue=queue, states=states, layers=layers)
        arrays: list[NDArray[Any]] = [*queue, *states, *layers]
        if sum(array.nbytes for array in arrays) > MAX_BYTES:
            raise ProductTooLargeError(f'the search takes over {MAX_BYTES / 1e9:g} GB')

    def result(self, status: SearchStatus, *, want_expanded: bool) -> ProductResult:
        """Describe how the search ended."""
        graph, search = self._graph, self._search
        control = search.control
        blocks = int(control[kernels.C_BLOCKS])
        expanded = np.zeros(graph.blocked.shape if want_expanded else (0, 0), dtype=np.bool_)
        if want_expanded:
            kernels.add_expanded(search.states, blocks, expanded)
        counts = int(control[kernels.C_EXPANSIONS]), int(control[kernels.C_STORAGE])
        path = empty_path()
        cost = ratio = math.inf
        lower_bound = (int(control[kernels.C_LAST]) << plain_kernels.BUCKET_BITS) / graph.straight
        if status is SearchStatus.EXHAUSTED:
            lower_bound = math.inf
        elif status is SearchStatus.FOUND:
            path, _ = traced(kernels.trace, search)
            cost = lower_bound = float(search.best[0]) / graph.straight
            ratio = graph.rounding
        entered = np.unique(search.states.origins[:blocks] >> 2 * kernels.ORIGIN_BITS).size
        return ProductResult(
            status, *counts, expanded, path, path_length(path), cost, lower_bound, ratio,
            counts[0], cost, entered, self.trace(path),
        )  # fmt: skip

    def trace(self, path: Int32s) -> Int32s:
        """Return the state of each automaton after each cell of a path."""
        problem = self._problem
        states = np.zeros((len(path), len(problem.automata)), dtype=np.int32)
        columns, rows = path.T
        inside = [mask[rows, columns] for mask in problem.regions]
        for number, automaton in enumerate(problem.automata):
            letters = np.zeros(len(path), dtype=np.int64)
            for bit, region in enumerate(automaton.regions):
                letters |= inside[region].astype(np.int64) << bit
            state = 0
            for index, letter in enumerate(letters.tolist()):
                state = states[index, number] = automaton.after[state, letter]
        return states


@dataclass(frozen=True, eq=False)
class Rows:
    """The tables of an automaton for the letters of a map, [states, letters].

    `after` is -1 where no path may end from there on that map, or the price is infinite.
    """

    after: Int32s
    rates: Float64s
    accepting: Bools

    @classmethod
    def of(cls, automaton: Automaton, sets: Int64s) -> Rows:
        """Read the letters `sets`, the sets of regions that cells are in, as bits."""
        columns = np.zeros(sets.size, dtype=np.int64)
        for bit, region in enumerate(automaton.regions):
            columns |= (sets >> region & 1) << bit
        after = automaton.after[:, columns].astype(np.int32)
        rates = np.zeros(after.shape)
        if automaton.price is not None:
            rates = automaton.price[:, columns]
            after[rates[after, np.arange(sets.size)] == math.inf] = -1
        alive = automaton.accepting
        while True:
            may_end = automaton.accepting | (alive[after] & (after >= 0)).any(axis=1)
            if (may_end == alive).all():
                break
            alive = may_end
        after[~alive[after]] = -1
        return cls(after, rates, automaton.accepting)

    @property
    def is_idempotent(self) -> bool:
        """Whether a letter that is read again changes nothing."""
        again = self.after[self.after, np.arange(self.after.shape[1])]
        return bool(((again == self.after) | (self.after < 0)).all())


class Reading(NamedTuple):
    """What automata read on a map: the letter of each cell, and which sets of regions they are.

    `regions` are the cells of each region and `goals` the free goal cells.
    """

    letters: Uint16s  # [cells]
    sets: Int64s  # [letters]
    regions: list[Int64s]
    goals: Int64s

    @classmethod
    def of(cls, graph: GridGraph, goal: int, problem: ProductProblem) -> Reading:
        """Read the regions of a problem.

        Raises ProductProblemError if they overlap in too many ways.
        """
        letters = np.zeros(graph.moves.size, dtype=np.uint16)
        sets = np.zeros(kernels.LETTER, dtype=np.int64)
        regions = [np.flatnonzero(mask) for mask in problem.regions]
        blocked = graph.blocked.reshape(-1)
        used = 1
        for region, cells in enumerate(regions):
            used = kernels.add_region(region, cells, blocked, letters, sets, used)
            if used > sets.size:
                raise ProductProblemError(f'regions: they overlap in over {sets.size} ways')
        for cells in regions:
            kernels.mark_borders(cells, graph.moves, graph.width, letters)
        goals = np.array([goal]) if problem.goals is None else np.flatnonzero(problem.goals)
        goals = goals[~blocked[goals]]
        letters[goals] |= kernels.GOAL
        return cls(letters, sets[:used], regions, goals)


def joined(arrays: list[NDArray[Any]], kind: type) -> NDArray[Any]:
    """Return arrays one after the other, flat."""
    return np.concatenate([np.zeros(0, dtype=kind), *(array.reshape(-1) for array in arrays)])


def make_guide(
    graph: GridGraph,
    start: int,
    reading: Reading,
    automata: list[Rows],
    landmarks: Landmarks | None,
) -> kernels.Guide:
    """Return the bounds on the costs to go; they know as many automata as there is time for."""
    rows = np.zeros((0, graph.moves.size), dtype=np.int32)
    if landmarks is not None:
        rows = landmarks.distances
        if (rows[:, start] < 0).any():
            rows = rows[rows[:, start] >= 0]
    every_cell = not all(one.is_idempotent for one in automata)
    cells, places, letters = find_places(graph, start, reading, rows, every_cell=every_cell)
    count = letters.size
    y, x = np.divmod(cells, graph.width)
    known = rows[:, cells] if len(rows) else np.zeros((1, cells.size), np.int32)
    low, high = extents(np.column_stack([x, y, *known]), places, count)
    boxes = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
    # How far apart places are at least: by columns and rows, and by each of the landmarks.
    gaps = np.maximum(low - high[:, np.newaxis], low[:, np.newaxis] - high).clip(0)
    steps, gaps = np.sort(gaps[..., :2]), gaps[..., 2:]
    between = graph.straight * steps[..., 1] + (graph.diagonal - graph.straight) * steps[..., 0]
    active = np.zeros(kernels.ACTIVE, dtype=np.int64)
    for index in range(kernels.ACTIVE):
        # The one that proves most besides those before.
        row = active[index] = (gaps - between[..., np.newaxis]).clip(0).sum(axis=(0, 1)).argmax()
        between = np.maximum(between, gaps[..., row])
    radix = np.zeros(len(automata), dtype=np.int64)
    after = np.zeros((1, reading.sets.size), dtype=np.int64)
    accepting = np.ones(1, dtype=np.bool_)
    # Those that ask for something first.
    for number in sorted(range(len(automata)), key=lambda number: automata[number].accepting[0]):
        one = automata[number]
        if len(after) * len(one.after) * count * count <= GUIDE_SIZE:
            radix[number] = len(after)
            after, accepting = product(after, accepting, one)
    rest = np.full((len(after), count), np.inf)
    kernels.fill_rest(between.astype(np.float64), letters, after, accepting, rest)
    least, most = (part[:, 2 + active].astype(np.int32, order='C') for part in (low, high))
    return kernels.Guide(boxes, rows, active, least, most, radix, rest)


def extents(values: Int64s, places: Int64s, count: int) -> tuple[Int64s, Int64s]:
    """Return the least and the greatest of `values` [n, k] at each place: [count, k] each."""
    order = np.argsort(places, kind='stable')
    found, begins = np.unique(places[order], return_index=True)
    low, high = (np.full((count, values.shape[1]), limit, np.int64) for limit in (FAR, -1))
    low[found] = np.minimum.reduceat(values[order], begins)
    high[found] = np.maximum.reduceat(values[order], begins)
    return low, high


def find_places(
    graph: GridGraph, start: int, reading: Reading, rows: Int32s, *, every_cell: bool
) -> tuple[Int64s, Int64s, Int64s]:
    """Return cells, their places, and the letters of the places: see `kernels.Guide`.

    Only cells at the border of their letter count unless `every_cell`, since there a path enters
    it, and of `rows`, which all reach the start, only cells that they reach.
    """
    cells = np.concatenate([*reading.regions, np.zeros(0, dtype=np.int64)])
    letters = reading.letters[cells].astype(np.int64)
    counted = (letters & kernels.LETTER > 0) & (every_cell | (letters & kernels.BORDER > 0))
    cells, letters, goals = cells[counted], letters[counted] & kernels.LETTER, reading.goals
    if len(rows):
        is_reached = rows[0, cells] >= 0
        cells, letters = cells[is_reached], letters[is_reached]
        goals = goals[rows[0, goals] >= 0]
    y, x = np.divmod(cells, graph.width)
    for bits in range(TILE_BITS, 32, 2):
        tiles = (letters << 32) + (y >> bits << 16) + (x >> bits)
        found, places = np.unique(tiles, return_inverse=True)
        if found.size <= MAX_PLACES or bits > 16:
            break
    places = np.concatenate([[0], 1 + places, np.full(goals.size, 1 + found.size)])
    return (
        np.concatenate([[start], cells, goals]), places, np.concatenate([[0], found >> 32, [0]])
    )  # fmt: skip


def product(after: Int64s, accepting: Bools, one: Rows) -> tuple[Int64s, Bools]:
    """Return the table and the accepting states of the product with one more automaton."""
    count = len(after)
    both = one.after[:, np.newaxis].astype(np.int64) * count + after
    both[(one.after[:, np.newaxis] < 0) | (after < 0)] = -1
    is_final = (one.accepting[:, np.newaxis] & accepting).reshape(-1)
    return both.reshape(count * len(one.after), -1), is_final


def make_search(tables: kernels.Tables, guide: kernels.Guide, letters: int) -> kernels.Search:
    """Return a search that has not begun, with little space."""
    height = tables.grid.moves.size // tables.grid.width
    pages = kernels.page_of.py_func(tables.grid.width, tables.grid.width - 1, height - 1) + 1
    places, slots = guide.boxes.shape[0], 16
    layers = kernels.Layers(
        np.zeros((slots, tables.offsets.size), dtype=np.int32), np.zeros(slots, dtype=np.bool_),
        np.zeros((slots, letters), dtype=np.int32), np.zeros((slots, letters)),
        np.zeros((slots, pages), dtype=np.int32), np.zeros(slots, dtype=np.int64),
        np.zeros((slots, places), dtype=np.int32), np.zeros((slots, places)),
    )  # fmt: skip
    blocks = (64, kernels.BLOCK_STATES)
    states = kernels.States(
        np.zeros(blocks[0], dtype=np.int64), np.zeros(blocks),
        np.zeros(blocks, dtype=np.uint8), np.zeros(blocks, dtype=np.int32),
    )  # fmt: skip
    return kernels.Search(
        tables, guide, layers, states, kernels.Queue(*np.zeros((2, 4096), dtype=np.int64)),
        np.zeros(kernels.LEVELS << kernels.DIGIT_BITS, dtype=np.int32),
        np.zeros(2 << MAX_STATES.bit_length(), dtype=np.int32),
        np.zeros(kernels.C_SIZE, dtype=np.int64), np.full(1, np.inf),
    )  # fmt: skip


def doubled(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array twice as long, with zeros at its end."""
    longer = np.zeros((2 * len(array), *array.shape[1:]), dtype=array.dtype)
    longer[: len(array)] = array
    return longer
