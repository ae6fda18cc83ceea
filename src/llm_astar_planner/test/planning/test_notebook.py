"""What a notebook gives to a planner, and what it shows of its plans."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError
from llm_astar_msgs_adapter.maps.map_server import MapServerError, load_map
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.resources import find_file
from PIL import Image

from llm_astar_planner import plugins

WALLS = np.zeros((20, 30), dtype=bool)
WALLS[5:, 15] = True
REQUEST = PlanRequest((2, 15), (27, 15))


def test_an_array_of_obstacles_is_a_map():
    planner = Planner(WALLS)
    assert np.array_equal(planner.grid_map.cells, np.where(WALLS, 100, 0))
    assert planner.grid_map.resolution == 1.0


def test_an_array_of_occupancy_is_a_map():
    cells = np.array([[0, 50, 100], [-1, 0, 0]])
    assert np.array_equal(Planner(cells).grid_map.cells, cells)
    with pytest.raises(GridMapError, match='-1 to 100'):
        Planner(np.array([[255, 0]], np.uint8))


@pytest.mark.parametrize('kind', [str, lambda path: path])
def test_the_path_of_a_yaml_file_is_a_map(kind):
    office = find_file('instructions/office.yaml', 'maps')
    assert Planner(kind(office)).grid_map.digest == load_map(office).digest
    with pytest.raises(MapServerError, match='nowhere'):
        Planner('nowhere.yaml')


@pytest.mark.parametrize('mode', ['L', '1', 'RGB', 'RGBA', 'P'])
def test_an_image_is_a_map_as_map_server_takes_it(mode):
    image = Image.fromarray(np.where(WALLS, 0, 255).astype(np.uint8)[::-1]).convert(mode)
    assert np.array_equal(Planner(image).grid_map.cells, np.where(WALLS, 100, 0))


def test_a_map_stays_the_one_that_it_is():
    grid_map = GridMap(WALLS.astype(np.int8))
    assert Planner(grid_map).grid_map is grid_map


def test_a_notebook_shows_a_plan_as_a_picture_though_its_planner_is_gone():
    plan = Planner(WALLS).plan(REQUEST)
    assert plan._repr_png_().startswith(b'\x89PNG')


def test_a_plan_without_a_path_is_shown_too():
    closed = WALLS.copy()
    closed[:, 15] = True
    plan = Planner(closed).plan(REQUEST)
    assert plan.code
    assert plan._repr_png_() is not None


def test_without_the_laboratory_there_is_no_picture(monkeypatch):
    plan = Planner(WALLS).plan(REQUEST)

    def absent(name):
        raise ImportError('No module named <matplotlib>')

    monkeypatch.setattr(plugins, 'find_drawing', absent)
    assert plan._repr_png_() is None


def test_a_copy_of_a_plan_carries_no_map_with_it():
    plan = Planner(WALLS).plan(REQUEST)
    copies = pickle.loads(pickle.dumps(plan)), replace(plan)  # noqa: S301
    for copy in copies:
        assert copy._repr_png_() is None
