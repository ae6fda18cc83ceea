"""The instruction that is set: what is used while somebody else is asked, and after that."""

import threading
from dataclasses import replace

import pytest
from instruction_places import HOSPITAL
from llm_astar_msgs_adapter.maps.places import NO_PLACES
from llm_astar_planner.instructions import current
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.current import CurrentInstruction, InstructionReader
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.regions import NamedPlace
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import InstructionError

LONG = 20.0
FREE_WORDING = 'the soup smells, so keep clear of wherever they cook it'
KITCHEN = Avoid(region=NamedPlace('kitchen'))


class Remote:
    """Another process that answers when it is let."""

    name = 'client'

    def __init__(self, *, ready=True, status=Understanding.WHOLE):
        self.ready, self.status = ready, status
        self.gate = threading.Event()
        self.asked = []
        self.drops = 0

    def drop_oldest(self):
        self.drops += 1

    def interpret(self, text, places, time_limit):
        self.asked.append(text)
        assert self.gate.wait(LONG)
        if self.status is Understanding.PENDING:
            return replace(not_understood(text, 'no answer'), status=self.status)
        return Interpretation(text, Specification((KITCHEN,)), 'model', self.status)


@pytest.fixture
def start():
    """Make an instruction that is set, with a list of what was understood, as it changed."""
    readers = []

    def made(remote):
        reader = InstructionReader(remote)
        readers.append((reader, remote))
        statuses, changed = [], threading.Condition()

        def on_change():
            with changed:
                instruction = held.instruction
                statuses.append(instruction and instruction.interpretation.status)
                changed.notify_all()

        def wait_for(status):
            with changed:
                assert changed.wait_for(lambda: statuses[-1:] == [status], LONG), statuses

        held = CurrentInstruction(reader, on_change)
        return held, statuses, wait_for

    yield made
    for reader, remote in readers:
        if remote is not None:
            remote.gate.set()
        reader.close()


def test_what_the_grammar_reads_whole_is_asked_of_nobody(start):
    remote = Remote()
    held, statuses, _ = start(remote)
    held.set('avoid the kitchen', HOSPITAL)
    assert held.instruction.interpretation.sentence == 'avoid the kitchen'
    assert held.instruction.places is HOSPITAL
    held.set('  avoid  the kitchen\n', HOSPITAL)
    held.set('', HOSPITAL)
    assert held.instruction is None
    assert statuses == [Understanding.WHOLE, None]
    assert remote.asked == []


def test_a_plan_says_not_understood_yet_until_the_answer_is_there(start):
    remote = Remote()
    held, statuses, wait_for = start(remote)
    held.set(FREE_WORDING, HOSPITAL)
    assert held.instruction.interpretation.status is Understanding.PENDING
    remote.gate.set()
    wait_for(Understanding.WHOLE)
    assert held.instruction.interpretation.understood_by == 'model'
    held.ask_again()
    assert (remote.asked, len(statuses)) == ([FREE_WORDING], 2)


def test_the_answer_to_an_earlier_instruction_is_not_used(start):
    remote = Remote()
    held, statuses, _ = start(remote)
    done = threading.Event()
    held.set(FREE_WORDING, HOSPITAL)
    held.set('avoid the lobby', HOSPITAL)
    remote.gate.set()
    held._reader.read('something else entirely', HOSPITAL, lambda _: done.set())
    assert done.wait(LONG)
    assert held.instruction.interpretation.sentence == 'avoid the lobby'
    assert statuses == [Understanding.PENDING, Understanding.WHOLE]


def test_somebody_who_appears_later_is_asked_then(start):
    remote = Remote(ready=False)
    remote.gate.set()
    held, _, wait_for = start(remote)
    held.set(FREE_WORDING, HOSPITAL)
    interpretation = held.instruction.interpretation
    assert interpretation.status is not Understanding.PENDING
    assert 'client is not there to be asked' in interpretation.detail
    held.ask_again()
    assert remote.asked == []
    remote.ready = True
    held.ask_again()
    wait_for(Understanding.WHOLE)


def test_who_did_not_answer_is_asked_again_after_a_while(start, monkeypatch):
    monkeypatch.setattr(current, 'ASK_AGAIN_S', 0.0)
    remote = Remote(status=Understanding.PENDING)
    remote.gate.set()
    held, _, wait_for = start(remote)
    held.set(FREE_WORDING, HOSPITAL)
    while held._ask_at > LONG * 1e9:  # until the question has failed
        threading.Event().wait(0.01)
    assert held.instruction.interpretation.status is Understanding.PENDING
    assert 'no answer' in held.instruction.interpretation.detail
    remote.status = Understanding.WHOLE
    held.ask_again(anew=True)
    wait_for(Understanding.WHOLE)


def test_what_was_understood_holds_while_a_changed_client_is_asked(start):
    remote = Remote()
    remote.gate.set()
    held, statuses, wait_for = start(remote)
    held.set(FREE_WORDING, HOSPITAL)
    wait_for(Understanding.WHOLE)
    remote.gate.clear()
    remote.status = Understanding.PARTLY
    held.ask_again(anew=True)
    assert held.instruction.interpretation.status is Understanding.WHOLE
    assert remote.drops == 1
    remote.gate.set()
    wait_for(Understanding.PARTLY)
    remote.ready = False
    held.ask_again(anew=True)
    assert held.instruction.interpretation.understood_by == 'model'
    assert len(remote.asked) == 2
    assert len(statuses) == 3


def test_other_places_give_another_meaning(start):
    held, statuses, _ = start(None)
    held.set('avoid the kitchen', HOSPITAL)
    held.set('avoid the kitchen', NO_PLACES)
    assert statuses == [Understanding.WHOLE, Understanding.NONE]


def test_an_instruction_that_is_too_long_is_refused_and_the_last_one_stays(start):
    held, _, _ = start(None)
    held.set('avoid the kitchen', HOSPITAL)
    with pytest.raises(InstructionError, match='501 characters'):
        held.set('x' * 501, HOSPITAL)
    assert held.instruction.interpretation.sentence == 'avoid the kitchen'
