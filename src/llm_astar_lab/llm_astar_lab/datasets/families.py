# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Families of grid maps drawn from a seed: rooms, mazes, warehouse aisles and floor plans.

A drawing is bool [height, width], True where blocked. A unit of the plan is one cell; scaled maps
have more cells a unit (`GridProblem.scale`).
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.problem_maps import draw_pairs
from llm_astar_planner.search.visibility import LineOfSightChecker
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from llm_astar_lab.datasets.generate import GenerationError

Blocked = NDArray[np.bool_]
# Cells a side of a drawn map.
DEFAULT_SIDE = 121
# Cells between start and goal, as the crow flies.
MIN_DISTANCE = 5.0
# Pairs that are drawn for one that is kept, and maps for one that has enough of them.
DRAWS_PER_PAIR, TRIES = 20, 20
# Aisles: units of a rack's depth, of the aisle beside it, and of a rack's length.
RACK_DEPTH, AISLE, RACK_LENGTH = 2, 3, 20
# Floor plans: the width of a corridor and a door, the shortest side of a room, and the side of an
# area above which it is divided by a corridor.
CORRIDOR, DOOR, MIN_ROOM, DIVIDED_BY_CORRIDOR = 3, 2, 8, 60


class Area(NamedTuple):
    """A rectangle of cells, the last row and column not included."""

    top: int
    left: int
    bottom: int
    right: int


def rooms(side: int, generator: np.random.Generator, room: int = 16) -> Blocked:
    """Return square rooms with thin walls, and a door in four of five walls."""
    blocked = np.zeros((side, side), dtype=np.bool_)
    blocked[::room] = blocked[:, ::room] = True
    for top in range(0, side - room, room):
        for left in range(0, side - room, room):
            y, x = generator.integers(1, room - 1, 2)
            if generator.random() < 0.8 and top:
                blocked[top, left + x : left + x + 2] = False
            if generator.random() < 0.8 and left:
                blocked[top + y : top + y + 2, left] = False
    return blocked


def maze(side: int, generator: np.random.Generator) -> Blocked:
    """Return a maze without loops, its ways and walls one cell wide."""
    count = (side - 1) // 2
    cells = np.arange(count * count).reshape(count, count)
    first = np.concatenate([cells[:, :-1].ravel(), cells[:-1].ravel()])
    second = np.concatenate([cells[:, 1:].ravel(), cells[1:].ravel()])
    weights = 1.0 + generator.random(len(first))
    tree = minimum_spanning_tree(
        coo_array((weights, (first, second)), shape=(count * count,) * 2)
    ).tocoo()
    blocked = np.ones((side, side), dtype=np.bool_)
    blocked[1 : 2 * count : 2, 1 : 2 * count : 2] = False
    (y, x), (to_y, to_x) = np.divmod(tree.row, count), np.divmod(tree.col, count)
    blocked[1 + y + to_y, 1 + x + to_x] = False
    return blocked


def aisles(side: int, generator: np.random.Generator) -> Blocked:
    """Return rows of racks with aisles between them, cross aisles, and pallets left in the way.

    The cross aisles are at other places in each row of racks.
    """
    blocked = np.zeros((side, side), dtype=np.bool_)
    for top in range(AISLE, side - AISLE, RACK_DEPTH + AISLE):
        begin = int(generator.integers(-RACK_LENGTH, AISLE))
        for left in range(begin, side, RACK_LENGTH + AISLE):
            if generator.random() < 0.95:
                blocked[top : top + RACK_DEPTH, max(left, 0) : left + RACK_LENGTH] = True
    for y, x in generator.integers(0, side, (side * side // 400, 2)):
        blocked[y, x] = True
    return blocked


def floor(side: int, generator: np.random.Generator) -> Blocked:
    """Return a floor plan: corridors, and rooms that doors connect with them and one another."""
    blocked = np.zeros((side, side), dtype=np.bool_)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    areas = [Area(1, 1, side - 1, side - 1)]
    while areas:
        areas += divide(blocked, areas.pop(), generator)
    return blocked


def divide(blocked: Blocked, area: Area, generator: np.random.Generator) -> list[Area]:
    """Divide the longer side of an area by a wall with a door, or by a corridor between two.

    Draws into `blocked` and returns the parts; none where the area is a room. No wall ends at the
    door of another one.
    """
    top, left, bottom, right = area
    if bottom - top > right - left:
        parts = divide(blocked.T, Area(left, top, right, bottom), generator)
        return [Area(part.left, part.top, part.right, part.bottom) for part in parts]
    width = CORRIDOR + 2 if right - left >= DIVIDED_BY_CORRIDOR else 1
    may_end: Blocked = np.logical_and(blocked[top - 1], blocked[bottom])
    columns = range(left + MIN_ROOM, right - MIN_ROOM - width + 1)
    at = [x for x in columns if may_end[[x, x + width - 1]].all()]
    if not at:
        return []
    x = at[int(generator.integers(len(at)))]
    for wall in dict.fromkeys((x, x + width - 1)):
        blocked[top:bottom, wall] = True
        doors = 1 + (bottom - top) // DIVIDED_BY_CORRIDOR
        for door in generator.integers(top, bottom - DOOR + 1, doors):
            blocked[door : door + DOOR, wall] = False
    return [Area(top, left, bottom, x), Area(top, x + width, bottom, right)]


FAMILIES: dict[str, Callable[[int, np.random.Generator], Blocked]] = {
    'rooms': rooms,
    'mazes': maze,
    'aisles': aisles,
    'floors': floor,
}


def generate_family(
    family: str, seed: int, maps: int, pairs: int, side: int = DEFAULT_SIDE
) -> Iterator[GridProblem]:
    """Yield `maps` maps of a family with ids from 0; the first n of a seed are always the same.

    Start and goal are connected, at least MIN_DISTANCE apart, and the straight line between them
    is blocked, as in the paper's dataset. Raises GenerationError where no map has enough pairs.
    """
    for map_id in range(maps):
        yield draw_problem(family, seed, map_id, pairs, side)


def draw_problem(family: str, seed: int, map_id: int, pairs: int, side: int) -> GridProblem:
    """Draw maps until one has enough pairs. Raises GenerationError after TRIES maps."""
    for attempt in range(TRIES):
        generator = np.random.default_rng([seed, map_id, attempt])
        blocked = FAMILIES[family](side, generator)
        grid_map = GridMap(np.where(blocked, OCCUPIED, FREE).astype(np.int8))
        # random.Random takes texts, so that each family has other pairs.
        draw = random.Random(f'{family}:{seed}:{map_id}:{attempt}')  # noqa: S311 - no secret
        drawn = draw_pairs(grid_map, DRAWS_PER_PAIR * pairs, draw.getrandbits(32))
        kept = hard_pairs(blocked, drawn)[:pairs]
        if len(kept) == pairs:
            return GridProblem(map_id, grid_map, tuple(kept), family=family)
    raise GenerationError(
        f'{family}: map {map_id}: none of {TRIES} maps of {side} x {side} cells has '
        f'{pairs} pairs; ask for fewer'
    )


def hard_pairs(blocked: Blocked, drawn: tuple[Sample, ...]) -> list[Sample]:
    """Return the pairs, each once, that are apart and whose straight line is blocked."""
    samples = [s for s in dict.fromkeys(drawn) if math.dist(s.start, s.goal) >= MIN_DISTANCE]
    if not samples:
        return []
    starts, goals = [s.start for s in samples], [s.goal for s in samples]
    clear = LineOfSightChecker(blocked).clear(starts, goals)
    return [sample for sample, is_clear in zip(samples, clear) if not is_clear]
