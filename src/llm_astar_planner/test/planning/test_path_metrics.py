import math

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.path_validator import CollisionChecker
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest


def measure(path, grid_map):
    return CollisionChecker(grid_map, CostmapConfig()).measure(path)


def cells(*points):
    return np.array(points, dtype=np.int32)


@pytest.mark.parametrize(
    ('path', 'count'),
    [
        (cells((1, 1)), 0),
        (cells((1, 1), (2, 2)), 0),
        (cells((1, 1), (2, 2), (3, 3)), 0),
        (cells((1, 1), (2, 2), (3, 2), (4, 2), (4, 3)), 2),
        (cells((1, 1), (2, 1), (1, 1)), 1),
    ],
)
def test_turns_are_changes_of_direction(path, count):
    assert measure(path, GridMap(np.zeros((9, 9), dtype=np.int8))).turns == count


def test_a_move_lies_half_in_each_of_its_cells():
    grid = np.zeros((3, 6), dtype=np.int8)
    grid[:, 2:4] = -1
    grid_map = GridMap(grid, 0.5)
    straight = cells(*((x, 1) for x in range(6)))
    assert measure(straight, grid_map).unknown_length == pytest.approx(1.0)
    into = cells((1, 0), (2, 1))
    assert measure(into, grid_map).unknown_length == pytest.approx(0.25 * math.sqrt(2))
    assert measure(cells((2, 1)), grid_map).unknown_length == 0.0


def test_clearance_is_from_the_paths_cells_to_the_nearest_obstacle():
    """From centre to centre, in metres, though no radius is asked for."""
    random = np.random.default_rng(3)
    grid = np.where(random.random((40, 40)) < 0.1, 100, 0).astype(np.int8)
    grid[0, 0] = grid[39, 39] = 0
    plan = Planner(GridMap(grid, 0.2), CostmapConfig()).plan(PlanRequest((0, 0), (39, 39)))
    obstacles = np.argwhere(grid == 100)[:, ::-1]
    distances = np.hypot(*(plan.path[:, None] - obstacles).transpose(2, 0, 1))
    assert plan.clearance == pytest.approx(0.2 * distances.min())
