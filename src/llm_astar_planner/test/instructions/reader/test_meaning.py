"""The language of meanings: what may be written, and what clauses it makes."""

import pytest
from instruction_places import HOSPITAL
from llm_astar_planner.instructions.reader.lifting import lifted
from llm_astar_planner.instructions.reader.meaning import (
    KINDS,
    Unreadable,
    Writer,
    after,
    flat,
    ordered,
    parsed,
    told_in_turn,
)
from llm_astar_planner.instructions.reader.translation import Translation
from llm_astar_planner.instructions.specification import from_json

TEXT = 'the kitchen, ward 1, the blue rooms, 2 m, north, at most twice, 3'
ONE = lifted(TEXT, HOSPITAL)
MEANINGS = (
    'A R1', 'W A R1', 'V R1 ) V R2 )', 'V EA R3 )', 'V OR R1 R2 ) )', 'B R1 R2', 'S HF S1',
    'P R1 S1', 'PX R1 S1', 'K WALLS L1', 'K R1 D', 'E START', 'A EX R3 R2 )', 'C R1 K1',
    'CL R1 K2', 'CE R1 ONE', 'CG R2 K2', 'A BW R1 R2', 'V AL R1 )', 'T R1 R2', 'N R1 R2',
)  # fmt: skip


def sentence(meaning):
    writer = Writer(ONE.slots, {'': 'all of it', 'speed': 'slowly'})
    clauses = [writer.clause(part) for part in ordered(meaning.split())]
    return from_json({'version': 2, 'clauses': clauses}).sentence


@pytest.mark.parametrize(
    ('meaning', 'words'),
    [
        ('A R1', 'avoid the kitchen'),
        ('W A R1', 'if possible, avoid the kitchen'),
        ('V R1 ) V R2 )', 'visit the kitchen, then the ward 1'),
        ('V EA R3 )', 'visit the ward 1 and the ward 2 in any order'),
        ('V OR R1 R2 ) )', 'visit either the kitchen or the ward 1'),
        ('B R1 R2', 'do not enter the ward 1 before the kitchen'),
        ('S HF S1', 'stay in the north half'),
        ('P R1 S1', 'pass the kitchen on the north side'),
        ('PX R1 S1', 'pass the kitchen on the south side'),
        ('CL R1 K2', 'enter the kitchen at most 3 times'),
        ('CE R1 ONE', 'enter the kitchen exactly once'),
        ('K WALLS L1', 'keep 2 m away from the walls'),
        ('K R1 D', 'keep 1 m away from the kitchen'),
        ('E START', 'end in the start'),
        ('A EX R3 R2 )', 'avoid all blue places except the ward 1'),
        ('A ?', 'not understood: "all of it"'),
        ('U_speed', '"slowly" is about speed, which a path does not have'),
    ],
)
def test_a_meaning_makes_clauses(meaning, words):
    assert sentence(meaning) == words


@pytest.mark.parametrize(
    'meaning', ['A', 'R1', 'A R9', 'V R1', 'C R1', 'CN R1 K1', 'CL R1 K1', 'C R1 ONE']
)
def test_what_is_no_meaning_is_refused(meaning):
    with pytest.raises(Unreadable):
        sentence(meaning)


@pytest.mark.parametrize('meaning', MEANINGS)
def test_clauses_are_translated_back_to_their_meaning(meaning):
    writer = Writer(ONE.slots, {'': ''})
    clauses = [writer.clause(part) for part in ordered(meaning.split())]
    assert ordered(Translation(ONE.slots, HOSPITAL).meaning(clauses)) == ordered(meaning.split())


def test_what_a_sentence_does_not_name_is_not_translated():
    translation = Translation(ONE.slots, HOSPITAL)
    lift = {'kind': 'avoid', 'region': {'place': 'lift'}}
    assert translation.meaning([lift]) == ['A', '?']
    with pytest.raises(Unreadable):
        translation.meaning([{'kind': 'keep_distance', 'from': 'walls', 'metres': 3.0}])


def test_a_meaning_is_told_in_the_order_of_mention():
    meaning = ['A', 'R2', 'A', 'R1', 'V', 'R3', 'R2', ')']
    assert told_in_turn(['@R2', '@R3', '@R1'], meaning) == [
        'V',
        'R2',
        'R3',
        ')',
        'A',
        'R2',
        'A',
        'R1',
    ]
    assert list(flat(parsed(iter(meaning)))) == meaning


def test_to_avoid_one_or_the_other_is_to_avoid_both():
    assert ordered(['A', 'OR', 'R1', 'R2', ')']) == ordered(['A', 'R2', 'A', 'R1'])


def test_what_is_in_any_order_is_the_same_meaning():
    assert ordered(['A', 'R1', 'A', 'R2']) == ordered(['A', 'R2', 'A', 'R1', 'A', 'R1'])
    assert ordered(['V', 'R1', 'R2', ')']) == ordered(['V', 'R2', 'R1', ')'])
    assert ordered(['V', 'R1', ')', 'V', 'R2', ')']) != ordered(['V', 'R2', ')', 'V', 'R1', ')'])
    assert ordered(['B', 'R1', 'R2']) != ordered(['B', 'R2', 'R1'])


MEANING = 'V R1 R2 ) W A OR R1 R2 R3 ) B HO S1 R1 R2 K WALLS L1 C R1 K1 <end>'


def test_each_token_of_a_meaning_is_one_that_is_expected_there():
    stack = 't'
    for token in MEANING.split():
        assert token in KINDS[stack[0]]
        stack = after(stack, token)
    assert 'L1' not in KINDS['r']
    assert ')' not in KINDS['f']
