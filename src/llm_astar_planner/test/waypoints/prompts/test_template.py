"""The parts of a template, and how it is put to a model."""

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.prompts.map_description import describe
from llm_astar_planner.waypoints.prompts.template import (
    TEMPLATES,
    Example,
    Template,
    load_template,
)
from llm_astar_planner.waypoints.source import WaypointQuery

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 3, 25),), (Barrier(25, 10, 22),))
DESCRIPTION = describe(WaypointQuery(Costmap(MAP.to_grid()), (39, 22), (3, 14)))
QUESTION = (
    'Start Point: [39, 22]\nGoal Point: [3, 14]\n'
    'Horizontal Barriers: [[10, 3, 25]]\nVertical Barriers: [[25, 10, 22]]'
)
SOLVED = [Example('Q1', 'A1'), Example('Q2', 'A2')]
SHAPES = {
    'a question in one line': (
        'Go from {start} to {goal} round {horizontal_barriers} and {vertical_barriers}.',
        ('', 'Go from {start} to {goal} round {horizontal_barriers} and {vertical_barriers}.',
         ''),
    ),
    'a question of two paragraphs, with more to read after it': (
        'Plan.\n\nS {start} G {goal}\n\n{horizontal_barriers} {vertical_barriers}\nBe brief.',
        ('Plan.', 'S {start} G {goal}\n\n{horizontal_barriers} {vertical_barriers}\nBe brief.',
         ''),
    ),
    'examples with other labels': (
        'Plan.\n\nFrom: 1\nPath: 2\n\n'
        'S: {start}{goal}{horizontal_barriers}{vertical_barriers}\nP:',
        ('Plan.\n\nFrom: 1\nPath: 2',
         'S: {start}{goal}{horizontal_barriers}{vertical_barriers}', 'P:'),
    ),
    'an example': (
        'S: 1\nP: 2\n\nPlan.\n\nS: {start}{goal}{horizontal_barriers}{vertical_barriers}\nP:',
        ('Plan.', 'S: {start}{goal}{horizontal_barriers}{vertical_barriers}', 'P:'),
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', TEMPLATES)
def test_a_shipped_template_is_its_parts(name):
    template = load_template(name)
    instruction, question, cue = template.parts
    assert template.text.startswith(f'{instruction}\n\nStart Point')
    assert template.text.strip().endswith(f'\n\n{question}\n{cue}')
    shown = {'few_shot': 5, 'zero_shot': 0, 'cot': 3, 'repe': 3}[name]
    assert template.text.count('\nStart Point') == shown + 1
    assert 'Start Point' not in instruction


def test_the_zero_shot_prompt_is_the_few_shot_prompt_without_its_examples():
    zero, few = load_template('zero_shot'), load_template('few_shot')
    assert zero.parts == few.parts
    assert zero.render(DESCRIPTION) == few.render(DESCRIPTION, examples=())


@pytest.mark.parametrize('shape', SHAPES)
def test_a_users_template_is_split_at_its_question(shape):
    text, expected = SHAPES[shape]
    assert Template('mine', text).parts == expected


def test_given_examples_replace_those_of_the_template():
    template = load_template('few_shot')
    message = template.render(DESCRIPTION, SOLVED)
    instruction = message.content.partition('\n\n')[0]
    assert message.content == (f'{instruction}\n\nQ1\nA1\n\nQ2\nA2\n\n{QUESTION}\nGenerated Path:')


def test_an_example_is_written_in_the_words_of_its_template():
    solved = load_template('few_shot').example(DESCRIPTION, ((39, 22), (3, 14)))
    assert solved == Example(QUESTION, 'Generated Path: [[39, 22], [3, 14]]')
    mine = Template('mine', 'S {start}{goal}{horizontal_barriers}{vertical_barriers}\nAnswer:')
    assert mine.example(DESCRIPTION, ((1, 2),)) == Example(
        'S [39, 22][3, 14][[10, 3, 25]][[25, 10, 22]]', 'Answer: [[1, 2]]'
    )


def test_the_name_of_a_prompt_says_how_it_was_asked():
    assert Template('few_shot', '').prompt_name(0) == 'few_shot'
    assert Template('mine', '').prompt_name(3) == 'mine+retrieved_3'
