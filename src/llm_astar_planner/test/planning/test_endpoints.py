"""Tolerances: what becomes of a start and a goal that cannot be had."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.endpoints import nearest_labelled
from llm_astar_planner.planning.parameters import PLANNER, defaults
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode

RESOLUTION = 0.1


def planner(cells, **rules):
    return Planner(GridMap(np.array(cells, dtype=np.int8), RESOLUTION), CostmapConfig(**rules))


def empty(height=20, width=30):
    return np.zeros((height, width), dtype=np.int8)


def shelf():
    """A block with a free cell inside, which nothing reaches."""
    cells = empty()
    cells[5:12, 10:17] = 100
    cells[8, 13] = 0
    return cells


def test_a_goal_that_is_free_and_reached_stays_where_it_is():
    plan = planner(shelf()).plan(PlanRequest((2, 2), (25, 15), tolerance=1.0))
    assert (plan.goal, plan.goal_shift, plan.warnings) == ((25, 15), 0.0, ())


def test_an_occupied_goal_becomes_the_nearest_cell_the_start_reaches():
    """Not the free cell inside the shelf, which is nearer."""
    plan = planner(shelf()).plan(PlanRequest((2, 2), (14, 8), tolerance=0.5))
    assert plan.code is ResultCode.NONE
    assert plan.goal == (17, 8)
    assert plan.path[-1].tolist() == [17, 8]
    assert plan.goal_shift == pytest.approx(0.3)
    (warning,) = plan.warnings
    assert 'occupancy 100' in warning
    assert 'cell (17, 8) at (1.75, 0.85) m, 0.30 m off' in warning


def test_a_goal_that_is_cut_off_is_approached():
    plan = planner(shelf()).plan(PlanRequest((2, 2), (13, 8), tolerance=0.4))
    assert plan.code is ResultCode.NONE
    assert plan.goal_shift == pytest.approx(0.4)
    words = (
        'obstacles cut the goal cell (13, 8) at (1.35, 0.85) m off from the start cell (2, 2) at'
    )
    assert words in plan.warnings[0]


@pytest.mark.parametrize('fields', [{'goal': (30, 12)}, {'goal': (2, 9), 'via': ((30, 12),)}])
def test_a_goal_off_the_map_is_refused_whatever_the_tolerance(fields):
    plan = planner(empty()).plan(PlanRequest((2, 2), tolerance=0.6, **fields))
    assert plan.code is ResultCode.GOAL_OUTSIDE_MAP
    assert 'outside the map' in plan.message


@pytest.mark.parametrize(
    ('goal', 'code'),
    [
        ((14, 8), ResultCode.GOAL_OCCUPIED),
        ((13, 8), ResultCode.NO_VALID_PATH),
        ((40, 8), ResultCode.GOAL_OUTSIDE_MAP),
    ],
)
def test_a_goal_out_of_tolerance_keeps_its_own_code(goal, code):
    plan = planner(shelf()).plan(PlanRequest((2, 2), goal, tolerance=0.29))
    assert plan.code is code
    is_outside = code is ResultCode.GOAL_OUTSIDE_MAP
    assert ('outside the map' if is_outside else 'within 0.29 m') in plan.message
    assert plan.goal == goal


@pytest.mark.parametrize('far', [10**9, 10**18, -(10**300)])
def test_a_goal_very_far_away_is_outside_whatever_the_tolerance(far):
    for tolerance in (0.0, 1000.0):
        request = PlanRequest((2, 2), (far, far), tolerance=tolerance, start_tolerance=1.0)
        assert planner(shelf()).plan(request).code is ResultCode.GOAL_OUTSIDE_MAP


def test_a_start_in_inflation_is_moved_to_the_nearest_free_cell():
    cells = empty()
    cells[10, :20] = 100
    inflated = planner(cells, robot_radius=0.3)
    plan = inflated.plan(PlanRequest((5, 12), (25, 18), start_tolerance=0.5))
    assert plan.code is ResultCode.NONE
    assert plan.start == (5, 14)
    assert plan.path[0].tolist() == [5, 14]
    assert plan.start_shift == pytest.approx(0.2)
    assert 'start cell (5, 12) at (0.55, 1.25) m is not free' in plan.warnings[0]
    refused = inflated.plan(PlanRequest((5, 12), (25, 18)))
    assert refused.code is ResultCode.START_OCCUPIED
    assert "the robot's radius, 0.3 m" in refused.message
    near = inflated.plan(PlanRequest((5, 12), (25, 18), start_tolerance=0.1))
    assert near.code is ResultCode.START_OCCUPIED
    assert 'within 0.1 m' in near.message


def test_the_start_is_not_moved_through_a_wall():
    """Its own side has no free cell within reach, the other, the goal's, has: no way out."""
    cells = empty()
    cells[10] = 100
    cells[16] = 100
    walled = planner(cells, robot_radius=0.3)
    plan = walled.plan(PlanRequest((5, 11), (5, 2), start_tolerance=0.6))
    assert walled.costmap.blocked[11:16].all()
    assert plan.code is ResultCode.START_OCCUPIED


def test_a_start_on_an_obstacle_is_moved_to_the_nearest_side():
    cells = empty()
    cells[9:13, :20] = 100
    request = PlanRequest((5, 12), (5, 2), start_tolerance=0.6)
    plan = planner(cells).plan(request)
    assert plan.code is ResultCode.NONE
    assert plan.start == (5, 13)


def test_a_blocked_start_is_moved_to_a_cell_connected_to_the_goal():
    """A pocket is nearer, but the goal is not in it."""
    cells = empty()
    cells[3:8, 3:8] = 100
    cells[5, 5] = 0  # the pocket; the robot stands on (6, 5)
    cells[5, 6:8] = -1  # no obstacle, but not free either
    request = PlanRequest((6, 5), (20, 15), start_tolerance=0.3)
    plan = planner(cells, allow_unknown=False).plan(request)
    assert plan.code is ResultCode.NONE
    assert plan.start == (8, 5)
    cells[5, 7] = 100  # now the pocket is all there is
    plan = planner(cells, allow_unknown=False).plan(request)
    assert plan.code is ResultCode.NO_VALID_PATH
    assert plan.start == (6, 5)


def test_a_cell_connected_to_the_goal_is_preferred_to_one_connected_to_its_surroundings():
    cells = np.full((20, 30), -1)
    cells[5, 6] = 0  # nearer, and within the tolerance of the goal
    cells[8, 5:10] = 0
    request = PlanRequest((5, 5), (9, 8), start_tolerance=0.5, tolerance=0.5)
    plan = planner(cells, allow_unknown=False).plan(request)
    assert (plan.start, plan.goal) == ((5, 8), (9, 8))


def test_a_blocked_start_is_moved_to_a_cell_connected_to_one_within_the_goals_tolerance():
    cells = np.full((20, 30), -1)
    cells[13, 6:13] = 0  # nearer, but it ends 0.42 m off the goal
    cells[10, 8:14] = 0
    request = PlanRequest((5, 13), (15, 10), start_tolerance=0.5, tolerance=0.3)
    plan = planner(cells, allow_unknown=False).plan(request)
    assert (plan.start, plan.goal) == ((8, 10), (13, 10))


def test_a_start_is_moved_no_farther_than_its_tolerance_in_any_direction():
    cells = np.full((20, 30), -1)
    cells[13:, 13:] = 0  # 0.42 m off, aslant
    request = PlanRequest((10, 10), (20, 15), start_tolerance=0.3)
    assert planner(cells, allow_unknown=False).plan(request).code is ResultCode.START_OCCUPIED


def test_a_goal_moved_onto_the_start_is_one_cell():
    cells = empty()
    cells[:, 3] = 100
    plan = planner(cells).plan(PlanRequest((2, 2), (3, 2), tolerance=0.2))
    assert plan.code is ResultCode.NONE
    assert plan.path.tolist() == [[2, 2]]


@settings(max_examples=100)
@given(st.data())
def test_the_nearest_labelled_cell_is_the_nearest_by_brute_force(data):
    width, height = data.draw(st.integers(1, 40)), data.draw(st.integers(1, 40))
    random = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    labels = (random.random((height, width)) < data.draw(st.sampled_from([0.002, 0.3]))) * 7
    centre = data.draw(st.tuples(st.integers(-30, 60), st.integers(-30, 60)))
    reach = data.draw(st.integers(0, 3000))
    found = nearest_labelled(labels.astype(np.int32), 7, centre, reach)
    places = np.argwhere(labels == 7)[:, ::-1]
    least = ((places - centre) ** 2).sum(axis=1).min(initial=10**9)
    if least > reach:
        assert found is None
    else:
        assert labels[found[1], found[0]] == 7
        assert math.dist(found, centre) ** 2 == pytest.approx(least)


def test_a_robot_inside_the_marks_of_an_obstacle_plans_its_way_out_by_default():
    """As NavFn, which clears the robot's cell; on coarse cells no start is moved."""
    marked = np.zeros((40, 60), dtype=np.int8)
    y, x = np.ogrid[:40, :60]
    marked[(x - 20) ** 2 + (y - 20) ** 2 <= 3**2] = 100
    tolerance = defaults(PLANNER)['start_tolerance']
    request = PlanRequest((20, 20), (50, 20), start_tolerance=tolerance)
    plan = Planner(GridMap(marked, 0.05)).plan(request)
    assert plan.code is ResultCode.NONE, plan.message
    assert plan.start_shift == pytest.approx(0.05 * math.hypot(3, 1))
    assert '0.16 m off' in plan.warnings[0]
    coarse = Planner(GridMap(marked, 1.0)).plan(request)
    assert coarse.code is ResultCode.START_OCCUPIED
