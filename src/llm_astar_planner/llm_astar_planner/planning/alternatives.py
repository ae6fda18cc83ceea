# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Several ways to choose from: they pass obstacles on different sides, each is the best such one.

From each large obstacle a ray leads to the edge of the map. How often a path crosses each ray,
there less back, is its class: two paths between the same ends have the same class where they can
be moved into each other without passing over one of these obstacles (Bhattacharya, Kumar and
Likhachev, "Search-based path planning with homotopy class constraints", AAAI 2010). The next way
is the cheapest path of no class found before: of each class at least one crossing is excluded,
and which one is searched through best-first, with automata that count crossings.
"""

import heapq
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

import numpy as np

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.planning.types import Alternative, PlanRequest, Point
from llm_astar_planner.search.arrays import Bools, Int32s, StopFlag
from llm_astar_planner.search.automata import Automaton
from llm_astar_planner.search.product import ProductProblem, ProductTooLargeError, product_search
from llm_astar_planner.search.result import SearchStatus

# Obstacles that tell ways apart, the largest; they are at least so large, as a share of the
# straight line from start to goal.
MOST_OBSTACLES, LEAST_SHARE = 12, 0.05
# Crossings of one ray, there less back, up to which a path is followed.
MOST_CROSSINGS = 3
# Ways that cost more than so many times the best are none to choose from, nor those that cost more
# than it by over so large a part of the largest perimeter of the obstacles on the other side: the
# best way passes these, and such a way loops around them.
MOST_LONGER, MOST_AROUND = 2.0, 0.5
OTHER, LEFT, RIGHT = range(3)
ROUNDING = 1e-6

Class = tuple[int, ...]
# Of obstacles by number, how often a path may not cross their rays.
Excluded = dict[int, frozenset[int]]


class Ray(NamedTuple):
    """The half line up from a cell (x, y) of an obstacle.

    `centre` is that of the obstacle, in metres, `perimeter` that of the box around it, in cells.
    """

    x: int
    y: int
    centre: Point
    perimeter: float

    def sides(self, shape: tuple[int, ...]) -> tuple[Bools, Bools]:
        """Return the cells left and right of it, bool [height, width] each."""
        left, right = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
        left[self.y + 1 :, self.x], right[self.y :, self.x + 1] = True, True
        return left, right

    def crossings(self, path: Int32s) -> int:
        """Return how often a path [n, 2] crosses it to the right, less to the left."""
        (x, y), step = path.T, np.diff(path[:, 0])
        to_right = (x[:-1] == self.x) & (step == 1) & (y[:-1] > self.y)
        to_left = (x[1:] == self.x) & (step == -1) & (y[1:] > self.y)
        return int(to_right.sum() - to_left.sum())


def counting(number: int, excluded: frozenset[int]) -> Automaton:
    """Return what counts the crossings of a ray, of regions 2 * number and the next one.

    It accepts any number but the excluded ones.
    """
    numbers = [0, *(sign * n for n in range(1, MOST_CROSSINGS + 1) for sign in (1, -1))]
    states = [(crossed, side) for crossed in numbers for side in (OTHER, LEFT, RIGHT)]
    after = np.full((len(states) + 1, 4), len(states), dtype=np.int16)
    for state, (crossed, side) in enumerate(states):
        for side_after in (OTHER, LEFT, RIGHT):
            step = (side, side_after)
            then = crossed + (step == (LEFT, RIGHT)) - (step == (RIGHT, LEFT))
            if then in numbers:
                after[state, side_after] = states.index((then, side_after))
    accepting = np.array([crossed not in excluded for crossed, _ in states] + [False])
    return Automaton((2 * number, 2 * number + 1), after, accepting)


@dataclass(frozen=True, eq=False)
class AlternativesSearch:
    """Finds the best ways of different classes between the cells of a request."""

    costmap: Costmap
    request: PlanRequest
    stop: StopFlag
    deadline: float

    def rays(self) -> list[Ray]:
        """Return the rays of the largest obstacles that a path can go around."""
        # Between obstacles that touch at a corner a path passes only if it may cut corners.
        touching = None if self.costmap.config.corner_cutting else np.ones((3, 3))
        blocked = np.pad(self.costmap.blocked, 1, constant_values=True)
        labels, _ = ndimage.label(blocked, structure=touching)
        boxes = dict(enumerate(ndimage.find_objects(labels), start=1))
        del boxes[labels[0, 0]]
        extent = {n: max(part.stop - part.start for part in box) for n, box in boxes.items()}
        least = LEAST_SHARE * math.dist(self.request.start, self.request.goal)
        large = sorted((n for n in boxes if extent[n] >= least), key=lambda n: -extent[n])
        rays = []
        for number in large[:MOST_OBSTACLES]:
            y, x = np.nonzero(labels[1:-1, 1:-1] == number)
            top, perimeter = int(y.argmax()), 2.0 * float(np.ptp(x) + np.ptp(y) + 2)
            (centre,) = self.costmap.grid_map.grid_to_world([(x.mean(), y.mean())])
            rays.append(Ray(int(x[top]), int(y[top]), centre.round(3).tolist(), perimeter))
        return rays

    def ways(self) -> Iterator[Alternative]:
        """Yield the ways, the best first, until there is none or the time is over."""
        rays, found, numbers = self.rays(), set[Class](), count()
        tried: list[Excluded] = []
        queue: list[tuple[float, int, Excluded, Alternative, Class]] = []

        def push(excluded: Excluded) -> None:
            way = None if excluded in tried else self.best(rays, excluded)
            tried.append(excluded)
            if way is not None:
                crossed = tuple(ray.crossings(way.path) for ray in rays)
                heapq.heappush(queue, (way.cost, next(numbers), excluded, way, crossed))

        push({})
        first: Class = ()
        best = queue[0][0] if queue else 0.0
        while queue and queue[0][0] <= MOST_LONGER * best:
            _, _, excluded, way, crossed = heapq.heappop(queue)
            if crossed not in found:
                found.add(crossed)
                first = first or crossed
                others = [ray for ray, a, b in zip(rays, crossed, first) if a != b]
                around = max((ray.perimeter for ray in others), default=0.0)
                is_loop = way.cost > best + MOST_AROUND * around + ROUNDING
                if not is_loop and not crosses_itself(way.path):
                    yield way._replace(around=[ray.centre for ray in others])
            for number, crossing in enumerate(crossed):
                more = excluded.get(number, frozenset()) | {crossing}
                push({**excluded, number: more})

    def best(self, rays: list[Ray], excluded: Mapping[int, frozenset[int]]) -> Alternative | None:
        """Return the cheapest path with none of the excluded crossings, None for none in time."""
        shape, grid_map = self.costmap.blocked.shape, self.costmap.grid_map
        regions = [side for number in excluded for side in rays[number].sides(shape)]
        automata = [counting(place, crossed) for place, crossed in enumerate(excluded.values())]
        try:
            result = product_search(
                self.costmap.grid_graph, self.request.start, self.request.goal,
                ProductProblem(tuple(regions), tuple(automata)),
                stop=self.stop, deadline=self.deadline, want_expanded=False,
            )  # fmt: skip
        except ProductTooLargeError:
            return None
        if result.status is not SearchStatus.FOUND:
            return None
        metres = round(result.length * grid_map.resolution, 3)
        return Alternative(result.path, metres, result.cost, result.suboptimality_bound, [])


def crosses_itself(path: Int32s) -> bool:
    """Tell whether a path [n, 2] comes to a place where it was before."""
    # Cells, and the middles of moves, in which two diagonal ones may meet.
    places = np.concatenate((2 * path, path[:-1] + path[1:]))
    return len(np.unique(places, axis=0)) < len(places)
