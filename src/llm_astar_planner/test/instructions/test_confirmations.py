"""What a person has answered is not asked again on the same map."""

import json

import pytest
from instructions.grammar.hospital import HOSPITAL
from llm_astar_msgs_adapter.maps.places import NO_PLACES
from llm_astar_planner.instructions.current import (
    Confirmations,
    ConfirmationsError,
    CurrentInstruction,
    InstructionReader,
)
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import Understanding
from llm_astar_planner.instructions.specification import from_json

TEXT = 'avoid ward 2 and drive through the corridor'
# What the networks ask about too.
MISSPELT = 'avoid ward 2 and drive through the pharmcy'


def read(confirmations=None, text=TEXT):
    known = Confirmations() if confirmations is None else confirmations
    return known.applied(GrammarInterpreter().interpret(text, HOSPITAL, 1.0), HOSPITAL)


def test_an_answer_makes_the_same_reading_sure_next_time():
    known = Confirmations()
    asked = read(known)
    assert asked.status is Understanding.UNSURE
    assert asked.questions == ('Did you mean the hallway by "corridor"?',)
    known.remember(asked, HOSPITAL, answer=True)
    again = read(known)
    assert again.specification == asked.confirmed().specification
    assert again.status is Understanding.WHOLE
    assert read(known, 'avoid the corridor').status is Understanding.UNSURE


def test_an_answer_holds_for_one_map_only():
    known = Confirmations()
    asked = read()
    known.remember(asked, NO_PLACES, answer=True)
    assert known.applied(asked, HOSPITAL) is asked


def test_with_no_the_clause_is_not_understood():
    known = Confirmations()
    known.remember(read(), HOSPITAL, answer=False)
    refused = read(known)
    assert refused.sentence == ('avoid the ward 2; not understood: "visit the hallway"')
    assert refused.status is Understanding.PARTLY


def test_answers_are_kept_in_a_file_and_the_oldest_are_forgotten(tmp_path):
    path = tmp_path / 'answers.json'
    Confirmations(path).remember(read(), HOSPITAL, answer=True)
    assert read(Confirmations(path)).status is Understanding.WHOLE
    small = Confirmations(path, size=1)
    small.remember(read(None, 'stop at the pharmacy'), HOSPITAL, answer=True)
    assert len(small) == 1
    assert read(Confirmations(path)).status is Understanding.UNSURE
    assert json.loads(path.read_text(encoding='utf-8'))[0][1] == 'end in the pharmacy'


def test_two_that_write_one_file_lose_no_answer(tmp_path):
    path = tmp_path / 'answers.json'
    one, other = Confirmations(path), Confirmations(path)
    one.remember(read(), HOSPITAL, True)
    other.remember(read(text='visit the pharmcy'), HOSPITAL, False)
    assert len(Confirmations(path)) == len(other) == 2


@pytest.mark.parametrize('text', ['', '{"a": 1}', '[1]', '[["a", "b", "c"]]'])
def test_a_wrong_file_is_named(tmp_path, text):
    path = tmp_path / 'answers.json'
    path.write_text(text)
    with pytest.raises(ConfirmationsError, match=r'answers\.json'):
        Confirmations(path)


def test_the_current_instruction_is_confirmed_and_stays_so():
    changes = []
    held = CurrentInstruction(InstructionReader(None), lambda: changes.append(held.instruction))
    assert not held.confirm(True)
    held.set(MISSPELT, HOSPITAL)
    assert held.questions
    assert held.confirm(True)
    assert held.instruction.interpretation.status is Understanding.WHOLE
    assert not held.confirm(True)
    held.set('', HOSPITAL)
    held.set(MISSPELT, HOSPITAL)
    assert held.instruction.interpretation.status is Understanding.WHOLE
    assert len(changes) == 4


def test_an_answer_that_cannot_be_kept_holds_all_the_same(tmp_path):
    path = tmp_path / 'answers.json'
    held = CurrentInstruction(InstructionReader(None, Confirmations(path)), lambda: None)
    held.set(MISSPELT, HOSPITAL)
    path.write_text('spoilt')
    with pytest.raises(ConfirmationsError, match=r'answers\.json'):
        held.confirm(True)
    assert held.instruction.interpretation.status is Understanding.WHOLE


def test_the_current_instruction_is_refused():
    held = CurrentInstruction(InstructionReader(None), lambda: None)
    held.set(MISSPELT, HOSPITAL)
    held.confirm(False)
    interpretation = held.instruction.interpretation
    assert interpretation.status is Understanding.PARTLY
    assert not interpretation.questions


def test_questions_are_written_and_read_back():
    interpretation = read()
    found = interpretation.to_json()
    assert found['questions'] == ['Did you mean the hallway by "corridor"?']
    assert from_json(found['specification']) == interpretation.specification
