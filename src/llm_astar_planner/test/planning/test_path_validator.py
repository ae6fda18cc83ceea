"""The last check against the rules taken one by one, and straight segments against geometry."""

import re
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.planning.path_validator import (
    path_problem,
    segments_problem,
    shift_problem,
    via_problem,
)

BLOCKED = np.zeros((5, 6), dtype=bool)
BLOCKED[2, 2] = True
GOOD = [[1, 1], [2, 1], [3, 1], [3, 2], [3, 3]]


def problem(path, corner_cutting=False, start=(1, 1), goal=(3, 3)):
    cells = np.array(path, dtype=np.int32).reshape(-1, 2)
    return path_problem(cells, BLOCKED, start, goal, corner_cutting=corner_cutting)


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
    problem = segments_problem(np.array(points), blocked, corner_cutting=corner_cutting)
    met = any(meets(*segment, blocked, corner_cutting) for segment in pairwise(points))
    assert (problem is not None) == met
