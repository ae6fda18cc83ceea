"""Several ways to choose from: different around obstacles, each the best of its kind."""

import heapq
import math
from itertools import combinations, count, pairwise

import numpy as np
import pytest
from llm_astar_planner.planning.alternatives import MOST_AROUND, MOST_LONGER
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from scipy import ndimage

MOVES = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]


def obstacles(blocked):
    """One cell (x, y) of each obstacle that does not touch the edge of the map: its perimeter."""
    labels, _ = ndimage.label(np.pad(blocked, 1, constant_values=True), np.ones((3, 3)))
    inner = [number for number in np.unique(labels) if number not in (0, labels[0, 0])]
    cells = [np.argwhere(labels == number) for number in inner]
    return {tuple(own[0][::-1] - 1): 2 * (np.ptp(own, axis=0) + 1).sum() for own in cells}


def winding(path, cell):
    """How often a closed line of cells [n, 2] goes around a cell that is not on it."""
    angles = np.arctan2(path[:, 1] - cell[1], path[:, 0] - cell[0])
    steps = np.diff(np.append(angles, angles[0]))
    return round(float((((steps + math.pi) % (2 * math.pi)) - math.pi).sum() / (2 * math.pi)))


def crosses_itself(path):
    moves = [tuple(map(sum, zip(*pair))) for pair in pairwise(path)]
    places = [tuple(2 * value for value in cell) for cell in path] + moves
    return len(set(places)) < len(places)


def best_of_classes(blocked, start, goal):
    """Dijkstra over cells and angles around obstacles: the cheapest of each class, in order.

    Pairs of the cost and how often it goes around each obstacle, of those that cross themselves
    nowhere.
    """
    height, width = blocked.shape
    around = obstacles(blocked)
    numbers, queue, done, found = count(), [(0.0, 0, start, (0,) * len(around), None)], {}, {}
    while queue and queue[0][0] <= MOST_LONGER * next(iter(found.values()), (99.0,))[0] + 1e-6:
        cost, _, cell, sums, before = heapq.heappop(queue)
        if (cell, sums) in done:
            continue
        done[cell, sums] = before
        if cell == goal:
            path, at = [], (cell, sums)
            while at is not None:
                path.append(at[0])
                at = done[at]
            found[sums] = cost, not crosses_itself(path)
        x, y = cell
        for dx, dy in MOVES:
            new = x + dx, y + dy
            if not (0 <= new[0] < width and 0 <= new[1] < height) or blocked[new[1], new[0]]:
                continue
            if blocked[y, new[0]] or blocked[new[1], x]:
                continue
            # Crossings of the half line to the left of each obstacle's cell, just below its row:
            # the end in that row says on which side of the cell the move passes.
            crossed = [
                int((y, new[1]) == (oy, oy - 1) and x < ox)
                - int((y, new[1]) == (oy - 1, oy) and new[0] < ox)
                for ox, oy in around
            ]
            after = tuple(map(sum, zip(sums, crossed)))
            if max(map(abs, after), default=0) <= 1:
                entry = (cost + math.hypot(dx, dy), next(numbers), new, after, (cell, sums))
                heapq.heappush(queue, entry)
    return [(cost, sums) for sums, (cost, simple) in found.items() if simple]


def random_maps(seed, number, size=11):
    random = np.random.default_rng(seed)
    while number:
        blocked = np.zeros((size, size), dtype=bool)
        for _ in range(random.integers(1, 5)):
            x, y, width, height = *random.integers(1, size - 2, 2), *random.integers(1, 4, 2)
            blocked[y : y + height, x : x + width] = True
        start, goal = (0, int(random.integers(size))), (size - 1, int(random.integers(size)))
        if not blocked[start[1], start[0]] and not blocked[goal[1], goal[0]]:
            number -= 1
            yield blocked, start, goal


def check(blocked, start, goal, wanted=4):
    """The ways are the cheapest of all classes, in order, and no two are of one class."""
    request = PlanRequest(start, goal, alternatives=wanted, time_limit=60.0)
    plan = Planner(blocked).plan(request)
    if plan.code:
        return False
    found, around = [way.cost for way in plan.alternatives], obstacles(blocked)
    classes = best_of_classes(blocked, start, goal)
    least = classes[0][0]

    def sensible(best):
        """Return the costs of ways that go around what the best way goes around."""
        for cost, sums in classes:
            other = [own != its for own, its in zip(sums, best)]
            perimeters = np.array([*around.values()])[other]
            most = least + MOST_AROUND * perimeters.max(initial=0)
            if cost <= min(most, MOST_LONGER * least) + 1e-6:
                yield cost

    # Several may be equally short.
    bests = [sums for cost, sums in classes if cost <= least + 1e-6]
    expected = [list(sensible(best))[:wanted] for best in bests]
    for one, other in combinations(plan.alternatives, 2):
        loop = np.concatenate((one.path, other.path[-2:0:-1]))
        assert any(winding(loop, cell) for cell in around)
    assert any(found == pytest.approx(costs) for costs in expected)
    return True


@pytest.mark.parametrize('seed', range(3))
def test_the_ways_are_the_cheapest_of_each_class_on_small_maps(seed):
    assert sum(check(*case) for case in random_maps(seed, 8)) >= 6


def test_a_loop_around_what_the_best_way_only_passes_is_no_way_to_choose():
    blocked = np.zeros((40, 60), dtype=bool)
    blocked[18:23, 20:26] = True  # on the straight line
    blocked[32:36, 35:39] = True  # far beside it
    blocked[2:6, 40:44] = True  # and on the other side
    plan = Planner(blocked).plan(PlanRequest((2, 20), (57, 20), alternatives=5))
    assert len(plan.alternatives) == 2
    assert [len(way.around) for way in plan.alternatives] == [0, 1]
    x, y = plan.alternatives[1].around[0]
    assert 20 <= x <= 26
    assert 18 <= y <= 23


@pytest.mark.slow
def test_they_are_on_two_hundred_maps():
    assert sum(check(*case) for case in random_maps(9, 230)) >= 200
