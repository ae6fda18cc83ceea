"""Paths as messages: a pose per cell, from pose to pose."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message, pose_from_message, yaw_of
from llm_astar_planner.nodes.planner.publishers import PathWriter, cell_of
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest

CELLS = np.zeros((60, 2000), dtype=np.int8)
CELLS[:50, 1000] = 100
PLANNER = Planner(GridMap(CELLS))


def pose_at(x, y, yaw=0.0):
    """Return the pose at grid coordinates, where cell centres are integers."""
    return Pose2D(x + 0.5, y + 0.5, yaw)


def write(plan):
    ends = pose_at(*plan.start), pose_at(*plan.goal)
    writer = PathWriter(PLANNER, Time(sec=5), *ends, keeps_heading=True)
    # In cells: a cell's centre is half a cell from its corner.
    return path_from_message(writer.write_plan(plan)) - 0.5


@pytest.mark.parametrize('any_angle', [False, True])
def test_a_path_has_a_pose_per_cell(any_angle):
    plan = PLANNER.plan(PlanRequest((5, 5), (1990, 8), any_angle=any_angle))
    points = write(plan)
    assert np.hypot(*np.diff(points, axis=0).T).max() <= np.sqrt(2) + 1e-9
    if not any_angle:
        np.testing.assert_array_equal(points, plan.path)


def test_an_empty_path_can_be_written():
    plan = PLANNER.plan(PlanRequest((5, 5), (1000, 5)))
    assert write(plan).shape == (0, 2)


def written(start, goal, *, keeps_heading=False, **fields):
    """Return the poses (x, y, yaw) of a path between poses in grid coordinates."""
    cells = [cell_of(np.array(pose[:2])) for pose in (start, goal)]
    plan = PLANNER.plan(PlanRequest(*cells, **fields))
    ends = pose_at(*start), pose_at(*goal)
    writer = PathWriter(PLANNER, Time(sec=5), *ends, keeps_heading=keeps_heading)
    path = writer.write_plan(plan)
    poses = [pose_from_message(stamped.pose) for stamped in path.poses]
    return plan, [(pose.x - 0.5, pose.y - 0.5, pose.yaw) for pose in poses]


@pytest.mark.parametrize('any_angle', [False, True])
def test_a_path_begins_and_ends_exactly_at_the_poses_that_were_asked_for(any_angle):
    start, goal = (5.3, 5.2, 2.0), (40.4, 7.7, -1.0)
    _, poses = written(start, goal, any_angle=any_angle)
    assert poses[0] == pytest.approx(start)
    assert poses[-1] == pytest.approx(goal)
    steps = np.diff([pose[:2] for pose in poses], axis=0)
    headings = [pose[2] for pose in poses[1:-1]]
    assert np.arctan2(steps[1:, 1], steps[1:, 0]) == pytest.approx(headings)
    _, poses = written(start, goal, any_angle=any_angle, keeps_heading=True)
    assert poses[-1] == pytest.approx((*goal[:2], np.arctan2(steps[-1, 1], steps[-1, 0])))


def test_in_one_cell_the_path_leads_from_pose_to_pose():
    """NavFn's two poses; and where they are at one place, the one of all of Nav2's planners."""
    start, goal = (5.3, 5.2, 2.0), (4.8, 5.2, -1.0)
    assert written(start, goal)[1] == [pytest.approx(start), pytest.approx(goal)]
    along = (4.8, 5.2, np.pi)
    assert written(start, goal, keeps_heading=True)[1] == [start, pytest.approx(along)]
    turned = (5.3, 5.2, -1.0)
    assert written(start, turned)[1] == [pytest.approx(turned)]
    assert written(start, turned, keeps_heading=True)[1] == [pytest.approx(start)]


def test_a_goal_that_was_moved_stays_at_the_centre_of_its_cell():
    plan, poses = written((5.3, 5.2, 2.0), (1000.3, 5.1, -1.0), tolerance=2.0)
    assert plan.goal == (999, 5)
    assert poses[-1] == pytest.approx((999.0, 5.0, -1.0))


def test_the_robot_comes_before_a_start_that_was_moved():
    plan, poses = written((1000.3, 5.1, 2.0), (990.2, 5.3, -1.0), start_tolerance=2.0)
    assert plan.start == (999, 5)
    assert poses[0] == pytest.approx((1000.3, 5.1, 2.0))
    assert poses[1] == pytest.approx((999.0, 5.0, np.pi))
    assert poses[-1] == pytest.approx((990.2, 5.3, -1.0))


def test_the_same_points_are_the_same_message():
    writer = PathWriter(PLANNER, Time(), pose_at(5.3, 5.2), pose_at(8.1, 5.2), keeps_heading=True)
    points = [(5, 5), (6, 5), (7, 5), (8, 5)]
    assert writer.write(points) is writer.write(np.array(points, dtype=np.int32))


def test_a_smooth_path_begins_and_ends_at_the_poses_without_a_kink():
    cells = np.zeros((40, 60), dtype=np.int8)
    cells[:25, 30:33] = 100
    planner = Planner(GridMap(cells))
    plan = planner.plan(PlanRequest((10, 10), (50, 10), any_angle=True, smoothing=True))
    start, goal = pose_at(9.6, 10.4, 1.0), pose_at(50.3, 9.7, -1.0)
    writer = PathWriter(planner, Time(), start, goal, keeps_heading=False)
    path = writer.write_plan(plan)
    points = path_from_message(path) - 0.5
    assert points[0] == pytest.approx((9.6, 10.4))
    assert points[-1] == pytest.approx((50.3, 9.7))
    yaws = np.array([yaw_of(pose.pose.orientation, 'pose') for pose in path.poses])
    assert yaws[[0, -1]] == pytest.approx([1.0, -1.0])
    turns = (np.diff(yaws[1:-1]) + np.pi) % (2.0 * np.pi) - np.pi
    assert np.degrees(np.abs(turns)).max() < 12.0
