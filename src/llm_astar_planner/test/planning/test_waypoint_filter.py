import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning._kernels.path_checks import nearest_places
from llm_astar_planner.planning.segment import (
    CheckedWaypoint,
    WaypointStatus,
    check_waypoints,
    snap,
    target_list,
)

# A 12 x 10 map with a wall along x = 6 that leaves the right side cut off, as component 2.
BLOCKED = np.zeros((10, 12), dtype=bool)
BLOCKED[:, 6] = True
COMPONENTS = np.ones((10, 12), dtype=np.int32)
COMPONENTS[:, 6] = 0
COMPONENTS[:, 7:] = 2


def statuses(*waypoints):
    checked = check_waypoints(waypoints, BLOCKED, COMPONENTS, start=(2, 2))
    return [point.status.value for point in checked]


def test_each_waypoint_gets_its_status():
    assert statuses((3, 3), (6, 4), (8, 4), (40, 4), (3, -2)) == [
        'accepted',
        'occupied',
        'unreachable',
        'out_of_bounds',
        'out_of_bounds',
    ]


def test_the_published_filter_keeps_two_lines_off_the_edge():
    assert statuses((1, 5), (2, 5), (9, 5), (10, 5)) == [
        'out_of_bounds',
        'accepted',
        'unreachable',
        'out_of_bounds',
    ]
    assert statuses((3, 1), (3, 2), (3, 7), (3, 8)) == [
        'out_of_bounds',
        'accepted',
        'accepted',
        'out_of_bounds',
    ]


def test_a_point_between_lattice_points_lies_on_no_cell():
    assert statuses((6.25, 4)) == ['accepted']


@given(st.lists(st.tuples(st.floats(), st.floats())))
def test_any_numbers_are_checked(waypoints):
    assert len(statuses(*waypoints)) == len(waypoints)


def test_the_last_cell_of_a_known_barrier_passes_as_in_the_published_code():
    barrier_map = BarrierMap(0, (0, 12), (0, 10), (Barrier(5, 3, 7),))
    known = Costmap(barrier_map.to_grid(), barrier_map=barrier_map).rejected_cells
    assert not known[5, 7]
    assert known[5, 6]
    assert Costmap(barrier_map.to_grid()).rejected_cells[5, 7]


def checked(*waypoints):
    return [CheckedWaypoint(x, y, WaypointStatus(status)) for x, y, status in waypoints]


@pytest.mark.parametrize(
    ('waypoints', 'expected'),
    [
        ([], [(1, 1), (9, 9)]),
        ([(4, 4, 'accepted')], [(1, 1), (4, 4), (9, 9)]),
        ([(1, 1, 'accepted'), (9, 9, 'accepted')], [(1, 1), (9, 9)]),
        ([(4, 4, 'occupied'), (5, 5, 'out_of_bounds')], [(1, 1), (9, 9)]),
        ([(4, 4, 'unreachable')], [(1, 1), (4, 4), (9, 9)]),
        ([(9, 9, 'accepted'), (4, 4, 'accepted')], [(1, 1), (9, 9), (4, 4), (9, 9)]),
    ],
)
def test_the_target_list_has_start_and_goal_and_what_can_be_stood_on(waypoints, expected):
    assert target_list(checked(*waypoints), (1, 1), (9, 9)) == expected


def test_start_equal_to_goal_is_one_target():
    assert target_list([], (1, 1), (1, 1)) == [(1, 1)]


PATH = np.array([[x, 5] for x in range(10)], dtype=np.int32)


def test_snapping_only_undoes_rounding_errors():
    assert snap(25.999999999) == 26.0
    assert snap(25.5) == 25.5
    assert np.isnan(snap(float('nan')))
    assert snap(float('inf')) == float('inf')


@given(
    st.lists(st.tuples(st.integers(-1, 1), st.integers(-1, 1)), max_size=300),
    st.lists(st.tuples(st.floats(-70.0, 70.0), st.integers(-9, 9)), max_size=8),
)
def test_the_nearest_places_on_a_path_are_found(steps, points):
    path = np.cumsum([(0, 0), *steps], axis=0).astype(np.int32)
    points = np.array([*points, path.mean(axis=0)], dtype=np.float64)
    places = [int(np.square(path - point).sum(axis=1).argmin()) for point in points]
    assert nearest_places(path, points).tolist() == places
