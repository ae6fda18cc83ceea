"""What counts as visited on the way, from where a robot plans again."""

from itertools import pairwise

import numpy as np
import pytest
from instruction_places import HOSPITAL
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.instructions.progress import Progress
from llm_astar_planner.instructions.regions import NamedPlace
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification

COSTMAP = Costmap(GridMap(np.zeros((44, 64), dtype=np.int8), 0.5))
ROUTE = Route(COSTMAP, (2, 20), (60, 20), HOSPITAL)
GOAL = [(29.0, 10.0)]
START, IN_WARD_1, BACK, BEYOND = (1.0, 10.0), (15.0, 4.0), (14.0, 10.0), (25.0, 10.0)


def visits(*names, text='visit', status=Understanding.WHOLE):
    clauses = tuple(Visit(regions=(NamedPlace(name),)) for name in names)
    return Interpretation(text, Specification(clauses), 'grammar', status)


WARD_1 = visits('ward 1')


def line(*corners):
    """Return points every 0.1 m along straight lines."""
    parts = [
        np.linspace(one, other, max(2, round(10 * np.hypot(*np.subtract(other, one)))))
        for one, other in pairwise(corners)
    ]
    return np.concatenate(parts)


@pytest.fixture
def progress():
    """A drive from the start through ward 1 and back to the corridor that has just begun."""
    made = Progress()
    assert made.at(START, GOAL, WARD_1, ROUTE) == set()
    made.follow(line(START, BACK, IN_WARD_1, BACK, *GOAL))
    return made


def drive(progress, *positions, interpretation=WARD_1, goal=GOAL):
    for position in positions:
        visited = progress.at(position, goal, interpretation, ROUTE)
        if position is not positions[-1]:
            progress.follow(line(position, *goal))
    return visited


def test_what_the_robot_has_passed_on_its_path_is_visited(progress):
    assert drive(progress, BEYOND) == {(0, 0)}
    assert progress.visited == {(0, 0)}


def test_a_path_there_and_back_is_not_taken_as_driven_at_its_beginning(progress):
    """The path passes BACK twice, before the ward and after it."""
    assert drive(progress, BACK) == set()


def test_visits_are_kept_from_plan_to_plan(progress):
    assert drive(progress, (15.0, 4.2)) == {(0, 0)}
    progress.follow(line((15.0, 4.2), BACK, *GOAL))
    assert drive(progress, BACK) == {(0, 0)}
    progress.follow(line(BACK, *GOAL))
    assert drive(progress, BEYOND, BEYOND) == {(0, 0)}


@pytest.mark.parametrize(
    ('position', 'goal', 'text'),
    [
        ((5.0, 18.0), GOAL, 'visit'),
        (BEYOND, [(1.0, 1.0)], 'visit'),
        (BEYOND, [(20.0, 10.0), *GOAL], 'visit'),
        (BEYOND, GOAL, 'another'),
    ],
    ids=['off the path', 'another goal', 'a via point more', 'another instruction'],
)
def test_another_drive_begins_without_visits(progress, position, goal, text):
    assert drive(progress, BEYOND) == {(0, 0)}
    assert (
        drive(progress, position, interpretation=visits('ward 1', text=text), goal=goal) == set()
    )


def test_no_instruction_ends_the_drive(progress):
    assert drive(progress, BEYOND) == {(0, 0)}
    progress.reset()
    assert progress.visited == set()
    assert drive(progress, BEYOND) == set()


def test_an_instruction_understood_on_the_way_is_held_against_all_of_the_way():
    progress = Progress()
    pending = visits(status=Understanding.PENDING)
    progress.at(START, GOAL, pending, ROUTE)
    progress.follow(line(START, BACK, IN_WARD_1, BACK, *GOAL))
    assert drive(progress, BEYOND, interpretation=pending) == set()
    assert drive(progress, BEYOND, interpretation=visits('ward 1')) == {(0, 0)}


def test_regions_count_only_in_their_order(progress):
    ordered = visits('ward 2', 'ward 1')
    assert drive(progress, BEYOND, interpretation=ordered) == set()


def test_a_robot_that_found_no_path_may_stand_where_it_is_but_not_jump():
    progress = Progress()
    assert progress.at(IN_WARD_1, GOAL, WARD_1, ROUTE) == {(0, 0)}
    assert progress.at((15.5, 4.0), GOAL, WARD_1, ROUTE) == {(0, 0)}
    assert progress.at(BEYOND, GOAL, WARD_1, ROUTE) == set()
