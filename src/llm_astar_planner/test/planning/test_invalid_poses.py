"""Where a path from any planner can no longer be followed."""

import numpy as np
import pytest
from grids import checker_of
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.path_validator import (
    CollisionChecker,
    invalid_poses,
    nearest_pose,
)

BLOCKED = np.zeros((10, 12), dtype=np.bool_)
BLOCKED[2:8, 6] = True


CHECKER = checker_of(BLOCKED)


def invalid(*cells, checker=CHECKER, **rules):
    return np.flatnonzero(invalid_poses(np.array(cells), checker, **rules)).tolist()


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


def test_a_path_without_poses_has_no_invalid_ones():
    assert invalid_poses(np.zeros((0, 2), dtype=np.int64), CHECKER).tolist() == []


def test_a_robot_with_a_radius_cannot_pass_near_an_obstacle():
    config = CostmapConfig(robot_radius=2.0, occupied_threshold=1)
    wide = CollisionChecker(GridMap(BLOCKED.view(np.int8)), config)
    assert invalid((3, 4), (4, 4), (5, 4), checker=wide) == [1, 2]
    assert invalid((3, 0), (6, 0), (9, 0), checker=wide) == [1]
    assert invalid((4, 9), (8, 9), checker=wide) == [1]
    assert invalid((0, 0), (1, 9), (2, 0), checker=wide) == []


def test_unknown_and_dear_cells_are_invalid_where_the_caller_says_so():
    cells = np.zeros((4, 6), dtype=np.int8)
    cells[0, 2], cells[0, 4] = -1, 40
    checker = CollisionChecker(GridMap(cells), CostmapConfig())
    path = [(x, 0) for x in range(6)]
    assert invalid(*path, checker=checker) == []
    assert invalid(*path, checker=checker, allow_unknown=False) == [2]
    assert invalid(*path, checker=checker, cost_limit=40) == [4]
    assert invalid(*path, checker=checker, cost_limit=-1) == [0, 1, 2, 3, 4, 5]
    closed = CollisionChecker(GridMap(cells), CostmapConfig(allow_unknown=False))
    assert invalid(*path, checker=closed) == [2]


@pytest.mark.parametrize('seed', range(6))
def test_all_poses_at_once_are_what_each_is_alone(seed):
    rng = np.random.default_rng(seed)
    cells = rng.choice([0, 0, 0, 0, 30, 100, -1], (60, 70)).astype(np.int8)
    cells[:, 20:] *= rng.random((60, 50)) < 0.05
    radius = float(rng.choice([0.0, 1.0, 2.5]))
    config = CostmapConfig(robot_radius=radius, allow_unknown=bool(seed % 2), corner_cutting=True)
    checker = CollisionChecker(GridMap(cells), config)
    path = np.cumsum(rng.integers(-3, 4, (80, 2)), axis=0) + 30
    found = invalid_poses(path, checker)

    def problem(cell):
        inside = (0 <= cell[0] < 70) and (0 <= cell[1] < 60)
        return not inside or checker.path_problem(cell[None], cell, cell)

    alone = [bool(problem(cell)) for cell in path]
    for n in range(1, len(path)):
        if not (alone[n - 1] or alone[n]) and abs(path[n] - path[n - 1]).max() > 1:
            between = checker.segments_problem(path[n - 1 : n + 1])
            assert found[n] == (between is not None)
        else:
            assert found[n] == alone[n]
    assert found[0] == alone[0]


def test_the_nearest_pose_is_found():
    assert nearest_pose(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), 1.2, 1.4) == 1
