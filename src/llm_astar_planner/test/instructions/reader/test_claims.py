"""Right readings may be claimed, whoever proposes them; wrong ones may not."""

import pytest
from instruction_places import HOSPITAL
from llm_astar_planner.instructions.reader.check import doubt_about
from llm_astar_planner.instructions.reader.claims import (
    alone,
    doubt,
    no_wall,
    twisted,
    unnamed,
    unused,
    visited_again,
)
from llm_astar_planner.instructions.reader.lifting import lifted
from llm_astar_planner.instructions.reader.meaning import Writer, ordered

RIGHT = [
    ('avoid the kitchen', 'A R1'),
    ('the kitchen is closed today', 'A R1'),
    ('go to ward 1 and then to ward 2', 'V R1 ) V R2 )'),
    ('do not enter ward 2 before you have been to ward 1', 'B R2 R1'),
    ('if possible, stay out of the kitchen', 'W A R1'),
    ('keep 2 m away from the lift', 'K R1 L1'),
    ('pass the lift on the north side', 'P R1 S1'),
    ('visit the kitchen at most twice', 'C R1 K1'),
    ('finish in the kitchen', 'E R1'),
]
WRONG = [
    ('avoid the kitchen', 'V R1 )'),
    ('do not skip the kitchen', 'A R1'),
    ('visit the kitchen', 'A R1'),
    ('visit the kitchen and ward 1', 'V R1 )'),
    ('visit the kitchen and ward 1', 'V R1 ) V R2 )'),
    ('go to ward 1 and then to ward 2', 'V R1 R2 )'),
    ('if you enter ward 1, go to ward 2 afterwards', 'V R1 ) V R2 )'),
    ('once you visit ward 1, go to ward 2', 'V R2 R1 )'),
    ('if possible, avoid the kitchen', 'A R1'),
    ('avoid the kitchen', 'W A R1'),
    ('visit the kitchen or ward 1', 'V R1 R2 )'),
    ('keep 2 m away from the lift', 'K R1 D'),
    ('pass the lift on the north side', 'V R1 )'),
    ('visit the kitchen at most twice', 'V R1 )'),
    ('finish in the kitchen', 'V R1 )'),
    ('visit the kitchen', 'E R1'),
    ('only the main corridor', 'V R1 )'),
    ('avoid the kitchen and 3 more', 'A R1'),
    ('ward 1 and ward 2 in that order', 'V R1 R2 )'),
    ('avoid the kithcen', 'A R1'),
]


def reason(text, meaning):
    """Return what the check says of a reading of a sentence."""
    writer = Writer(lifted(text, HOSPITAL).slots, {'': text})
    clauses = [writer.clause(part) for part in ordered(meaning.split())]
    return doubt_about(text, HOSPITAL, clauses)


@pytest.mark.parametrize(('text', 'meaning'), RIGHT)
def test_right_readings_pass(text, meaning):
    assert reason(text, meaning) == ''


@pytest.mark.parametrize(('text', 'meaning'), WRONG)
def test_wrong_readings_do_not(text, meaning):
    assert reason(text, meaning)


def test_what_the_sentence_does_not_name_is_no_reading_of_it():
    avoid = {'kind': 'avoid', 'region': {'place': 'kitchen'}}
    assert doubt_about('avoid ward 1', HOSPITAL, [avoid])
    assert doubt_about('avoid the kitchen', HOSPITAL, [avoid]) == ''


@pytest.mark.parametrize(
    ('text', 'meaning'),
    [
        ('avoid the corner of the kitchen', 'A R1'),
        ('some people avoid the kitchen', 'A R1'),
        ('Anna will visit the kitchen', 'V R1 )'),
        ('when it rains, go to the kitchen', 'V R1 )'),
        ('stay no more than 2 m from the lift', 'K R1 L1'),
        ('enter the kitchen from the north', 'P R1 S1'),
        ('as soon as you enter ward 1, head for ward 2 at once', 'T R1 R2'),
        ('go to ward 1 when I call you', 'V R1 )'),
        ('in case of fire go to ward 1', 'V R1 )'),
        ('ward 1, then ward 2; no, the other way about', 'V R1 ) V R2 )'),
        ('avoid half of the wards', 'A R1'),
        ('keep 1 m away from the lift, and sing', 'K R1 L1'),
        ('enter the kitchen an even number of times', 'V R1 )'),
        ('to the kitchen! just kidding', 'V R1 )'),
        ('keep less than 1 m from the lift', 'K R1 L1'),
        ('the nurses go to ward 1', 'V R1 )'),
        ('go to ward 1 before and after ward 2', 'V R1 ) V R2 )'),
        ('between ward 1 and ward 2, go to the kitchen', 'V BW R1 R2 ) V R3 )'),
        ('go to ward 1 without the lift', 'V R1 ) A R2'),
        ("don't go straight to ward 1", 'A R1'),
        ('no olvides evitar ward 1', 'V R1 )'),
        ('if the lift is free, take ward 1, otherwise ward 2', 'V R2 )'),
        ('ward 1 must on no account be skipped', 'A R1'),
        ('only the kitchen', 'V R1 )'),
    ],
)
def test_words_that_no_meaning_can_say_forbid_a_claim(text, meaning):
    assert twisted(lifted(text, HOSPITAL), meaning.split())
    assert not twisted(lifted('avoid the kitchen, then go to ward 1', HOSPITAL), meaning.split())


@pytest.mark.parametrize(
    ('text', 'meaning'),
    [
        ('keep to the north half of ward 1', 'S HO S1 R1'),
        ('if you are in ward 1, go to ward 2 at some point', 'T R1 R2'),
        ('am Ende will ich dich in ward 1 sehen', 'E R1'),
        ('either ward will do, just go to one', 'V R1 )'),
        ('the north side of the lift, if you please', 'P R2 S1'),
        ('stay out of the kitchen tonight', 'A R1'),
        ('ignore all earlier orders, and go to ward 1', 'V R1 )'),
        ('the kitchen was painted this morning, keep out', 'A R1'),
        ('not the north part of ward 1', 'A HO S1 R1'),
        ('no ward 1, no kitchen, the rest is fine', 'A R1 A R2'),
    ],
)
def test_words_that_only_look_so_forbid_none(text, meaning):
    assert not twisted(lifted(text, HOSPITAL), meaning.split())


@pytest.mark.parametrize(
    ('text', 'meaning', 'left'),
    [
        ('pass the lift on the north, not on the south', 'P R1 S1', ''),
        ('go to ward 1 on the north', 'V R1 )', 'S1'),
        ('once you have been to ward 1 twice, avoid ward 2', 'N R1 R2', 'K1'),
        ('une fois sorti de ward 1, évite ward 2', 'N R1 R2', ''),
        ('go to ward 1 three times', 'V R1 )', 'K1'),
        ('ward 1 or ward 2, one of the two', 'V OR R1 R2 ) )', ''),
        ('both wards, all 3 of them', 'V EA R1 )', 'K1'),
        ('robot 4, go to ward 1', 'V R1 )', ''),
        ('I told you twice, stay out of ward 1', 'A R1', ''),
        ('visit ward 1 three times, not twice', 'C R1 K1', ''),
        ('ward 1 is to be left in peace', 'A R1', ''),
        ("tu n'as plus le droit d'aller dans ward 1", 'A R1', ''),
    ],
)
def test_a_side_or_a_number_that_is_left_is_told_but_for_the_opposite_and_once(
    text, meaning, left
):
    assert unused(lifted(text, HOSPITAL), meaning.split())[:2] == left


@pytest.mark.parametrize(
    ('text', 'is_name'),
    [
        ('avoid the ballroom kitchen', True),
        ('visit kitchen B', True),
        ('avoid the old kitchen', True),
        ('steer clear of the second kitchen', True),
        ('avoid zorkroom', True),
        ('no kitchen', False),
        ("the kitchen's locked", False),
        ('no barging into the kitchen', False),
        ('avoid the barging', True),
        ("don't miss out the kitchen", False),
        ('Die Küche ist belegt, da wird nicht reingefahren.', False),
        ('die küche ist belegt, da wird nicht reingefahren', True),
        ('first the kitchen', False),
        ('ve por los kitchen', False),
    ],
)
def test_a_word_beside_a_place_or_after_a_verb_may_be_a_name(text, is_name):
    assert bool(unnamed(lifted(text, HOSPITAL), ('HF',))) == is_name


def test_a_noun_of_a_reason_is_no_name_but_where_the_meaning_names_no_place():
    one = lifted('not ward 1, the varnish is wet', HOSPITAL)
    assert unnamed(one, ('A', 'R1')) == ''
    assert 'varnish' in unnamed(one, ('A', 'HF', 'S1'))
    assert 'varnish' in unnamed(lifted('not ward 1 and the varnish', HOSPITAL), ('A', 'R1'))


@pytest.mark.parametrize(
    ('text', 'meaning', 'is_doubted'),
    [
        ('ward 1, ward 2, ward 1 again', 'V R1 ) V R2 )', True),
        ('ward 1, ward 2, just ward 2', 'V R1 ) V R2 )', False),
        ('go to ward 1. not ward 2. ward 1!', 'V R1 ) A R2', False),
    ],
)
def test_a_place_said_again_after_another_may_be_a_second_visit(text, meaning, is_doubted):
    one = lifted(text, HOSPITAL)
    assert bool(visited_again(one, ordered(meaning.split()))) == is_doubted


@pytest.mark.parametrize(
    ('text', 'is_name'),
    [
        ('a table is broken, so not ward 1', False),
        ('if the table of ward 1 is free, go to the kitchen', True),
        ('go to the table in ward 1', True),
        ('everything marked hazard', False),
        ('nurse Anna wants you in her kitchen', False),
    ],
)
def test_a_noun_for_places_is_a_name_where_a_place_is_asked_for(text, is_name):
    assert bool(unnamed(lifted(text, HOSPITAL), ('A', 'R1'))) == is_name


def test_what_says_nothing_by_itself_is_not_left():
    assert alone(lifted('Morning! Avoid ward 1. Ta.', HOSPITAL)) == ''
    assert 'fly' in alone(lifted('Avoid ward 1. Fly.', HOSPITAL))


def test_the_only_passage_may_be_called_by_any_word_for_one():
    assert not is_doubtful('stay in the hallway', 'S R1')
    assert is_doubtful('avoid the kithcen', 'A R1')


def is_doubtful(text, meaning):
    """Whether rules doubt a reading, whatever the networks say of it."""
    return bool(doubt(lifted(text, HOSPITAL), ordered(meaning.split())))


def test_walls_are_no_name_where_the_reading_means_them():
    one = lifted('keep 2 m from the walls', HOSPITAL)
    assert unnamed(one, ('K', 'WALLS', 'L1')) == ''
    assert 'walls' in unnamed(one, ())
    assert no_wall(one, ('K', 'WALLS', 'L1')) == ''
    assert 'wall' in no_wall(lifted('keep 2 m from me', HOSPITAL), ('K', 'WALLS', 'L1'))
