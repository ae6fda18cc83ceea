"""What is wrong with a reply: each problem on its own, and their shares."""

import math

import pytest
from benchmark_samples import row, tasks_of
from llm_astar_lab.analysis.replies import (
    example_routes,
    problems_column,
    reply_shares,
)
from llm_astar_lab.analysis.statistics import wilson_interval
from llm_astar_lab.analysis.summary import summarise
from llm_astar_lab.datasets.named import BenchmarkSample
from llm_astar_lab.report.pages import to_json
from llm_astar_lab.report.table import Table, reply_table
from llm_astar_lab.results.row import Variant
from llm_astar_lab.runner.engine import run_task
from llm_astar_lab.runner.sources import SourceSpec
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Sample
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.prompts.examples import ASK_FOR_A_LIST
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.prompts.template import load_template
from llm_astar_planner.waypoints.source import Message, Provenance, SourceStatus, WaypointReply

# Lattice points have the offset (10, 20) to cells; a wall is between the start and the goal.
MAP = BarrierMap(0, (10, 61), (20, 51), (Barrier(30, 10, 40),), (), (Sample((15, 25), (15, 35)),))
START, GOAL = (5, 5), (5, 15)
COSTMAP = Costmap(MAP.to_grid())
ROUND = 'Generated Path: [[15, 25], [43, 30], [15, 35]]'


def reply_of(text, **values):
    answer = read_answer(text)
    cells = tuple((x - 10, y - 20) for x, y in answer.waypoints)
    return WaypointReply(cells, 'some', answer.status, text=text, **values)


def judge(text, **values):
    return problems_column(reply_of(text, **values), COSTMAP, START, GOAL)


@pytest.mark.parametrize(
    ('text', 'problems'),
    [
        (ROUND, 'none'),
        ('I see no way.', 'no_list'),
        ('Generated Path: []', 'empty'),
        ('Generated Path: [[16, 25], [43, 30], [15, 35]]', 'wrong_start'),
        ('Generated Path: [[15, 25], [43, 30]]', 'wrong_goal'),
        ('Generated Path: [[15, 25], [43, 30], [99, 30], [43, 30], [15, 35]]', 'off_map'),
        ('Generated Path: [[15, 25], [20, 30], [15, 35]]', 'on_obstacle'),
        ('Generated Path: [[15, 25], [15, 35]]', 'crosses_barrier'),
        # The list is open, so it was cut: its last point is not taken for the goal.
        ('Generated Path: [[15, 25], [43, 30], [4', 'cut'),
    ],
)
def test_each_problem_is_named(text, problems):
    assert judge(text) == problems


def test_no_reply_is_not_judged():
    failed = WaypointReply(status=SourceStatus.TIMEOUT, model='some')
    assert problems_column(failed, COSTMAP, START, GOAL) == ''
    baseline = WaypointReply(((1.0, 2.0),), 'oracle')
    assert problems_column(baseline, COSTMAP, START, GOAL) == ''
    silent = WaypointReply(status=SourceStatus.MALFORMED, model='some')
    assert problems_column(silent, COSTMAP, START, GOAL) == 'no_list'


def test_what_the_server_says_of_the_end_comes_first():
    assert judge(ROUND, provenance=Provenance(finish_reason='length')) == 'cut'
    open_list = 'Generated Path: [[15, 25], [43, 30], [15, 35]'
    assert judge(open_list, provenance=Provenance(finish_reason='stop')) == 'none'


def test_an_example_of_the_recorded_prompt_is_recognised_when_it_is_repeated():
    question = 'Generated Path: [[1, 2], [3, 4]]\nGenerated Path: [[15, 25], [7, 7], [15, 35]]\n'
    messages = (Message('user', question + 'Start Point: [15, 25]\nGenerated Path:'),)
    assert 'example_repeated' in judge('Generated Path: [[1, 2], [3, 4]]', messages=messages)
    assert 'in_prompt' in judge('Generated Path: [[1, 2], [3, 4]]', messages=messages)
    assert judge(ROUND, messages=messages) == 'in_prompt'


def test_examples_as_turns_are_examples_and_own_answers_are_not():
    turns = (
        Message('user', 'Start Point: [1, 2]'),
        Message('assistant', '[[1, 2], [3, 4]]'),
        Message('user', 'Start Point: [15, 25]'),
        Message('assistant', ROUND),
        Message('user', ASK_FOR_A_LIST),
    )
    assert example_routes(turns, 'few_shot') == {((1, 2), (3, 4))}
    assert judge(ROUND, messages=turns) == 'none'


def test_without_messages_the_template_and_the_published_prompt_count():
    assert 'example_repeated' in judge('[[8, 25], [31, 19], [35, 17], [42, 6]]', prompt='few_shot')
    published = '[[40, 20], [31, 15], [20, 3], [10, 10]]'
    assert 'example_repeated' in judge(published, prompt='few_shot, repaired up to 2x')
    assert 'example_repeated' in judge(published, prompt='cot+turns')
    assert 'example_repeated' not in judge(published, prompt='my own')
    for name in ('few_shot', 'cot', 'repe'):
        assert len(example_routes((), name)) >= len(load_template(name).text.split('Path: [[')) - 1


def test_a_row_tells_what_is_wrong_once_per_method_and_the_reply_counts_once():
    class Model:
        name = 'model'

        def waypoints(self, query):
            del query
            return reply_of(ROUND[:-3], model='m', seconds=2.5, completion_tokens=9)

    sample = BenchmarkSample(MAP, 0, MAP.samples[0])
    sources = [SourceSpec(), SourceSpec(Model(), 'model', 'p', 'm')]
    rows = run_task(tasks_of([sample], sources, ['llm_astar', 'waypoints_only'])[0])
    assert [(row.method, row.reply_problems, row.seconds_reply) for row in rows[2:]] == [
        ('llm_astar', 'cut', 2.5), ('waypoints_only', 'cut', 2.5),
    ]  # fmt: skip
    assert {row.reply_problems for row in rows[:2]} == {''}
    assert all(math.isnan(row.seconds_reply) for row in rows[:2])
    table = reply_table(summarise(rows))
    heads = [column.head for column in table.columns]
    (line,) = table.rows
    shown = dict(zip(heads, line))
    assert (shown['Model or source'], shown['Replies'], shown['Tokens out, mean']) == ('m', 1, 9)
    assert shown['Cut at the token limit (%)'] == wilson_interval(1, 1)
    assert shown['Seconds, median'] == 2.5


def test_shares_are_of_all_replies_with_wilsons_interval():
    variant = Variant('guided', 'replay', 'few_shot', 'm')
    said = ['none', 'none', 'in_prompt', 'wrong_start;wrong_goal', 'wrong_goal;in_prompt', '']
    rows = [
        row(variant, pair=pair, reply_problems=text, seconds_reply=pair if text else math.nan)
        for pair, text in enumerate(said)
    ]
    (summary,) = summarise(rows)
    assert (summary.replies['replies'], summary.replies['none']) == (5, 3)
    assert summary.replies['wrong_start_or_goal'] == 2
    assert reply_shares(summary.replies)['in_prompt'] == wilson_interval(2, 5)
    values = to_json(summary)
    assert values['reply_shares']['parsed']['value'] == 1.0
    assert values['seconds_reply']['median'] == 2.0
    (without,) = summarise([row(variant)])
    assert not {'replies', 'reply_shares', 'seconds_reply'} & set(to_json(without))
    assert not reply_table([without]).rows


def test_two_recordings_of_one_model_are_told_apart_in_the_tables():
    variants = [Variant('guided', f'replay:{name}', 'few_shot', 'm') for name in ('one', 'two')]
    rows = [row(variant, reply_problems='none') for variant in variants]
    summaries = summarise(rows)
    for table in (Table.of('main', summaries), reply_table(summaries)):
        shown = {cell for line in table.rows for cell in line if isinstance(cell, str)}
        assert {'m (one)', 'm (two)'} <= shown
