"""Make a dataset by the recipe of the paper's appendix, seeded, with a stated rule of selection.

A map gets one to four horizontal and one to four vertical barriers at random. Start and goal are
free cells whose straight line is blocked and between which a path exists. The paper chose its
maps by hand; here a map is kept when its barriers make the way long enough (`MapRules`).
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Point, Sample
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner.search.paper import SearchOptions, astar
from llm_astar_planner.search.result import SearchStatus
from llm_astar_planner.search.visibility import LineOfSightChecker

# How often a random draw is repeated before the map is given up.
TRIES = 2000


class GenerationError(ValueError):
    """A dataset that cannot be made as asked."""


@dataclass(frozen=True)
class MapRules:
    """What a generated map must be like.

    `size` is the paper's: 50 x 30 spans the lattice points 0..50 and 0..30. Barriers are at least
    `min_barrier` long and parallel ones `min_gap` apart. Start and goal are `min_distance` apart.
    A map is interesting when at least `min_reachable` of its free cells hang together and its
    pairs' shortest paths are on average at least `min_detour` times as long as on an empty map.
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
    """Yield `maps` maps with ids from 0; the first n of a seed do not depend on how many follow.

    Raises GenerationError where the rules leave no map to be found.
    """
    rules = rules or MapRules()
    if min(rules.size) < 10:
        raise GenerationError(f'size: {rules.size} is too small; 10 x 10 is the least')
    for map_id in range(maps):
        # random.Random keeps its sequence from one Python to the next.
        draw = random.Random(f'{seed}:{map_id}')  # noqa: S311 - no secret
        yield _interesting_map(draw, map_id, rules)


def detour(barrier_map: BarrierMap) -> float:
    """Return the mean over the samples of shortest path / path on an empty map, both on cells.

    Infinite where a sample has no path; 1 where no barrier is in any way.
    """
    blocked = barrier_map.to_grid().blocked()
    ratios = [
        _shortest(blocked, barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal))
        / max(octile(sample.start, sample.goal), 1e-9)
        for sample in barrier_map.samples
    ]
    return float(np.mean(ratios)) if ratios else 1.0


def octile(start: Point, goal: Point) -> float:
    """Return the length of a shortest 8-connected path on an empty map, in cells."""
    dx, dy = abs(start[0] - goal[0]), abs(start[1] - goal[1])
    return max(dx, dy) + (math.sqrt(2.0) - 1.0) * min(dx, dy)


def query_sentence(barrier_map: BarrierMap, start: Point, goal: Point) -> str:
    """Put a sample in the words of the paper's dataset."""
    (x_min, x_max), (y_min, y_max) = barrier_map.range_x, barrier_map.range_y
    horizontal = [list(barrier) for barrier in barrier_map.horizontal_barriers]
    vertical = [list(barrier) for barrier in barrier_map.vertical_barriers]
    return (
        f'design a path from {list(start)} to {list(goal)} on a {x_max - x_min} by '
        f'{y_max - y_min} grid that avoids horizontal barriers centered at {horizontal} '
        f'and vertical barriers at {vertical}.'
    )


def _interesting_map(draw: random.Random, map_id: int, rules: MapRules) -> BarrierMap:
    for _ in range(TRIES):
        empty = _barriers(draw, map_id, rules)
        samples = _samples(draw, empty, rules)
        if len(samples) < rules.pairs:
            continue
        barrier_map = BarrierMap(
            empty.id,
            empty.range_x,
            empty.range_y,
            empty.horizontal_barriers,
            empty.vertical_barriers,
            tuple(Sample(*pair, query_sentence(empty, *pair)) for pair in samples),
        )
        if detour(barrier_map) >= rules.min_detour:
            return barrier_map
    message = f'map {map_id}: none of {TRIES} random maps fits {rules}'
    raise GenerationError(message)


def _barriers(draw: random.Random, map_id: int, rules: MapRules) -> BarrierMap:
    """Draw a map without samples."""
    width, height = rules.size
    horizontal = _parallel_barriers(draw, height, width, rules)
    vertical = _parallel_barriers(draw, width, height, rules)
    return BarrierMap(map_id, (0, width + 1), (0, height + 1), horizontal, vertical)


def _parallel_barriers(
    draw: random.Random, across: int, along: int, rules: MapRules
) -> tuple[Barrier, ...]:
    """Draw barriers on inner lines, none touching another."""
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


def _samples(
    draw: random.Random, barrier_map: BarrierMap, rules: MapRules
) -> list[tuple[Point, Point]]:
    """Draw start-goal pairs, fewer than asked where the map does not offer them."""
    blocked = barrier_map.to_grid().blocked()
    labels, _ = ndimage.label(~blocked, structure=np.ones((3, 3)))
    sizes = np.bincount(labels[~blocked])
    if sizes.max() < rules.min_reachable * sizes.sum():
        return []
    walls = LineOfSightChecker(blocked)
    pairs: list[tuple[Point, Point]] = []
    for _ in range(TRIES):
        start, goal = _free_cell(draw, blocked), _free_cell(draw, blocked)
        solvable = labels[start[::-1]] == labels[goal[::-1]]
        apart = math.dist(start, goal) >= rules.min_distance
        if solvable and apart and (start, goal) not in pairs:
            if not walls.clear([start], [goal])[0]:
                pairs.append((start, goal))
            if len(pairs) == rules.pairs:
                break
    return pairs


def _free_cell(draw: random.Random, blocked: NDArray[np.bool_]) -> Point:
    height, width = blocked.shape
    while True:
        x, y = draw.randrange(width), draw.randrange(height)
        if not blocked[y, x]:
            return x, y


def _shortest(blocked: NDArray[np.bool_], start: Point, goal: Point) -> float:
    result = astar(blocked, start, goal, [], SearchOptions(heuristic='octile'))
    return result.length if result.status is SearchStatus.FOUND else math.inf
