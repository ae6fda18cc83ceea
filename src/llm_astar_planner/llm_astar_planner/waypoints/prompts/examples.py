# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Prompts as they are sent: with the most similar solved samples, and about a reply."""

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, load_barrier_maps

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.resources import SAMPLES_FILE, find_file
from llm_astar_planner.search.arrays import Bools, Float64s
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.baselines import shortest_route
from llm_astar_planner.waypoints.prompts import map_description as descriptions
from llm_astar_planner.waypoints.prompts.template import Example, Template
from llm_astar_planner.waypoints.source import MESSAGE, WaypointQuery

# Bounds on a file, so that a map is solved in a fraction of a second: a map that a prompt does
# not describe exactly is no example either.
MAX_CELLS = 250_000
MAX_CELLS_OF_ALL = 50_000_000
MAX_SAMPLES = 100_000
# Maps are compared by which of so many tiles, across and up, hold an obstacle.
TILES = (10, 6)


class ExamplesError(LlmAstarError, ValueError):
    """A file of examples cannot be used; the message names it and what is wrong."""


class SolvedSample(NamedTuple):
    """A sample's description, and its shortest path: start, corners and goal, lattice points."""

    description: descriptions.Description
    path: tuple[Cell, ...]


class ExampleLibrary:
    """The samples of some maps, solved when they are retrieved. Thread-safe.

    Two samples are compared with both maps scaled to the unit square. Their distance is the
    distance of the starts, plus that of the goals, plus the share of the tiles of TILES that hold
    an obstacle in one of the maps only.
    """

    def __init__(self, maps: Sequence[BarrierMap]) -> None:
        """Take the maps; each may have MAX_CELLS cells and MAX_BARRIERS barriers."""
        self._maps = tuple(maps)
        self._samples = [
            (index, item.to_cell(sample.start), item.to_cell(sample.goal))
            for index, item in enumerate(maps)
            for sample in item.samples
        ]
        self._tiles = np.array([occupied_tiles(item.to_grid().blocked()) for item in maps])
        self._map_of = np.array([index for index, *_ in self._samples], dtype=np.intp)
        self._endpoints = np.array([relative(s, g, maps[i].size) for i, s, g in self._samples])
        self._solved: dict[int, SolvedSample | None] = {}

    def nearest(self, query: WaypointQuery) -> Iterator[SolvedSample]:
        """Yield solved samples, the most similar to a query first.

        Samples of the query's own map, at any scale, are left out, and so are those that cannot
        be solved within the bounds that prompts state. Of equally similar ones the first in the
        file comes first.
        """
        height, width = query.costmap.blocked.shape
        endpoints = relative(query.start, query.goal, (width, height))
        away = np.linalg.norm((self._endpoints - endpoints).reshape(-1, 2, 2), axis=2).sum(axis=1)
        differs = (self._tiles != occupied_tiles(query.costmap.blocked)).mean(axis=1)
        blocked = query.grid_map.blocked()
        own = [is_same_map(item, blocked) for item in self._maps]
        for index in np.argsort(away + differs[self._map_of], kind='stable').tolist():
            solved = None if own[self._map_of[index]] else self.solve(index)
            if solved is not None:
                yield solved

    def solve(self, index: int) -> SolvedSample | None:
        """Return a sample with its shortest path, None where a prompt can show none."""
        if index not in self._solved:
            map_index, *ends = self._samples[index]
            self._solved[index] = solve(self._maps[map_index], *ends)
        return self._solved[index]


def load_example_library(name: str, at_least: int) -> ExampleLibrary:
    """Load a dataset of barrier maps, a path or the name of one in `maps/`; '' is SAMPLES_FILE.

    One sample is solved at once, so that the search is compiled before the time of a query runs.
    Raises ExamplesError for a file that cannot be used or has fewer samples than `at_least`.
    """
    with raising(ExamplesError, 'examples_file: ', OSError, ValueError):
        path = find_file(name or SAMPLES_FILE, 'maps')
        maps = [item for item in load_barrier_maps(path) if item.samples]
    problem = problem_of_maps(maps, at_least)
    if problem:
        raise ExamplesError(f'examples_file: {path}: {problem}')
    library = ExampleLibrary(maps)
    library.solve(0)
    return library


def problem_of_maps(maps: Sequence[BarrierMap], at_least: int) -> str | None:
    """Say why maps cannot serve as examples, of which `at_least` so many are needed; else None."""
    count = sum(len(item.samples) for item in maps)
    if not at_least <= count <= MAX_SAMPLES:
        return f'samples: {count}, where {at_least} to {MAX_SAMPLES} are expected'
    sizes = [math.prod(item.size) for item in maps]
    if sum(sizes) > MAX_CELLS_OF_ALL:
        return f'{sum(sizes)} cells are more than {MAX_CELLS_OF_ALL}; choose fewer maps'
    for item, size in zip(maps, sizes):
        barriers = len(item.horizontal_barriers) + len(item.vertical_barriers)
        if size > MAX_CELLS:
            return f'map {item.id}: {size} cells are more than {MAX_CELLS}; choose smaller maps'
        if barriers > descriptions.MAX_BARRIERS:
            return f'map {item.id}: {barriers} barriers are more than {descriptions.MAX_BARRIERS}'
    return None


def solve(barrier_map: BarrierMap, start: Cell, goal: Cell) -> SolvedSample | None:
    """Return the shortest any-angle path between two cells with its description.

    None where there is no path, or where a corner is outside of the bounds that prompts state.
    """
    costmap = Costmap(barrier_map.to_grid())
    if costmap.blocked[start[1], start[0]] or costmap.blocked[goal[1], goal[0]]:
        return None
    corners, length = shortest_route(costmap, start, goal)
    if not np.isfinite(length):
        return None
    lattice = descriptions.Lattice(*barrier_map.offset)
    description = descriptions.describe(WaypointQuery(costmap, start, goal), lattice=lattice)
    cells = (start, *((round(x), round(y)) for x, y in corners), goal)
    path = tuple(map(description.lattice.to_lattice, cells))
    (x_min, x_max), (y_min, y_max) = description.x_bounds, description.y_bounds
    if not all(x_min <= x <= x_max and y_min <= y <= y_max for x, y in path[1:-1]):
        return None
    return SolvedSample(description, path)


def relative(start: Cell, goal: Cell, size: tuple[int, int]) -> Float64s:
    """Return x, y of the start and of the goal as parts of width and height: float64 [4]."""
    return np.array([*start, *goal]) / (*size, *size)


def occupied_tiles(blocked: Bools) -> Bools:
    """Return which tiles of a map hold a blocked cell, its outermost cells left aside.

    `blocked` is bool [height, width], the result bool [tiles], bottom row first.
    """
    rows, columns = np.nonzero(blocked[1:-1, 1:-1])
    across, up = TILES
    tiles = np.zeros((up, across), dtype=np.bool_)
    height, width = blocked.shape
    tiles[rows * up // max(1, height - 2), columns * across // max(1, width - 2)] = True
    return tiles.ravel()


def is_same_map(barrier_map: BarrierMap, blocked: Bools) -> bool:
    """Return whether a grid is this map at some scale: it is blocked along every barrier.

    A grid with more obstacles than the map counts too. `blocked` is bool [height, width].
    """
    height, width = blocked.shape
    factor = width // barrier_map.size[0]
    if factor < 1 or (width, height) != tuple(side * factor for side in barrier_map.size):
        return False
    scaled = barrier_map.scale(factor)
    x0, y0 = scaled.offset
    # The slices end with the grid, as the barriers of the published data do not.
    return all(
        lines[line - across : line - across + 1, first - along : last - along + 1].all()
        for lines, barriers, across, along in (
            (blocked, scaled.horizontal_barriers, y0, x0),
            (blocked.T, scaled.vertical_barriers, x0, y0),
        )
        for line, first, last in barriers
    )


@dataclass(frozen=True)
class Prompt:
    """How maps are put to a model; `form` is one of FORMS.

    With a `library`, the `retrieved` samples of it that are most similar to the query replace
    the template's own examples.
    """

    template: Template
    form: str = MESSAGE
    library: ExampleLibrary | None = None
    retrieved: int = 0

    @property
    def name(self) -> str:
        """The name in replies, rows and transcripts."""
        return self.template.prompt_name(self.form, self.retrieved)

    @property
    def digest(self) -> str:
        """The SHA-256 of the template's text."""
        return hashlib.sha256(self.template.text.encode()).hexdigest()

    def examples(
        self, query: WaypointQuery, description: descriptions.Description, max_tokens: int
    ) -> tuple[Example, ...] | None:
        """Return the retrieved examples, the most similar last; None for the template's own.

        The least similar are left out where they and the description would take more than about
        `max_tokens` tokens.
        """
        if self.library is None:
            return None
        left = int(max_tokens * descriptions.CHARS_PER_TOKEN)
        left -= sum(map(len, description.values().values()))
        found: list[Example] = []
        for solved in islice(self.library.nearest(query), self.retrieved):
            example = self.template.example(*solved)
            left -= sum(map(len, example))
            if left < 0:
                break
            found.append(example)
        return tuple(reversed(found))


ASK_FOR_A_LIST = (
    'That holds no list of points. Reply with the route alone, '
    'in the form "Generated Path: [[x1, y1], [x2, y2], ...]".'
)
# How questions began by which earlier versions asked a model to correct its route.
_DOES_NOT_WORK = 'This route does not work:'


def is_follow_up(text: str) -> bool:
    """Tell whether a message asks about an answer of the model, which stands before it."""
    return text == ASK_FOR_A_LIST or text.startswith(_DOES_NOT_WORK)
