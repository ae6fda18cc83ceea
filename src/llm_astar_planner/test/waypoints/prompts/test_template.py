"""The parts of a template, and the three forms in which it is put to a model."""

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.llm.protocol import Dialect, text_to_complete
from llm_astar_planner.waypoints.prompts.map_description import describe
from llm_astar_planner.waypoints.prompts.template import (
    TEMPLATES,
    Example,
    Template,
    load_template,
)
from llm_astar_planner.waypoints.source import Message, WaypointQuery

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
        ('', 0, 'Go from {start} to {goal} round {horizontal_barriers} and {vertical_barriers}.',
         ''),
    ),
    'a question of two paragraphs, with more to read after it': (
        'Plan.\n\nS {start} G {goal}\n\n{horizontal_barriers} {vertical_barriers}\nBe brief.',
        ('Plan.', 0, 'S {start} G {goal}\n\n{horizontal_barriers} {vertical_barriers}\nBe brief.',
         ''),
    ),
    'examples with other labels': (
        'Plan.\n\nFrom: 1\nPath: 2\n\n'
        'S: {start}{goal}{horizontal_barriers}{vertical_barriers}\nP:',
        ('Plan.\n\nFrom: 1\nPath: 2', 0,
         'S: {start}{goal}{horizontal_barriers}{vertical_barriers}', 'P:'),
    ),
    'an example': (
        'S: 1\nP: 2\n\nPlan.\n\nS: {start}{goal}{horizontal_barriers}{vertical_barriers}\nP:',
        ('Plan.', 1, 'S: {start}{goal}{horizontal_barriers}{vertical_barriers}', 'P:'),
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', TEMPLATES)
def test_a_shipped_template_is_its_parts(name):
    template = load_template(name)
    instruction, examples, question, cue = template.parts
    solved = [f'{asked}\n{answer}' for asked, answer in examples]
    assert '\n\n'.join([instruction, *solved, f'{question}\n{cue}']) == template.text.strip()
    assert len(examples) == {'few_shot': 5, 'zero_shot': 0, 'cot': 3, 'repe': 3}[name]
    assert all(answer.splitlines()[-1].startswith('Generated Path: ') for _, answer in examples)
    assert 'Start Point' not in instruction
    assert template.stop == '\nStart Point:'


def test_the_zero_shot_prompt_is_the_few_shot_prompt_without_its_examples():
    zero, few = load_template('zero_shot'), load_template('few_shot')
    assert zero.parts == few.parts._replace(examples=())
    assert zero.render(DESCRIPTION) == few.render(DESCRIPTION, examples=())


@pytest.mark.parametrize('shape', SHAPES)
def test_a_users_template_is_split_at_its_question(shape):
    text, expected = SHAPES[shape]
    parts = Template('mine', text).parts
    assert (parts.instruction, len(parts.examples), parts.question, parts.cue) == expected


def test_turns_are_the_instruction_the_examples_and_the_question():
    messages = load_template('few_shot').render(DESCRIPTION, 'turns')
    assert [message.role for message in messages] == [
        'system', *['user', 'assistant'] * 5, 'user'
    ]  # fmt: skip
    assert 'x from 2 to 48' in messages[0].content
    assert messages[1].content.startswith('Start Point: [5, 5]\nGoal Point: [20, 20]\n')
    assert messages[1].content.endswith('Vertical Barriers: [[25, 10, 22]]')
    path = 'Generated Path: [[5, 5], [26, 9], [25, 23], [20, 20]]'
    assert messages[2] == Message('assistant', path)
    assert messages[-1] == Message('user', QUESTION)
    (system, question) = load_template('zero_shot').render(DESCRIPTION, 'turns')
    assert (system.content, question) == (messages[0].content, messages[-1])


def test_placeholders_of_a_users_example_are_filled_in_in_turns_too():
    mine = Template(
        'mine',
        'S: 1 of {x_max}\nP: 2\n\nS: {start}{goal}{horizontal_barriers}{vertical_barriers}\nP:',
    )
    assert mine.render(DESCRIPTION, 'turns')[:2] == (
        Message('user', 'S: 1 of 48'), Message('assistant', 'P: 2')
    )  # fmt: skip


def test_thoughts_are_part_of_an_answer():
    messages = load_template('repe').render(DESCRIPTION, 'turns')
    assert messages[2].content.startswith('- First Iteration on [5, 5]\nThought: ')
    assert messages[2].content.endswith('Generated Path: [[5, 5], [26, 9], [25, 23], [20, 20]]')


def test_a_text_to_complete_ends_where_the_answer_begins():
    (message,) = load_template('few_shot').render(DESCRIPTION, 'completion')
    assert message == load_template('few_shot').render(DESCRIPTION)[0]
    text = text_to_complete((message,))
    assert text.endswith(f'\n\n{QUESTION}\nGenerated Path:')
    asked_again = (message, Message('assistant', ' [[1, 2]]'), Message('user', 'That collides.'))
    assert text_to_complete(asked_again) == (f'{text} [[1, 2]]\n\nThat collides.\nGenerated Path:')


def test_given_examples_replace_those_of_the_template():
    template = load_template('few_shot')
    (message,) = template.render(DESCRIPTION, examples=SOLVED)
    instruction = message.content.partition('\n\n')[0]
    assert message.content == (f'{instruction}\n\nQ1\nA1\n\nQ2\nA2\n\n{QUESTION}\nGenerated Path:')
    assert template.render(DESCRIPTION, 'turns', SOLVED)[1:] == (
        Message('user', 'Q1'), Message('assistant', 'A1'),
        Message('user', 'Q2'), Message('assistant', 'A2'), Message('user', QUESTION),
    )  # fmt: skip


def test_an_example_is_written_in_the_words_of_its_template():
    solved = load_template('few_shot').example(DESCRIPTION, ((39, 22), (3, 14)))
    assert solved == Example(QUESTION, 'Generated Path: [[39, 22], [3, 14]]')
    mine = Template('mine', 'S {start}{goal}{horizontal_barriers}{vertical_barriers}\nAnswer:')
    assert mine.example(DESCRIPTION, ((1, 2),)) == Example(
        'S [39, 22][3, 14][[10, 3, 25]][[25, 10, 22]]', 'Answer: [[1, 2]]'
    )


def test_the_name_of_a_prompt_says_how_it_was_asked():
    assert Template('few_shot', '').prompt_name('message', 0) == 'few_shot'
    assert Template('zero_shot', '').prompt_name('turns', 0) == 'zero_shot+turns'
    assert Template('mine', '').prompt_name('completion', 3) == 'mine+completion+retrieved_3'


def test_only_a_completion_has_a_text_and_a_stop():
    messages = (Message('user', 'Plan.'),)
    chat = Dialect(stop='\nStart Point:')
    assert chat.path == 'chat/completions'
    assert set(chat.body('m', messages, {})) == {
        'model', 'messages', 'stream', 'max_tokens', 'temperature'
    }  # fmt: skip
    text = Dialect(is_completion=True, stop='\nStart Point:')
    assert text.path == 'completions'
    assert text.body('m', messages, {}) == {
        'model': 'm', 'prompt': 'Plan.', 'stop': ['\nStart Point:'], 'stream': False,
        'max_tokens': 1000, 'temperature': 0.0,
    }  # fmt: skip
