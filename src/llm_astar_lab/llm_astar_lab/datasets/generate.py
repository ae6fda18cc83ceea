# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Draws datasets by the recipe of the paper's appendix, and of grids.

A map gets one to four horizontal and one to four vertical barriers at random. Start and goal are
connected free cells whose straight line is blocked. The paper chose its maps by hand; here a map
is kept if its barriers make the paths long enough (`MapRules`).
"""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Point, Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.problem_maps import draw_pairs
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search.any_angle import LineOfSightChecker
from llm_astar_planner.search.arrays import Bools
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.paper import astar
from llm_astar_planner.search.problem import SearchProblem
from llm_astar_planner.search.result import SearchStatus
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

# Random draws before a map is given up.
TRIES = 2000


class GenerationError(LlmAstarError, ValueError):
    """A dataset cannot be generated as asked."""


@dataclass(frozen=True)
class MapRules:
    """The rules that a generated map obeys; lengths are in cells.

    The default `size` is the paper's: 50 x 30 spans the lattice points 0..50 and 0..30. Barriers
    are at least `min_barrier` long, parallel ones at least `min_gap` apart, start and goal at
    least `min_distance` apart. A map is kept if at least the share `min_reachable` of its free
    cells is connected and the shortest paths of its pairs are on average at least `min_detour`
    times as long as on an empty map.
    """

    size: Point = (50, 30)
    pairs: int = 10
    most_barriers: int = 4
    min_barrier: int = 3
    min_gap: int = 2
    min_distance: float = 5.0
    min_reachable: float = 0.9
    min_detour: float = 1.15


def generate(seed: int, maps: int = 100, rules: MapRules | None = None) -> Iterator[BarrierMap]:
    """Yield `maps` maps with ids from 0; the first n maps of a seed are always the same.

    Raises GenerationError where no map is found that obeys the rules.
    """
    rules = rules or MapRules()
    if min(rules.size) < 10:
        raise GenerationError(f'size: {rules.size} is too small; the minimum is 10 x 10')
    for map_id in range(maps):
        # random.Random gives the same sequence in every version of Python.
        draw = random.Random(f'{seed}:{map_id}')  # noqa: S311 - no secret
        yield draw_map(draw, map_id, rules)


def detour(barrier_map: BarrierMap) -> float:
    """Return the mean over the samples of shortest path / shortest path on an empty map.

    It is infinite where a sample has no path, and 1 where no barrier is in the way.
    """
    grid = GridGraph(barrier_map.to_grid().blocked(), corner_cutting=True)
    ratios = []
    for sample in barrier_map.samples:
        start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
        result = astar(SearchProblem(grid, start, goal, heuristic='octile'))
        length = result.length if result.status is SearchStatus.FOUND else math.inf
        ratios.append(length / max(octile(sample.start, sample.goal), 1e-9))
    return float(np.mean(ratios)) if ratios else 1.0


def octile(start: Point, goal: Point) -> float:
    """Return the length of a shortest 8-connected path on an empty map, in cells."""
    dx, dy = abs(start[0] - goal[0]), abs(start[1] - goal[1])
    return max(dx, dy) + (math.sqrt(2.0) - 1.0) * min(dx, dy)


def query_sentence(barrier_map: BarrierMap, start: Point, goal: Point) -> str:
    """Return the query of a sample, worded as in the paper's dataset."""
    width, height = barrier_map.size
    horizontal = list(map(list, barrier_map.horizontal_barriers))
    vertical = list(map(list, barrier_map.vertical_barriers))
    return (
        f'design a path from {list(start)} to {list(goal)} on a {width} by {height} grid that '
        f'avoids horizontal barriers centered at {horizontal} and vertical barriers at {vertical}.'
    )


def draw_map(draw: random.Random, map_id: int, rules: MapRules) -> BarrierMap:
    """Draw maps until one obeys the rules. Raises GenerationError after TRIES maps."""
    width, height = rules.size
    for _ in range(TRIES):
        horizontal = draw_parallel_barriers(draw, height, width, rules)
        vertical = draw_parallel_barriers(draw, width, height, rules)
        empty = BarrierMap(map_id, (0, width + 1), (0, height + 1), horizontal, vertical)
        samples = draw_samples(draw, empty, rules)
        if len(samples) < rules.pairs:
            continue
        named = (Sample(*pair, query_sentence(empty, *pair)) for pair in samples)
        barrier_map = replace(empty, samples=tuple(named))
        if detour(barrier_map) >= rules.min_detour:
            return barrier_map
    raise GenerationError(f'map {map_id}: none of {TRIES} random maps fits {rules}')


def draw_parallel_barriers(
    draw: random.Random, across: int, along: int, rules: MapRules
) -> tuple[Barrier, ...]:
    """Draw barriers on inner lines, at least `min_gap` apart."""
    wanted = draw.randint(1, rules.most_barriers)
    barriers: list[Barrier] = []
    lines: list[shapely.LineString] = []
    for _ in range(TRIES):
        first, last = sorted((draw.randint(0, along), draw.randint(0, along)))
        barrier = Barrier(draw.randint(1, across - 1), first, last)
        line = shapely.LineString([(first, barrier.line), (last, barrier.line)])
        near = any(line.distance(other) < rules.min_gap for other in lines)
        if last - first >= rules.min_barrier and not near:
            barriers.append(barrier)
            lines.append(line)
        if len(barriers) == wanted:
            break
    return tuple(barriers)


def draw_samples(
    draw: random.Random, barrier_map: BarrierMap, rules: MapRules
) -> list[tuple[Point, Point]]:
    """Draw start-goal pairs; fewer than asked where the map has no more of them."""
    blocked = barrier_map.to_grid().blocked()
    labels, _ = ndimage.label(~blocked, structure=np.ones((3, 3)))
    sizes = np.bincount(labels[~blocked])
    if sizes.max() < rules.min_reachable * sizes.sum():
        return []
    line_of_sight = LineOfSightChecker(blocked)
    pairs: list[tuple[Point, Point]] = []
    for _ in range(TRIES):
        start, goal = draw_free_cell(draw, blocked), draw_free_cell(draw, blocked)
        solvable = labels[start[::-1]] == labels[goal[::-1]]
        apart = math.dist(start, goal) >= rules.min_distance
        if solvable and apart and (start, goal) not in pairs:
            if not line_of_sight.clear([start], [goal])[0]:
                pairs.append((start, goal))
            if len(pairs) == rules.pairs:
                break
    return pairs


def draw_free_cell(draw: random.Random, blocked: Bools) -> Point:
    """Draw a free cell (x, y)."""
    height, width = blocked.shape
    while True:
        x, y = draw.randrange(width), draw.randrange(height)
        if not blocked[y, x]:
            return x, y


# Cells a side of a drawn map.
DEFAULT_SIDE = 121
# Cells between start and goal, as the crow flies.
MIN_DISTANCE = 5.0
# Pairs that are drawn for one that is kept, and maps for one that has enough of them.
DRAWS_PER_PAIR, GRID_TRIES = 20, 20
# Aisles: units of a rack's depth, of the aisle beside it, and of a rack's length.
RACK_DEPTH, AISLE, RACK_LENGTH = 2, 3, 20
# Floor plans: the width of a corridor and a door, the shortest side of a room, and the side of an
# area above which it is divided by a corridor.
CORRIDOR, DOOR, MIN_ROOM, DIVIDED_BY_CORRIDOR = 3, 2, 8, 60


# A rectangle of cells: top, left, bottom and right, the last row and column not included.
Area = tuple[int, int, int, int]


def rooms(side: int, generator: np.random.Generator, room: int = 16) -> Bools:
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


def maze(side: int, generator: np.random.Generator) -> Bools:
    """Return a maze without loops, its ways and walls one cell wide."""
    count = (side - 1) // 2
    cells = np.arange(count * count).reshape(count, count)
    first = np.concatenate([cells[:, :-1].ravel(), cells[:-1].ravel()])
    second = np.concatenate([cells[:, 1:].ravel(), cells[1:].ravel()])
    weights = 1.0 + generator.random(len(first))
    graph = coo_array((weights, (first, second)), shape=(count * count,) * 2)
    tree = minimum_spanning_tree(graph).tocoo()
    blocked = np.ones((side, side), dtype=np.bool_)
    blocked[1 : 2 * count : 2, 1 : 2 * count : 2] = False
    (y, x), (to_y, to_x) = np.divmod(tree.row, count), np.divmod(tree.col, count)
    blocked[1 + y + to_y, 1 + x + to_x] = False
    return blocked


def aisles(side: int, generator: np.random.Generator) -> Bools:
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


def floor(side: int, generator: np.random.Generator) -> Bools:
    """Return a floor plan: corridors, and rooms that doors connect with them and one another."""
    blocked = np.zeros((side, side), dtype=np.bool_)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    areas = [(1, 1, side - 1, side - 1)]
    while areas:
        areas += divide(blocked, areas.pop(), generator)
    return blocked


def divide(blocked: Bools, area: Area, generator: np.random.Generator) -> list[Area]:
    """Divide the longer side of an area by a wall with a door, or by a corridor between two.

    Draws into `blocked` and returns the parts; none where the area is a room. No wall ends at the
    door of another one.
    """
    top, left, bottom, right = area
    if bottom - top > right - left:
        parts = divide(blocked.T, (left, top, right, bottom), generator)
        return [(y, x, to_y, to_x) for x, y, to_x, to_y in parts]
    width = CORRIDOR + 2 if right - left >= DIVIDED_BY_CORRIDOR else 1
    may_end: Bools = np.logical_and(blocked[top - 1], blocked[bottom])
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
    return [(top, left, bottom, x), (top, x + width, bottom, right)]


FAMILIES = {'rooms': rooms, 'mazes': maze, 'aisles': aisles, 'floors': floor}


def generate_family(
    family: str, seed: int, maps: int, pairs: int, side: int = DEFAULT_SIDE
) -> Iterator[GridProblem]:
    """Draw `maps` maps of a family with ids from 0; the first n of a seed are always the same.

    Start and goal are connected, at least MIN_DISTANCE apart, and the straight line between them
    is blocked, as in the paper's dataset. Raises GenerationError where no map has enough pairs.
    """
    return (draw_problem(family, seed, map_id, pairs, side) for map_id in range(maps))


def draw_problem(family: str, seed: int, map_id: int, pairs: int, side: int) -> GridProblem:
    """Draw maps until one has enough pairs. Raises GenerationError after GRID_TRIES maps."""
    for attempt in range(GRID_TRIES):
        generator = np.random.default_rng([seed, map_id, attempt])
        blocked = FAMILIES[family](side, generator)
        grid_map = GridMap(np.where(blocked, OCCUPIED, FREE).astype(np.int8))
        # random.Random takes texts, so that each family has other pairs.
        draw = random.Random(f'{family}:{seed}:{map_id}:{attempt}')  # noqa: S311 - no secret
        drawn = draw_pairs(grid_map, DRAWS_PER_PAIR * pairs, draw.getrandbits(32))
        kept = hard_pairs(blocked, drawn)[:pairs]
        if len(kept) == pairs:
            return GridProblem(map_id, grid_map, tuple(kept), family=family)
    what = f'none of {GRID_TRIES} maps of {side} x {side} cells has {pairs} pairs'
    raise GenerationError(f'{family}: map {map_id}: {what}; ask for fewer')


def hard_pairs(blocked: Bools, drawn: tuple[Sample, ...]) -> list[Sample]:
    """Return the pairs, each once, that are apart and whose straight line is blocked."""
    samples = [s for s in dict.fromkeys(drawn) if math.dist(s.start, s.goal) >= MIN_DISTANCE]
    if not samples:
        return []
    starts, goals = [s.start for s in samples], [s.goal for s in samples]
    clear = LineOfSightChecker(blocked).clear(starts, goals)
    return [sample for sample, is_clear in zip(samples, clear) if not is_clear]
