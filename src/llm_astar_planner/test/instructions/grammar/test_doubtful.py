"""What may mean two things is not understood, and takes along what hangs together with it."""

import pytest
import shapely
from instructions.grammar.hospital import read
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.interpretation import Understanding

NOTHING = [
    # Numbers: ranges, and signs that may part thousands.
    'keep 2-3 m away from the scanner',
    'keep 1.5 - 2 m from the walls',
    'keep between 2 and 3 m away from the walls',
    'keep 1.5.2 m from the walls',
    'keep .5 m from the walls',
    'keep 1,500 mm from the walls',
    'halte 1.500 mm Abstand zu den Wänden',
    'go to 3,4,5',
    'go to 3-4',
    # A 'not' at the end, and some of a set.
    'visit the pharmacy, the reception not',
    'besuche die Apotheke, den Empfang nicht',
    'do not visit all wards',
    'ne visite pas toutes les portes',
    'visit the blue wards, not ward 1',
    'visit all wards. Skip ward 1.',
    'avoid all wards; visit ward 1',
    'visit every second ward',
    'visit these wards',
    'a bathroom is closed',
    # Conditions, permissions and what was taken back.
    'go to the pharmacy; otherwise avoid ward 1',
    'avoid the pharmacy. No, wait, avoid ward 1.',
    'the pharmacy is closed, but you may go through',
    'du darfst durch die Apotheke fahren',
    "can't you visit the pharmacy",
    'the robot visited the pharmacy',
    'ne passe plus par la pharmacie',
    # Orders.
    'stay in the hallway, then in the pharmacy',
    'in the hallway, keep to the right',
    'visit ward 1 and ward 2, ward 2 first',
    'visit ward 1, ward 2, ward 1',
    'visit ward 1, not before ward 2',
    'do not enter ward 1 before ward 2 or ward 3',
    # Objects that nobody enters, and stops.
    'do not visit the scanner',
    "don't follow the scanner",
    'do not stop at the pharmacy',
    'go under the scanner',
    'pass the scanner not on the north',
    'pass the scanner, on the left',
    'avoid the gap between the scanner, the trolley and the pharmacy',
    'end at the bathrooms',
]


@pytest.mark.parametrize('text', NOTHING)
def test_no_clause_is_made(text):
    interpretation = read(text)
    assert interpretation.specification.enforceable == (), interpretation.sentence
    assert interpretation.status is Understanding.NONE


WHOLE = {
    'visit all wards but ward 1': 'visit the ward 2 and the ward 3 in any order',
    'avoid all wards but not ward 1': 'avoid all ward places except the ward 1',
    'stop at the pharmacy, then go to ward 1': 'visit the pharmacy, then the ward 1',
    'stop at the pharmacy on your way': 'visit the pharmacy',
    'first stop at the pharmacy': 'visit the pharmacy',
    'avoid x > 2 and x < 5': 'avoid the area with x from 2 to 5',
    'avoid x between 3 and 5, y between 2 and 4': 'avoid the area with x from 3 to 5 '
    'and y from 2 to 4',
    'avoid x < 2 and x > 5': 'avoid the area with x below 2; avoid the area with x above 5',
    'do not enter any ward before all bathrooms': 'do not enter one of the ward places before '
    'the bathroom A; do not enter one of the ward places before the bathroom B',
    'do not visit any ward': 'avoid all ward places',
    'du darfst nicht durch die Apotheke fahren': 'avoid the pharmacy',
    'keep 2,5 m away from the scanner': 'keep 2.5 m away from the scanner',
    'pass the north side of the scanner': 'pass the scanner on the north side',
}


@pytest.mark.parametrize('text', WHOLE)
def test_what_has_one_meaning_is_read_wholly(text):
    interpretation = read(text)
    assert interpretation.sentence == WHOLE[text], interpretation.detail
    assert interpretation.status is Understanding.WHOLE


# A stop may be the end of the route, in place of the goal.
STOPS = {
    'stop at the pharmacy': 'end in the pharmacy',
    'stop in ward 2': 'end in the ward 2',
    'go through ward 1 and stop at the pharmacy': 'visit the ward 1; end in the pharmacy',
    'stop at the pharmacy and do not use the hallway': 'end in the pharmacy; avoid the hallway',
    'Stopp bei der Apotheke': 'end in the pharmacy',
    'arrête-toi à la pharmacie': 'end in the pharmacy',
    'detente en la farmacia': 'end in the pharmacy',
}


@pytest.mark.parametrize('text', STOPS)
def test_a_stop_asks_whether_the_goal_changes(text):
    interpretation = read(text)
    assert interpretation.sentence == STOPS[text]
    assert interpretation.status is Understanding.UNSURE
    assert len(interpretation.questions) == 1
    assert interpretation.confirmed().status is Understanding.WHOLE


PARTLY = {
    'stay in the hallway, then visit the pharmacy': 'visit the pharmacy',
    'end in ward 1, then visit the pharmacy': 'visit the pharmacy',
    'visit ward 1. First visit the pharmacy.': 'visit the ward 1',
    'visit ward 1; before that, visit the pharmacy': 'visit the ward 1',
}


@pytest.mark.parametrize('text', PARTLY)
def test_the_other_part_is_kept(text):
    interpretation = read(text)
    assert interpretation.status is Understanding.PARTLY
    assert PARTLY[text] in interpretation.sentence
    assert len(interpretation.specification.enforceable) == 1


def rooms(*names):
    boxes = [shapely.box(6 * n, 0.01 * n, 6 * n + 5, 5 + 0.01 * n) for n in range(len(names))]
    return Places(Place(name, area, 'room') for name, area in zip(names, boxes, strict=True))


def test_a_name_of_a_place_goes_before_a_word_for_the_map():
    read_half = read('avoid the left half of the hall', rooms('hall', 'kitchen'))
    assert read_half.sentence == 'avoid the west half of the hall'


def test_places_that_lie_side_by_side_are_not_told_apart():
    assert read('visit the northernmost room', rooms('lab', 'office')).sentence.startswith('not')


def test_of_three_in_a_row_the_middle_one_has_one_on_each_side():
    sentence = read('visit the middle room', rooms('lab', 'office', 'store')).sentence
    assert sentence == 'visit the office'


def test_the_end_of_an_english_name_is_no_german_word():
    assert read('visit the ward', rooms('fuel station', 'kitchen')).specification.enforceable == ()
