"""Which straight lines between cells touch a wall."""

from itertools import product

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.search.any_angle import LineOfSightChecker
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.result import SearchStatus


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


def touches_a_wall(blocked, line):
    """Tell the same by geometry: walls are lines between the centres of neighbours."""
    cells = [(x, y) for y, x in np.argwhere(blocked).tolist()]
    walls = [shapely.Point(cell) for cell in cells]
    walls += [
        shapely.LineString([(x, y), end])
        for x, y in cells
        for end in ((x + 1, y), (x, y + 1))
        if end in cells
    ]
    return any(shapely.LineString(line).intersects(wall) for wall in walls)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 8, 1 << 40]))
def test_lines_with_any_ends_are_those_that_touch_no_wall(seed, parts):
    random = np.random.default_rng(seed)
    blocked = random.random((6, 7)) < random.choice([0.1, 0.3, 0.6])
    begins, ends = np.rint(random.uniform(-2.0, 9.0, (2, 9, 2)) * parts) / parts
    begins += (begins == ends).all(axis=1)[:, None]
    free = LineOfSightChecker(blocked).clear(begins, ends)
    assert free.tolist() == [
        not touches_a_wall(blocked, line) for line in zip(begins.tolist(), ends.tolist())
    ]


def test_lines_far_off_the_map_take_no_longer():
    checker = LineOfSightChecker(np.ones((3, 4), dtype=bool))
    far = [(1e300, -1e300), (-1e300, 5e-324), (2.0**30, 9.0)]
    for begin, end in product(far, far):
        assert checker.clear([begin], [end]).shape == (1,)
    assert not checker.clear([(-1e300, 1.0)], [(1e300, 1.0)])[0]
    assert checker.clear([(-1e300, 3.0)], [(1e300, 3.0)])[0]
