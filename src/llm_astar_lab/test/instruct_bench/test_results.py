"""How results are judged, with reports made up to be right, wrong and hostile."""

import numpy as np
import pytest
from instruction_suites import write_suite
from llm_astar_lab.instruct_bench.checks import Verdict
from llm_astar_lab.instruct_bench.report import (
    Share,
    chain_text,
    grouped,
    markdown_summary,
    result_row,
    share_text,
    summarise,
    summary_to_json,
    text_summary,
)
from llm_astar_lab.instruct_bench.runner import InstructionResult
from llm_astar_lab.instruct_bench.suite import load_suite
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding, status_of
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.instructions.specification import from_json
from llm_astar_planner.planning.types import Plan, ResultCode

SATISFIED, VIOLATED = ClauseStatus.KEPT, ClauseStatus.NOT_KEPT
IMPOSSIBLE, GUESSED = ClauseStatus.IMPOSSIBLE, ClauseStatus.UNSURE
HOLDS, FAILS = Verdict(True, 'as it should'), Verdict(False, '2.00 m off')
NOTHING = {'clauses': []}


@pytest.fixture(scope='module')
def suite(tmp_path_factory):
    return load_suite(write_suite(tmp_path_factory.mktemp('suite')))


@pytest.fixture
def judge(suite):
    """Return a result of the instruction `name` with a report of one's own."""

    def make(name, verdicts, statuses=(), spec=None, status=None, note='', **fields):
        instruction = suite.find(name)
        specification = instruction.truth if spec is None else from_json(spec)
        understanding = status_of(specification) if status is None else status
        interpretation = Interpretation(
            instruction.text, specification, 'fake', understanding, prompt_tokens=7
        )
        clauses = tuple(
            ClauseOutcome(clause, item) for clause, item in zip(specification.clauses, statuses)
        )
        plan = Plan(
            ResultCode.NONE,
            '',
            'guided',
            (0, 0),
            (4, 0),
            np.zeros((0, 0), bool),
            np.array([(0, 0), (4, 0)]),
            length=4.0,
        )
        outcome = InstructionOutcome(interpretation, clauses, note)
        values = {'already': False, 'seconds': 0.002, 'planning_seconds': 0.01, **fields}
        values = {'source': 'fake', 'outcome': outcome, 'plan': plan, **values}
        return InstructionResult(
            instruction, verdicts=tuple(verdicts), direct_length=2.0, **values
        )

    return make


def visit(place):
    return {'clauses': [{'kind': 'visit', 'region': {'place': place}}]}


def test_a_true_claim(judge):
    result = judge('door', [HOLDS], [SATISFIED])
    assert (result.exact, result.claimed, result.fulfilled) == (True, True, True)
    assert not result.false_claim
    assert not result.false_clauses
    assert result.recognition == ''


def test_a_claim_of_a_path_that_fails_a_check_is_false(judge):
    result = judge('door', [FAILS], [SATISFIED])
    assert result.false_claim
    assert len(result.false_clauses) == 1


def test_a_violation_that_is_reported_is_no_claim(judge):
    result = judge('door', [FAILS], [VIOLATED])
    assert not result.claimed
    assert not result.false_claim


def test_without_a_path_nothing_is_fulfilled(judge):
    result = judge('door', [], [SATISFIED])
    plan = Plan(ResultCode.NO_VALID_PATH, 'walled in', 'guided', (0, 0), (4, 0), np.zeros((0, 0)))
    failed = InstructionResult(result.instruction, 'fake', result.outcome, plan, (), 2.0, False)
    assert not failed.fulfilled
    assert failed.false_claim
    assert 'walled in' in chain_text(failed)


def test_what_counts_as_exact_may_be_another_specification(judge):
    avoid = {'clauses': [{'kind': 'avoid', 'region': {'place': 'south door'}}]}
    assert judge('door', [HOLDS], [SATISFIED], avoid).exact
    assert not judge('door', [HOLDS], [SATISFIED], visit('desk')).exact


def test_a_clause_that_was_not_asked_counts_where_a_check_fails(judge):
    assert judge('door', [FAILS], [SATISFIED], visit('desk')).unasked_clauses
    assert not judge('door', [FAILS], [SATISFIED], visit('desk')).false_clauses
    assert not judge('door', [HOLDS], [SATISFIED], visit('desk')).unasked_clauses
    assert not judge('door', [FAILS], [VIOLATED], visit('desk')).unasked_clauses


def test_a_clause_of_an_accepted_reading_was_asked(judge):
    avoid = {'clauses': [{'kind': 'avoid', 'region': {'place': 'south door'}}]}
    result = judge('door', [FAILS], [SATISFIED], avoid)
    assert result.false_clauses
    assert not result.unasked_clauses


def test_of_several_clauses_the_one_whose_check_fails_is_wrong(judge):
    result = judge('both', [HOLDS, FAILS], [SATISFIED, SATISFIED])
    assert [outcome.clause.kind for outcome in result.false_clauses] == ['avoid']
    result = judge('both', [HOLDS, FAILS], [SATISFIED, VIOLATED])
    assert not result.false_clauses


@pytest.mark.parametrize('name', ['vault', 'both', 'hurry'])
def test_whatever_cannot_be_met_is_never_rightly_claimed(judge, name):
    result = judge(name, [HOLDS, HOLDS], [SATISFIED, SATISFIED], visit('desk'))
    assert result.claimed
    assert result.false_claim
    assert result.recognition == 'missed'


@pytest.mark.parametrize(
    ('name', 'statuses', 'fields', 'recognition'),
    [
        ('vault', [IMPOSSIBLE], {}, 'recognised'),
        ('vault', [VIOLATED], {}, 'violated'),
        ('vault', [], {'spec': NOTHING, 'status': Understanding.NONE}, 'not understood'),
        ('vault', [], {'spec': NOTHING, 'status': Understanding.PENDING}, 'not understood'),
        ('vault', [], {'spec': NOTHING, 'status': Understanding.IRRELEVANT}, 'missed'),
        ('both', [SATISFIED, VIOLATED], {'note': 'they exclude each other'}, 'recognised'),
        ('both', [SATISFIED, VIOLATED], {}, 'violated'),
        ('both', [SATISFIED, SATISFIED], {'note': 'they exclude each other'}, 'missed'),
        ('hurry', [], {}, 'recognised'),
        ('hurry', [], {'status': Understanding.NONE}, 'not understood'),
        ('hurry', [VIOLATED], {'spec': visit('desk')}, 'missed'),
        ('hurry', [GUESSED], {'spec': visit('desk'), 'status': Understanding.PARTLY},
         'not understood'),
        ('hurry', [SATISFIED], {'spec': visit('desk'), 'status': Understanding.PARTLY}, 'missed'),
        ('door', [IMPOSSIBLE], {}, ''),
    ],
)  # fmt: skip
def test_how_what_cannot_be_met_is_recognised(judge, name, statuses, fields, recognition):
    assert judge(name, [FAILS, FAILS], statuses, **fields).recognition == recognition


def test_the_source_without_instruction_claims_nothing(judge):
    result = judge('hurry', [HOLDS], outcome=None)
    assert (result.claimed, result.exact, result.recognition) == (False, False, '')


@pytest.fixture
def results(judge):
    return [
        judge('door', [HOLDS], [SATISFIED]),
        judge('tür', [FAILS], [SATISFIED], visit('desk'), seconds=0.5),
        judge('vault', [FAILS], [IMPOSSIBLE]),
        judge('both', [HOLDS, FAILS], [SATISFIED, SATISFIED]),
        judge('hurry', [HOLDS], [], already=True),
    ]


def test_the_figures_of_a_run(results):
    summary = summarise(results)
    assert summary['exact'] == Share(4, 5)
    assert summary['satisfied'] == Share(1, 2)
    assert summary['already'] == Share(0, 2)
    assert summary['false_claims'] == Share(2, 5)
    assert summary['false_clauses'] == Share(1, 4)
    assert summary['unasked_clauses'] == Share(1, 4)
    assert summary['recognised'] == Share(2, 3)
    assert (summary['seconds'], summary['longest'], summary['prompt_tokens']) == (0.002, 0.5, 35)
    assert summary_to_json(results)['fake']['language']['de']['false_claims']['percent'] == 100.0


def test_results_are_grouped_by_what_the_suite_says_of_them(results):
    assert list(grouped(results, 'clause')) == ['avoid', 'no clause', 'visit']
    assert len(grouped(results, 'clause')['avoid']) == 2
    assert list(grouped(results, 'style')) == ['free', 'templated', 'unstated']
    assert list(grouped(results, 'clauses')) == ['0', '1', '2']


def test_the_tables_have_a_row_for_each_source_and_group(results):
    text = text_summary(results)
    assert 'fake    5             80.0 (37.6-96.4) 4/5' in text
    assert 'templated' in text
    report = markdown_summary(
        results,
        {
            'dataset': {'file': 'suite.json', 'sha256': 'ab' * 32},
            'machine': {'cores': 2, 'processor': 'x', 'python': '3'},
            'version': '1',
        },
    )
    assert '| fake | avoid | 2 |' in report
    assert '- `tür` "meide die Südtür": visit the desk; inside_max: 2.00 m off' in report


def test_one_instruction_in_full(results):
    text = chain_text(results[1])
    for part in (
        'tür: map rooms, de, expected ok; source fake',
        'truth       avoid the south door',
        'understood  visit the desk',
        'clause      visit the desk: kept',
        'reported    The instruction is kept, which is false',
        'check       inside_max fails (2.00 m off)',
        'path        2.00 m, 2.00 m without instruction',
    ):
        assert part in text
    row = result_row(results[1])
    assert (row['false_claim'], row['exact'], row['clauses']) == (1, 0, 'avoid')


def test_shares_are_written_with_interval_and_counts():
    assert share_text(Share(0, 0)) == '-'
    assert share_text(Share(54, 58)) == '93.1 (83.6-97.3) 54/58'
