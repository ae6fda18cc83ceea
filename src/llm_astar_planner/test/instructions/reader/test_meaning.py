"""The language of meanings: what may be written, and what clauses it makes."""

import pytest
from instruction_places import HOSPITAL
from llm_astar_planner.instructions.reader.lifting import lifted
from llm_astar_planner.instructions.reader.meaning import Unreadable, Writer, ordered
from llm_astar_planner.instructions.reader.network import KINDS, after
from llm_astar_planner.instructions.specification import from_json

ONE = lifted('the kitchen, ward 1, the blue rooms, 2 m, north, at most twice', HOSPITAL)


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


@pytest.mark.parametrize('meaning', ['A', 'R1', 'A R9', 'V R1', 'C R1', 'CN R1 K1', 'A W'])
def test_what_is_no_meaning_is_refused(meaning):
    with pytest.raises(Unreadable):
        sentence(meaning)


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
