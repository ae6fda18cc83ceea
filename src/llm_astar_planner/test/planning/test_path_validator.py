"""The last check against the rules taken one by one, and straight segments against geometry."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from grids import checker_of
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.path_validator import (
    CollisionChecker,
    shift_problem,
    via_problem,
)
from scipy.spatial import cKDTree

BLOCKED = np.zeros((5, 6), dtype=bool)
BLOCKED[2, 2] = True
GOOD = [[1, 1], [2, 1], [3, 1], [3, 2], [3, 3]]


def problem(path, corner_cutting=False, start=(1, 1), goal=(3, 3)):
    cells = np.array(path, dtype=np.int32).reshape(-1, 2)
    checker = checker_of(BLOCKED, corner_cutting=corner_cutting)
    return checker.path_problem(cells, start, goal)


def test_a_good_path_has_no_problem():
    assert problem(GOOD) is None
    assert problem([[1, 1]], goal=(1, 1)) is None


@pytest.mark.parametrize(
    ('path', 'word'),
    [
        ([], 'empty'),
        (GOOD[1:], 'runs from'),
        (GOOD[:-1], 'runs from'),
        ([[1, 1], [2, 2], [3, 3]], r'obstacle at \(2, 2\)'),
        ([[1, 1], [3, 1], [3, 2], [3, 3]], r'jumps after \(1, 1\)'),
        ([[1, 1], [1, 1], *GOOD[1:]], 'jumps'),
        ([[1, 1], [2, 1], [3, 2], [3, 3]], r'corner after \(2, 1\)'),
        ([[1, 1], [0, 0], [-1, 0], [0, 0], [1, 1], *GOOD[1:]], r'leaves the map at \(-1, 0\)'),
        ([[1, 1], [5, 1], [6, 1], [3, 3]], r'leaves the map at \(6, 1\)'),
        ([[1, 1], [1, 4], [1, 5], [3, 3]], r'leaves the map at \(1, 5\)'),
        ([[1, 1], [1, 2], [2, 1], *GOOD[2:]], r'corner after \(1, 2\)'),
    ],
)
def test_every_kind_of_bad_path_is_named(path, word):
    found = problem(path)
    assert found is not None
    assert re.search(word, found)


def test_corners_may_be_cut_where_the_rules_allow_it():
    assert problem([[1, 1], [2, 1], [3, 2], [3, 3]], corner_cutting=True) is None


def test_via_cells_are_passed_in_their_order():
    path = np.array(GOOD)
    assert via_problem(path, [(2, 1), (2, 1), (3, 2)]) is None
    assert 'via 2 (2, 1)' in via_problem(path, [(3, 2), (2, 1)])


def test_an_end_is_moved_no_farther_than_allowed():
    assert shift_problem('goal', (0, 0), (2, 0), 2.0) is None
    assert 'goal (2, 1) is 2.24 cells off' in shift_problem('goal', (0, 0), (2, 1), 2.2)


def meets(begin, end, blocked, corner_cutting):
    """Whether a segment passes through a blocked cell's inside, or by one's corner."""
    segment = shapely.LineString([begin, end])
    for y, x in np.argwhere(blocked):
        square = shapely.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5)
        if segment.intersection(square).length > 1e-6 or tuple(begin) == (x, y):
            return True
        corners = shapely.points(list(square.exterior.coords))
        if not corner_cutting and (shapely.distance(corners, segment) < 1e-9).any():
            return True
    return False


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.tuples(st.integers(0, 8), st.integers(0, 6)), min_size=2, max_size=3),
    st.booleans(),
)
def test_segments_are_stopped_by_the_cells_and_corners_they_meet(seed, points, corner_cutting):
    blocked = np.random.default_rng(seed).random((7, 9)) < 0.08
    problem = checker_of(blocked, corner_cutting=corner_cutting).segments_problem(np.array(points))
    met = any(meets(*segment, blocked, corner_cutting) for segment in pairwise(points))
    assert (problem is not None) == met


def random_map(seed):
    """A map of any size, as full as chance has it, and a checker with any radius for it."""
    random = np.random.default_rng(seed)
    shape = random.integers(1, 90, 2)
    share = random.choice([0.0, 0.0005, 0.01, 0.2])
    cells = np.where(random.random(shape) < share, 100, random.choice([0, 0, 0, -1], shape))
    grid_map = GridMap(cells.astype(np.int8), float(random.choice([0.05, 0.3])))
    radius, allow_unknown = float(random.choice([0.0, 0.1, 0.35, 2.0])), bool(random.integers(2))
    return grid_map, CostmapConfig(robot_radius=radius, allow_unknown=allow_unknown), random


def distances_to_lethal(grid_map):
    """The distance of every cell to the nearest lethal one, by a k-d tree."""
    lethal = np.argwhere(grid_map.cells >= 65)
    if len(lethal) == 0:
        return np.full(grid_map.cells.shape, np.inf)
    every = np.argwhere(np.ones(grid_map.cells.shape, dtype=bool))
    return cKDTree(lethal).query(every)[0].reshape(grid_map.cells.shape)


def random_walk(shape, random):
    """A path of single moves that mostly goes on as before: int32 [n, 2]."""
    cell, step = random.integers(0, shape[::-1]), random.integers(-1, 2, 2)
    path = [cell]
    for _ in range(random.integers(0, 120)):
        if random.random() < 0.2 or not step.any():
            step = random.integers(-1, 2, 2)
        following = path[-1] + step
        if step.any() and (following >= 0).all() and (following < shape[::-1]).all():
            path.append(following)
    return np.array(path, dtype=np.int32)


@pytest.mark.parametrize('seed', range(150))
def test_clearance_and_blocked_cells_are_those_of_a_k_d_tree(seed):
    grid_map, config, random = random_map(seed)
    checker, least = CollisionChecker(grid_map, config), distances_to_lethal(grid_map)
    radius = config.robot_radius / grid_map.resolution
    blocked = least <= (radius + 1e-7 if radius else 0.0)
    if not config.allow_unknown:
        blocked |= grid_map.cells < 0
    for y, x in np.argwhere(least >= 0.0)[random.permutation(least.size)[:100]].tolist():
        cell = np.array([[x, y]])
        clearance = least[y, x] * grid_map.resolution
        assert checker.measure(cell).clearance == pytest.approx(clearance)
        problem = checker.path_problem(cell, (x, y), (x, y))
        assert (problem is not None) == blocked[y, x]
    for _ in range(20):
        path = random_walk(grid_map.cells.shape, random)
        x, y = path.T
        clearance = least[y, x].min() * grid_map.resolution
        assert checker.measure(path).clearance == pytest.approx(clearance)
        start, goal = tuple(path[0]), tuple(path[-1])
        for corner_cutting in (True, False):
            rules = replace(config, corner_cutting=corner_cutting)
            found = CollisionChecker(grid_map, rules).path_problem(path, start, goal)
            assert found == expected_problem(path, blocked, corner_cutting)


def expected_problem(path, blocked, corner_cutting):
    """What is wrong with a path of single moves on the map, cell by cell."""
    for x, y in path:
        if blocked[y, x]:
            return f'it hits an obstacle at ({x}, {y})'
    for (x, y), (to_x, to_y) in pairwise(path):
        if not corner_cutting and (blocked[y, to_x] or blocked[to_y, x]):
            return f'it cuts a corner after ({x}, {y})'
    return None


def test_a_segment_off_the_map_is_a_problem():
    problem = checker_of(BLOCKED).segments_problem(np.array([[1, 1], [9, 1]]))
    assert problem == 'the segment from (1, 1) leaves the map at (6, 1)'
