"""Paths as messages: a pose per cell, or fewer where there is no time to write them."""

import time

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_planner.nodes.planner.publishers import POSE_SECONDS, PathWriter
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.any_angle import turning_points

CELLS = np.zeros((60, 2000), dtype=np.int8)
CELLS[:50, 1000] = 100
PLANNER = Planner(GridMap(CELLS))


def write(plan, seconds):
    writer = PathWriter(PLANNER.grid_map, Time(sec=5), 0.0, None)
    path, warnings = writer.write_plan(plan, time.monotonic() + seconds)
    # In cells: a cell's centre is half a cell from its corner.
    return path_from_message(path) - 0.5, warnings


@pytest.mark.parametrize('any_angle', [False, True])
def test_a_path_has_a_pose_per_cell_if_there_is_time(any_angle):
    plan = PLANNER.plan(PlanRequest((5, 5), (1990, 8), any_angle=any_angle))
    points, warnings = write(plan, 60.0)
    assert warnings == ()
    assert np.hypot(*np.diff(points, axis=0).T).max() <= np.sqrt(2) + 1e-9
    if not any_angle:
        np.testing.assert_array_equal(points, plan.path)


@pytest.mark.parametrize('any_angle', [False, True])
@pytest.mark.parametrize('seconds', [200 * POSE_SECONDS, -1.0])
def test_where_there_is_no_time_poses_between_the_turns_are_left_out(any_angle, seconds):
    plan = PLANNER.plan(PlanRequest((5, 5), (1990, 8), any_angle=any_angle))
    points, (warning,) = write(plan, seconds)
    assert warning.startswith(f'{len(points)} poses are written')
    assert len(points) < len(plan.path) / 4
    turns = plan.any_angle.points if any_angle else turning_points(plan.path)
    kept = {tuple(point) for point in points.tolist()}
    assert kept >= {tuple(map(float, point)) for point in turns.tolist()}


def test_an_empty_path_can_be_written():
    plan = PLANNER.plan(PlanRequest((5, 5), (1000, 5)))
    points, warnings = write(plan, -1.0)
    assert points.shape == (0, 2)
    assert warnings == ()
