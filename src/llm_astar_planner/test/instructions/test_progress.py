"""Which way counts as driven, from where a robot plans again."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from instruction_places import HOSPITAL
from llm_astar_planner.instructions.progress import Progress

RESOLUTION = 0.5
WARD_1 = HOSPITAL.get('ward 1').geometry.buffer(-0.5)
GOAL = [(29.0, 10.0)]
START, IN_WARD_1, BACK, BEYOND = (1.0, 10.0), (15.0, 4.0), (14.0, 10.0), (25.0, 10.0)


def line(*corners):
    """Return points every 0.1 m along straight lines."""
    parts = [
        np.linspace(one, other, max(2, round(10 * np.hypot(*np.subtract(other, one)))))
        for one, other in pairwise(corners)
    ]
    return np.concatenate(parts)


def was_in_ward_1(driven):
    return bool(shapely.contains_xy(WARD_1, driven).any())


@pytest.fixture
def progress():
    """A drive from the start through ward 1 and back to the corridor that has just begun."""
    made = Progress()
    assert np.array_equal(made.at(START, GOAL, 'visit', RESOLUTION), [START])
    made.follow(line(START, BACK, IN_WARD_1, BACK, *GOAL))
    return made


def drive(progress, *positions, text='visit', goal=GOAL):
    for position in positions:
        driven = progress.at(position, goal, text, RESOLUTION)
        if position is not positions[-1]:
            progress.follow(line(position, *goal))
    return was_in_ward_1(driven)


def test_what_the_robot_has_passed_on_its_path_is_driven(progress):
    assert drive(progress, BEYOND)
    expected = np.hypot(13.0, 0) + 2 * np.hypot(1.0, 6.0) + 11.0
    assert progress.metres == pytest.approx(expected, abs=0.2)


def test_a_path_there_and_back_is_not_taken_as_driven_at_its_beginning(progress):
    """The path passes BACK twice, before the ward and after it."""
    assert not drive(progress, BACK)


def test_the_way_goes_on_from_plan_to_plan(progress):
    assert drive(progress, (15.0, 4.2))
    progress.follow(line((15.0, 4.2), BACK, *GOAL))
    assert drive(progress, BACK)
    progress.follow(line(BACK, *GOAL))
    assert drive(progress, BEYOND, BEYOND)


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
def test_another_drive_begins_where_the_robot_is(progress, position, goal, text):
    assert drive(progress, BEYOND)
    assert np.array_equal(progress.at(position, goal, text, RESOLUTION), [position])


def test_no_instruction_ends_the_drive(progress):
    assert drive(progress, BEYOND)
    progress.reset()
    assert progress.metres == 0.0
    assert not drive(progress, BEYOND)


def test_a_robot_that_found_no_path_may_stand_where_it_is_but_not_jump():
    progress = Progress()
    assert drive(progress, IN_WARD_1)
    assert drive(progress, (15.5, 4.0))
    assert not drive(progress, BEYOND)
