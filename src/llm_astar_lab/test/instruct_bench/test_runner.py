"""Instructions are understood, planned by the real planner, and checked."""

from dataclasses import replace

import pytest
from instruction_suites import write_suite
from llm_astar_lab.instruct_bench.report import unanswered_lines
from llm_astar_lab.instruct_bench.runner import (
    NO_SOURCE,
    TRUE_SOURCE,
    SuiteRunner,
    interpreter_source,
)
from llm_astar_lab.instruct_bench.suite import load_suite
from llm_astar_planner.instructions.interpretation import Interpretation, not_understood, status_of
from llm_astar_planner.planning.types import PlanRequest


class Parrot:
    """An interpreter that always understands the truth of one instruction."""

    name = 'parrot'

    def __init__(self, specification, seconds=0.0):
        self.specification = specification
        self.seconds = seconds
        self.asked = []

    def interpret(self, text, places, time_limit):
        self.asked.append((text, time_limit))
        status = status_of(self.specification)
        return Interpretation(text, self.specification, self.name, status, seconds=self.seconds)


class Broken:
    name = 'broken'

    def interpret(self, text, places, time_limit):
        raise TypeError('no words')


class Deaf:
    name = 'deaf'

    def interpret(self, text, places, time_limit):
        return not_understood(text, 'no answer in time')


@pytest.fixture
def suite(tmp_path):
    return load_suite(write_suite(tmp_path))


@pytest.fixture
def runner():
    # Time enough to compile on a busy machine.
    request = PlanRequest((0, 0), (0, 0), want_expanded=False, time_limit=120.0)
    return SuiteRunner(replace(request, max_suboptimality=1.0))


def test_with_the_truth_everything_that_can_be_met_is_met_and_claimed(suite, runner):
    results = {item.instruction.id: item for item in runner.run(suite.instructions, [TRUE_SOURCE])}
    for name in ('door', 'tür'):
        assert results[name].fulfilled
        assert results[name].claimed
        assert results[name].plan.length * 0.5 > 8.0
    assert all(result.exact for result in results.values())
    assert not any(result.false_claim or result.false_clauses for result in results.values())
    assert {results[name].recognition for name in ('vault', 'both', 'hurry')} == {'recognised'}


def test_without_instruction_only_what_is_met_by_chance_is_met(suite, runner):
    results = list(runner.run(suite.instructions, [NO_SOURCE]))
    assert [result.instruction.id for result in results if result.fulfilled] == ['hurry']
    assert [result.already for result in results] == [result.fulfilled for result in results]
    assert not any(result.claimed for result in results)
    assert results[0].direct_length == pytest.approx(8.0)


def test_what_is_misunderstood_is_planned_all_the_same_and_fails_its_checks(suite, runner):
    parrot = Parrot(suite.find('tür').truth, 0.25)
    result = runner.run_one(suite.find('vault'), interpreter_source('parrot', parrot, 5.0))
    assert not result.exact
    assert not result.fulfilled
    # The path does avoid the south door, as understood: the claim of that is false.
    assert result.false_claim
    assert result.seconds == 0.25
    assert parrot.asked == [('visit the vault', 5.0)]


def test_what_is_not_understood_leaves_the_direct_path(suite, runner):
    result = runner.run_one(suite.find('door'), interpreter_source('deaf', Deaf(), 5.0))
    assert result.plan.length * 0.5 == pytest.approx(result.direct_length)
    assert not result.claimed
    assert not result.fulfilled


def test_an_interpreter_that_fails_leaves_the_instruction_unanswered(suite, runner):
    result = runner.run_one(suite.find('door'), interpreter_source('broken', Broken(), 5.0))
    assert result.unanswered
    assert not result.claimed
    assert result.plan.code == 0
    assert unanswered_lines([result]) == [
        'broken: 1 instructions without an answer, the first door: failed with TypeError: no words'
    ]


def test_a_text_that_is_too_long_or_unprintable_reaches_no_interpreter_as_it_is(tmp_path, runner):
    def change(suite):
        suite['instructions'][4]['text'] = 'x' * 501
        suite['instructions'][0]['text'] = ' go\x07through\nthe north door '

    suite = load_suite(write_suite(tmp_path, change))
    parrot = Parrot(suite.find('door').truth)
    source = interpreter_source('parrot', parrot, 5.0)
    assert runner.run_one(suite.find('door'), source).fulfilled
    assert parrot.asked == [('go through the north door', 5.0)]
    result = runner.run_one(suite.find('hurry'), source)
    assert result.recognition == 'not understood'
    assert '501 characters' in result.outcome.interpretation.detail
    assert len(parrot.asked) == 1


def test_a_pair_is_planned_without_instruction_once(suite, runner):
    list(runner.run(suite.instructions, [NO_SOURCE, TRUE_SOURCE]))
    assert len(runner.direct_plans) == len(runner.planners) == 1
