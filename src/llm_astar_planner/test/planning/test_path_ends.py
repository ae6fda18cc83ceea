"""The exact start and goal at the ends of a path of cells."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.nodes.planner.publishers import cell_of, with_exact_ends
from llm_astar_planner.planning.path_validator import CollisionChecker
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.any_angle import interpolate, turning_points

FREE = CollisionChecker(GridMap(np.zeros((20, 20), dtype=np.int8)), CostmapConfig())


def ended(points, start=None, goal=None, checker=FREE):
    exact = [None if end is None else np.array(end, dtype=float) for end in (start, goal)]
    return with_exact_ends(np.array(points, dtype=float), *exact, checker).tolist()


def test_exact_ends_take_the_place_of_the_centres_of_their_cells():
    path = [[2, 2], [3, 3], [4, 3]]
    assert ended(path, (1.7, 2.4), (4.3, 2.6)) == [[1.7, 2.4], [3, 3], [4.3, 2.6]]
    assert ended(path, (2, 2), (4, 3)) == path
    assert ended(path, None, (4.3, 2.6)) == [[2, 2], [3, 3], [4.3, 2.6]]
    assert ended(path, (1.7, 2.4), None) == [[1.7, 2.4], [3, 3], [4, 3]]
    assert ended(path[:2], (2.4, 2.4), (2.6, 2.6)) == [[2.4, 2.4], [2.6, 2.6]]
    assert ended(path) == path


def test_a_path_of_one_cell_leads_from_one_pose_straight_to_the_other():
    assert ended([[2, 2]], (1.7, 2.4), (2.3, 1.6)) == [[1.7, 2.4], [2.3, 1.6]]
    assert ended([[2, 2]], (1.7, 2.4), (1.7, 2.4)) == [[1.7, 2.4]]
    assert ended([[2, 2]], None, (1.7, 2.4)) == [[1.7, 2.4]]
    assert ended([[2, 2]], (1.7, 2.4), None) == [[1.7, 2.4]]
    assert ended([[2, 2]]) == [[2, 2]]


def test_points_in_the_cell_of_the_end_are_left_out():
    """Those of a path at any angle lie anywhere: it must not go back from one to the goal."""
    assert ended([[2, 2], [4, 2], [4.8, 2], [5, 2]], None, (4.6, 2)) == [[2, 2], [4, 2], [4.6, 2]]


def test_a_line_that_would_cut_a_corner_leads_over_the_centre():
    cells = np.zeros((20, 20), dtype=np.int8)
    cells[3, 2] = cells[2, 3] = 100
    checker = CollisionChecker(GridMap(cells), CostmapConfig(corner_cutting=True))
    assert ended([[2, 2], [3, 3]], None, (3.4, 2.6), checker) == [[2, 2], [3, 3], [3.4, 2.6]]
    assert ended([[3, 3], [2, 2]], (3.4, 2.6), None, checker) == [[3.4, 2.6], [3, 3], [2, 2]]


coordinate = st.floats(-0.5, 19.4)
point = st.tuples(coordinate, coordinate).map(np.array)


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(point, point),
    st.sampled_from([0.0, 1.0]),
    st.booleans(),
    st.sampled_from([None, 2.5, 30.0]),
)
def test_every_line_to_an_exact_end_is_free(seed, ends, radius, any_angle, spacing):
    cells = np.random.default_rng(seed).choice([0, 0, 0, 0, 100], (20, 20)).astype(np.int8)
    planner = Planner(GridMap(cells), CostmapConfig(robot_radius=radius))
    start, goal = ends
    request = PlanRequest(cell_of(start), cell_of(goal), any_angle=any_angle)
    plan = planner.plan(request)
    if plan.code is not ResultCode.NONE:
        return
    corners = plan.any_angle.points if plan.any_angle is not None else turning_points(plan.path)
    written = plan.path if spacing is None else interpolate(corners, spacing)
    path = with_exact_ends(np.asarray(written, dtype=float), start, goal, planner.checker)
    np.testing.assert_allclose(path[[0, -1]], [start, goal], atol=1e-3)
    blocked = planner.costmap.blocked
    for begin, end in (path[:2], path[-2:]) if len(path) > 1 else ():
        for place in np.linspace(begin, end, 100):
            x, y = cell_of(place)
            near_border = np.abs(place - np.rint(place)).max() > 0.49
            assert near_border or not blocked[y, x]
