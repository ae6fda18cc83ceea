"""The source that is chosen by the map."""

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search import landmarks
from llm_astar_planner.waypoints.config import SourceSettings, helps_on, make_source

BARRIERS = BarrierMap(
    id=1,
    range_x=(0, 50),
    range_y=(0, 30),
    horizontal_barriers=(Barrier(10, 0, 25), Barrier(15, 30, 50)),
    vertical_barriers=(Barrier(25, 10, 22),),
).to_grid()
GRADED = CostmapConfig(inflation_radius=3.0, cost_scaling_factor=0.5)


def boxes():
    cells = np.zeros((80, 100), dtype=np.int8)
    rng = np.random.default_rng(3)
    for x, y in rng.integers(5, 70, size=(40, 2)):
        cells[y : y + 4, x : x + 4] = 100
    return GridMap(cells)


@pytest.fixture
def auto():
    return make_source(SourceSettings())


def test_auto_is_the_default():
    assert SourceSettings().source == 'auto'


def test_the_embedded_model_is_asked_on_maps_of_the_papers_kind(auto):
    request = PlanRequest((3, 3), (45, 25), source=auto, search_while_waiting=False)
    plan = Planner(BARRIERS).plan(request)
    assert plan.reply.label.startswith('embedded:')
    assert helps_on(Costmap(BARRIERS))


@pytest.mark.parametrize(
    'grid_map',
    [boxes(), GridMap(np.zeros((20, 20), dtype=np.int8)), GridMap(np.zeros((2, 513), np.int8))],
    ids=['many boxes', 'nothing', 'a long strip'],
)
def test_on_other_maps_nobody_is_asked_and_the_plan_says_why(grid_map, auto):
    goal = (grid_map.cells.shape[1] - 2, grid_map.cells.shape[0] - 1)
    request = PlanRequest((0, 0), goal, source=auto)
    plan = Planner(grid_map).plan(request)
    alone = Planner(grid_map).plan(PlanRequest((0, 0), goal))
    assert (plan.source_status, plan.seconds_source) == ('NONE', 0.0)
    assert plan.reply.detail == 'they save no time on such a map'
    assert plan.message == alone.message
    assert plan.expansions == alone.expansions


def test_nobody_is_asked_on_graded_maps_too_large_for_landmarks(monkeypatch):
    monkeypatch.setattr(landmarks.landmark_count, '__defaults__', (None, 1000))
    assert not helps_on(Costmap(boxes(), GRADED))
