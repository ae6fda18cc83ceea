"""Where a path from any planner can no longer be followed."""

import numpy as np
from llm_astar_planner.planning.path_validator import invalid_poses, nearest_pose

BLOCKED = np.zeros((10, 12), dtype=np.bool_)
BLOCKED[2:8, 6] = True


def invalid(*cells, first=0):
    return invalid_poses(np.array(cells), BLOCKED, first)


def test_free_poses_are_valid_however_far_apart():
    assert invalid((0, 0), (1, 1), (11, 0), (11, 9)) == []
    assert invalid((3, 3)) == []


def test_poses_on_obstacles_and_off_the_map_are_invalid():
    assert invalid((5, 4), (6, 4), (7, 4)) == [1]
    assert invalid((-1, 0), (0, 0), (0, 10), (12, 3)) == [0, 2, 3]


def test_a_segment_through_an_obstacle_makes_the_pose_it_leads_to_invalid():
    assert invalid((2, 5), (10, 5), (11, 5)) == [1]
    assert invalid((5, 5), (7, 5)) == [1]


def test_a_segment_may_pass_a_corner_as_the_paths_of_other_planners_do():
    assert invalid((4, 3), (7, 0)) == []


def test_poses_behind_the_robot_are_not_checked():
    assert invalid((6, 4), (7, 4), (8, 4), first=1) == []
    assert invalid((2, 5), (10, 5), (6, 5), first=1) == [2]


def test_the_nearest_pose_is_found():
    assert nearest_pose(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), 1.2, 1.4) == 1
