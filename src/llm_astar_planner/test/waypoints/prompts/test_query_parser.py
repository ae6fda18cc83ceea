"""Natural-language queries: the dataset's sentences by themselves, free wording by a model."""

import json
import os
from pathlib import Path

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, load_barrier_maps
from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.factory import make_model_call
from llm_astar_planner.waypoints.prompts.query_parser import QueryError, parse_query, query_schema

SENTENCE = (
    'design a path from [5, 5] to [20, 20] on a 51 by 31 grid that avoids horizontal barriers '
    'centered at [[10, 0, 25], [15, 30, 50]] and vertical barriers at [[25, 10, 22]].'
)
ANSWER = {
    'width': 51,
    'height': 31,
    'start': {'x': 5, 'y': 5},
    'goal': {'x': 20, 'y': 20},
    'horizontal_barriers': [{'y': 10, 'x_start': 25, 'x_end': 0}, [15, 30, 50]],
    'vertical_barriers': [{'x': 25, 'y_start': 10, 'y_end': 22}],
}


def check(query):
    assert (query.start, query.goal) == ((5, 5), (20, 20))
    assert (query.barrier_map.range_x, query.barrier_map.range_y) == ((0, 51), (0, 31))
    assert query.barrier_map.horizontal_barriers == (Barrier(10, 0, 25), Barrier(15, 30, 50))
    assert query.barrier_map.vertical_barriers == (Barrier(25, 10, 22),)


def test_a_sentence_in_the_form_of_the_dataset_needs_no_model():
    check(parse_query(SENTENCE))
    check(parse_query('  ' + SENTENCE.upper().replace(', ', ',').replace(' ', '\n ')))
    bare = parse_query(
        'Plan a path from [1,1] to [8, 8] on a 10 by 12 grid that avoids horizontal barriers '
        'at [] and vertical barriers at []'
    )
    assert bare.barrier_map.range_y == (0, 12)
    assert bare.barrier_map.horizontal_barriers == ()


@pytest.mark.skipif('LLM_ASTAR_REFERENCE' not in os.environ, reason='no reference data')
def test_every_sentence_of_the_dataset():
    folder = Path(os.environ['LLM_ASTAR_REFERENCE'])
    for barrier_map in load_barrier_maps(folder / 'barrier_maps_00_49.json'):
        for sample in barrier_map.samples:
            query = parse_query(sample.query)
            assert (query.start, query.goal) == (sample.start, sample.goal)
            assert query.barrier_map.horizontal_barriers == barrier_map.horizontal_barriers
            assert query.barrier_map.vertical_barriers == barrier_map.vertical_barriers
            assert query.barrier_map.range_x == barrier_map.range_x


def test_free_wording_needs_an_endpoint():
    with pytest.raises(QueryError, match='free wording needs an endpoint'):
        parse_query('get me from the door to the window')
    with pytest.raises(QueryError, match='longer than'):
        parse_query('x' * 30000, lambda *_: '{}')


@pytest.mark.parametrize('wrap', ['{}', '```json\n{}\n```', 'Here: {{"a": 1}} {} done'])
def test_free_wording_by_a_model(wrap):
    asked = []

    def ask(messages, schema):
        asked.append(messages[0].content)
        assert schema == query_schema()
        return wrap.format(json.dumps(ANSWER))

    check(parse_query('from five-five to twenty-twenty, please', ask))
    assert asked[0].endswith('Question: from five-five to twenty-twenty, please')


@pytest.mark.parametrize(
    ('answer', 'words'),
    [
        ('I cannot', 'no JSON object'),
        ('{' * 1000, 'no JSON object'),
        ('[' * 100000 + '{"start": 1}', 'not found in it'),
        ({'start': 1}, 'width, height, goal'),
        ({**ANSWER, 'start': {'x': 99, 'y': 5}}, 'start x: 99 is outside'),
        ({**ANSWER, 'start': 'here'}, r'start_goal\[0\]: start'),
        ({**ANSWER, 'width': '51'}, 'range_x'),
        ({**ANSWER, 'width': 10**9, 'height': 10**9}, 'range_x, range_y: over'),
        ({**ANSWER, 'horizontal_barriers': 3}, 'horizontal_barriers: a list'),
        ({**ANSWER, 'horizontal_barriers': [[1, None, 2]]}, r'horizontal_barriers\[0\]'),
        ({**ANSWER, 'vertical_barriers': [{'y': 1}]}, r'vertical_barriers\[0\]'),
    ],
)
def test_wrong_answers_of_a_model_are_named(answer, words):
    text = answer if isinstance(answer, str) else json.dumps(answer)
    with pytest.raises(QueryError, match=words):
        parse_query('free', lambda *_: text)


def test_free_wording_through_an_endpoint(chat_server):
    chat_server.script = [
        chat_server.error(400, 'json_schema is not supported'),
        chat_server.completion(json.dumps(ANSWER)),
    ]
    settings = SourceSettings(source='endpoint', base_url=chat_server.base_url, max_retries=0)
    ask = make_model_call(settings)
    check(parse_query('free', ask))
    formats = [body['response_format']['type'] for body in chat_server.requests]
    assert formats == ['json_schema', 'json_object']
    chat_server.script = [chat_server.error(401)]
    with pytest.raises(QueryError, match='AUTH: HTTP 401'):
        parse_query('free', ask)
