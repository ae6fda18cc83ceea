"""Which place a name means as a goal, and which cell of it."""

import numpy as np
import pytest
import shapely
from instruction_places import HOSPITAL
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, places_from_polygons
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.region_finder import goal_cell
from llm_astar_planner.instructions.route import PlaceGoalError, find_place

LOBBY = HOSPITAL.get('lobby')
LIFT = HOSPITAL.get('lift')


def cells(*blocked):
    """Return a map of 30 x 20 m in half metres with blocked boxes (x0, y0, x1, y1) in metres."""
    made = np.zeros((40, 60), dtype=np.int8)
    for x0, y0, x1, y1 in blocked:
        made[int(2 * y0) : int(2 * y1), int(2 * x0) : int(2 * x1)] = OCCUPIED
    return Costmap(GridMap(made, 0.5))


@pytest.mark.parametrize('name', ['kitchen', 'Kitchen ', ' canteen', 'CANTEEN'])
def test_a_place_is_found_by_its_name_and_aliases(name):
    assert find_place(name, HOSPITAL).name == 'kitchen'


def test_a_kind_or_tag_of_one_place_alone_is_a_name_too():
    assert find_place('corridor', HOSPITAL).name == 'main corridor'


@pytest.mark.parametrize(
    ('name', 'places', 'problem'),
    [
        ('blue', HOSPITAL, "'blue' is said of several places: ward 1, ward 2$"),
        ('kitchn', HOSPITAL, "no place 'kitchn'; did you mean kitchen.; there is lobby, ward 1, "),
        ('lab', NO_PLACES, 'no places are loaded'),
    ],
)
def test_the_names_to_choose_from_are_said(name, places, problem):
    with pytest.raises(PlaceGoalError, match=problem):
        find_place(name, places)


def test_of_many_names_some_are_listed():
    many = places_from_polygons(
        {f'room {n}': {'polygon': [[n, 0], [n + 1, 0], [n, 1]]} for n in range(50)}
    )
    with pytest.raises(PlaceGoalError, match=r'room 29 and 20 more$'):
        find_place('cellar', many)


def test_the_goal_is_the_centre_or_the_free_cell_nearest_to_it():
    assert goal_cell(LOBBY, cells()) in {(9, 7), (10, 7), (9, 8), (10, 8)}
    x, y = goal_cell(LOBBY, cells((4, 2, 6, 8)))
    assert x in (7, 12)
    assert 6 <= y <= 9


def test_a_free_cell_that_is_walled_in_is_no_goal():
    ring = [(3, 2, 7, 3), (3, 5, 7, 6), (3, 3, 4, 5), (6, 3, 7, 5)]
    x, y = goal_cell(LOBBY, cells(*ring))
    assert not (6 <= x < 14 and 4 <= y < 12)


def test_the_goal_at_an_object_is_beside_it():
    x, y = goal_cell(LIFT, cells((14, 9, 16, 11)))
    metres = np.array([x, y]) / 2
    assert LIFT.geometry.distance(shapely.Point(metres)) <= 1.0


def test_a_place_without_a_free_cell_is_no_goal():
    with pytest.raises(PlaceGoalError, match="no cell of 'lobby' is free on this map"):
        goal_cell(LOBBY, cells((0, 0, 10, 8)))
