import re

import numpy as np
import pytest
from llm_astar_planner.validator import path_problem

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
    ],
)
def test_every_kind_of_bad_path_is_named(path, word):
    found = problem(path)
    assert found is not None
    assert re.search(word, found)


def test_corners_may_be_cut_where_the_rules_allow_it():
    assert problem([[1, 1], [2, 1], [3, 2], [3, 3]], corner_cutting=True) is None
