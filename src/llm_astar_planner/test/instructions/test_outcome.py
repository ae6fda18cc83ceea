"""What a person is told of an instruction, in one sentence."""

import math

import pytest
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.unsupported import Unsupported
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.instructions.regions import NamedPlace
from llm_astar_planner.instructions.specification import NOTHING_ASKED, Specification

LAB = Visit(regions=(NamedPlace('lab'),))
CORRIDOR = Avoid(SHOULD, region=NamedPlace('corridor'))
ATTIC = Avoid(region=NamedPlace('attic'))
SLOWLY = Unsupported(text='slowly', about='speed')
QUESTION = 'Did you mean the office by "officer"?'
OFFICER = Visit(unsure=QUESTION, regions=(NamedPlace('office'),))

KEPT = ClauseOutcome(LAB, ClauseStatus.KEPT, 'reached at 4.1, 3.0')
LEAST = ClauseOutcome(
    CORRIDOR, ClauseStatus.AS_FAR_AS_POSSIBLE, '7.8 m inside, the least possible'
)
MISSED = ClauseOutcome(LAB, ClauseStatus.NOT_KEPT, 'never nearer than 3.2 m')
WALLED = ClauseOutcome(LAB, ClauseStatus.IMPOSSIBLE, 'no free cell of it can be reached')
NOWHERE = ClauseOutcome(ATTIC, ClauseStatus.NOT_UNDERSTOOD, "there is no place named 'attic'")
NOT_READ = ClauseOutcome(Unknown(text='hm'), ClauseStatus.NOT_UNDERSTOOD)
SPEED = ClauseOutcome(SLOWLY, ClauseStatus.UNSUPPORTED)
UNSURE = ClauseOutcome(OFFICER, ClauseStatus.UNSURE, f'{QUESTION} (kept: reached at 4.1, 3.0)')


def outcome(*clauses, status=Understanding.WHOLE, note=''):
    specification = Specification(tuple(one.clause for one in clauses))
    return InstructionOutcome(Interpretation('it', specification, status=status), clauses, note)


@pytest.mark.parametrize(('clauses', 'sentence'), [
    ((KEPT,), 'The instruction is kept'),
    ((KEPT, KEPT), 'The instruction is kept'),
    ((LEAST,), 'The instruction is kept as far as possible: avoid the corridor, 7.8 m inside, '
     'the least possible'),
    ((KEPT, LEAST), 'The instruction is kept as far as possible: avoid the corridor, 7.8 m '
     'inside, the least possible'),
    ((MISSED,), 'The instruction is not kept: visit the lab (never nearer than 3.2 m)'),
    ((WALLED,),
     'The instruction is impossible: visit the lab (no free cell of it can be reached)'),
    ((KEPT, MISSED), '1 of 2 clauses is kept; not kept: visit the lab (never nearer than 3.2 m)'),
    ((KEPT, KEPT, NOWHERE), '2 of 3 clauses are kept; not understood: avoid the attic (there is '
     "no place named 'attic')"),
    ((MISSED, LEAST), 'The instruction is not kept: visit the lab (never nearer than 3.2 m); '
     'kept as far as possible: avoid the corridor, 7.8 m inside, the least possible'),
    ((MISSED, MISSED), 'The instruction is not kept: visit the lab (never nearer than 3.2 m); '
     'visit the lab (never nearer than 3.2 m)'),
    ((UNSURE,), f'A question first: {QUESTION}'),
    ((KEPT, UNSURE, MISSED),
     f'A question first: {QUESTION}; not kept: visit the lab (never nearer than 3.2 m)'),
], ids=str)  # fmt: skip
def test_one_sentence_says_what_became_of_an_instruction(clauses, sentence):
    found = outcome(*clauses)
    assert found.sentence() == sentence == found.to_json()['sentence']
    assert found.satisfied is (sentence == 'The instruction is kept')


@pytest.mark.parametrize(('clauses', 'sentence'), [
    ((KEPT, NOT_READ), '1 of 2 clauses is kept; not understood: "hm"'),
    ((KEPT, SPEED),
     '1 of 2 clauses is kept; unsupported: "slowly" is about speed, which a path does not have'),
    ((SPEED,),
     'The instruction is unsupported: "slowly" is about speed, which a path does not have'),
    ((KEPT,), 'What was understood is kept; partly understood'),
    ((LEAST,), 'The instruction is kept as far as possible: avoid the corridor, 7.8 m inside, '
     'the least possible; partly understood'),
], ids=str)  # fmt: skip
def test_nothing_is_kept_of_what_was_not_read_whole(clauses, sentence):
    found = outcome(*clauses, status=Understanding.PARTLY)
    assert found.sentence() == sentence
    assert found.satisfied is False


def test_what_asks_for_something_that_no_path_has_is_not_kept():
    assert outcome(KEPT, SPEED).satisfied is False


def test_an_instruction_without_clauses_is_told_from_one_that_was_not_read():
    nothing = Interpretation('hello', NOTHING_ASKED, status=Understanding.IRRELEVANT)
    found = InstructionOutcome(nothing)
    assert (found.sentence(), found.satisfied) == (
        'The instruction asks nothing of the path', None,
    )  # fmt: skip
    found = InstructionOutcome(not_understood('hm', 'no words of it are known'))
    assert found.sentence() == 'The instruction is not understood: no words of it are known'
    waiting = InstructionOutcome(Interpretation('x', status=Understanding.PENDING))
    assert waiting.sentence() == 'The instruction is not understood yet'
    no_path = InstructionOutcome(outcome(KEPT).interpretation, note='there is no path')
    assert no_path.sentence() == 'The instruction is not kept: there is no path'
    assert {found.satisfied, waiting.satisfied, no_path.satisfied} == {False}


def test_what_concerns_the_whole_is_told_last():
    found = outcome(MISSED, note='no path of cells keeps every clause').sentence()
    assert found.endswith('(never nearer than 3.2 m); no path of cells keeps every clause')


@pytest.mark.parametrize(('price', 'words', 'cost'), [
    (4.23, 'kept (reached at 4.1, 3.0), costs 4.2 m', ', costs 4.2 m'),
    (math.nan, 'kept (reached at 4.1, 3.0)', ''),
])  # fmt: skip
def test_a_clause_says_what_it_costs(price, words, cost):
    one = ClauseOutcome(LAB, ClauseStatus.KEPT, 'reached at 4.1, 3.0', price=price)
    assert (one.words, outcome(one).summary()) == (words, f'visit the lab: {words}')
    least = ClauseOutcome(CORRIDOR, ClauseStatus.AS_FAR_AS_POSSIBLE, '1 m inside', price=price)
    assert outcome(least).sentence().endswith(f'avoid the corridor, 1 m inside{cost}')
    assert ClauseOutcome(LAB, ClauseStatus.KEPT, price=price).words == f'kept{cost}'
