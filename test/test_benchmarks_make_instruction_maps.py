"""The committed maps are those that the scripts draw, and the shipped ones look like a robot's."""

import pytest
from llm_astar_msgs_adapter.maps.places import load_places, places_problems
from llm_astar_planner.cli.map_files import maps_of
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.region_finder import goal_cell
from llm_astar_planner.resources import find_file

from benchmarks import make_robot_maps
from benchmarks.make_instruction_maps import FOLDER, MAPS, make_maps
from llm_astar_planner import Planner, PlanRequest

MAP_FILES = ('.pgm', '.yaml', '.geojson')


def test_the_committed_maps_are_those_of_the_script(tmp_path):
    make_maps(tmp_path)
    drawn = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {p.name: p.read_bytes() for p in FOLDER.iterdir() if p.suffix in MAP_FILES}
    assert drawn == kept
    assert len(drawn) == 3 * 11


def test_the_committed_maps_of_robots_are_those_of_the_script(tmp_path):
    make_robot_maps.make_maps(tmp_path)
    drawn = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert drawn == {name: (MAPS / name).read_bytes() for name in drawn}
    assert len(drawn) == 3 * 4


@pytest.mark.parametrize('name', ['depot', 'office', 'house', 'hospital'])
def test_a_robot_reaches_every_place_of_a_map_that_is_found_by_its_short_name(name):
    grid_map = maps_of(find_file(name, 'maps'))[0].to_grid()
    assert {*map(int, set(grid_map.cells.ravel()))} == {-1, 0, 100}
    places = load_places(find_file(f'{name}.places.geojson', 'maps'))
    assert not places_problems(places, grid_map)
    planner = Planner(grid_map, CostmapConfig(robot_radius=0.3))
    first, *others = (goal_cell(place, planner.costmap) for place in places)
    assert len(others) > 10
    for place, cell in zip([*places][1:], others):
        assert not planner.plan(PlanRequest(first, cell, method='exact_astar')).code, place.name
