"""Which straight lines between cells touch a wall."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.result import SearchStatus
from llm_astar_planner.search.visibility import LineOfSightChecker


def test_walls_join_touching_cells_and_nothing_else():
    blocked = np.zeros((7, 7), dtype=bool)
    blocked[3, 1:4] = True
    blocked[5, 5] = True
    line_of_sight = LineOfSightChecker(blocked)
    assert line_of_sight.clear(
        [[2, 1], [5, 1], [4, 3], [4, 6]], [[2, 6], [5, 4], [4, 5], [6, 4]]
    ).tolist() == [
        False,
        True,
        True,
        False,
    ]
    assert line_of_sight.clear_along([(0, 0), (6, 0), (6, 6)])
    assert not line_of_sight.clear_along([(0, 0), (float('nan'), 0)])


def test_the_ends_of_walls_are_listed_once():
    blocked = np.zeros((7, 7), dtype=bool)
    blocked[3, 1:4] = True
    blocked[3:6, 3] = True
    blocked[6, 6] = True
    assert LineOfSightChecker(blocked).ends.tolist() == [[1, 3], [3, 3], [3, 5], [6, 6]]


@given(st.integers(0, 2**32 - 1))
def test_where_a_line_is_free_cells_connect_its_ends(seed):
    random = np.random.default_rng(seed)
    blocked = random.random((8, 9)) < 0.3
    (x, y), (to_x, to_y) = random.integers(0, (9, 8), (2, 2)).tolist()
    blocked[[y, to_y], [x, to_x]] = False
    checker = LineOfSightChecker(blocked)
    seen = checker.clear([[x, y]], [[to_x, to_y]])[0]
    assert seen == checker.clear([[to_x, to_y]], [[x, y]])[0]
    if seen:
        path = exact_astar(blocked, (x, y), (to_x, to_y), corner_cutting=True)
        assert path.status is SearchStatus.FOUND
