"""The forms of a prompt and retrieved examples, as a real HTTP server receives them."""

import hashlib
import re
from dataclasses import replace

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import (
    Barrier,
    BarrierMap,
    Sample,
    load_barrier_maps,
)
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.prompts.examples import ExamplesError
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery
from llm_astar_planner.waypoints.transcript import read_transcript

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25),), (Barrier(25, 10, 22),))
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
PATH = ((5.0, 5.0), (26.0, 9.0), (20.0, 20.0))


def text_reply(text, finish_reason='stop'):
    choice = {'text': text, 'index': 0, 'finish_reason': finish_reason}
    usage = {'prompt_tokens': 70, 'completion_tokens': 9}
    return 200, {}, {'object': 'text_completion', 'choices': [choice], 'usage': usage}


def source_for(server, **settings):
    return make_source(
        SourceSettings(
            source='endpoint',
            base_url=server.base_url,
            model='tiny',
            **{'timeout_s': 20.0, **settings},
        )
    )


def test_a_chat_gets_the_examples_as_turns(chat_server, tmp_path):
    record = tmp_path / 't.jsonl'
    reply = source_for(chat_server, prompt_form='turns', record=str(record)).waypoints(QUERY)
    assert (reply.status, reply.waypoints) == (SourceStatus.OK, PATH)
    assert reply.prompt == 'few_shot+turns'
    (body,) = chat_server.requests
    assert chat_server.paths == ['/v1/chat/completions']
    roles = [message['role'] for message in body['messages']]
    assert roles == ['system', *['user', 'assistant'] * 5, 'user']
    assert body['messages'][-1]['content'].startswith('Start Point: [5, 5]\nGoal Point: [20, 20]')
    (exchange,) = read_transcript(record)
    assert exchange.prompt == 'few_shot+turns'
    assert [message._asdict() for message in exchange.messages] == body['messages']


def test_a_completion_model_gets_one_text_and_no_chat(chat_server):
    chat_server.script = [text_reply(' [[5, 5], [26, 9], [20, 20]]')]
    reply = source_for(chat_server, prompt='zero_shot', prompt_form='completion').waypoints(QUERY)
    assert (reply.status, reply.waypoints) == (SourceStatus.OK, PATH)
    assert (reply.prompt, reply.prompt_tokens) == ('zero_shot+completion', 70)
    (body,) = chat_server.requests
    assert chat_server.paths == ['/v1/completions']
    assert set(body) == {'model', 'prompt', 'stop', 'stream', 'max_tokens', 'temperature'}
    assert body['prompt'] == reply.messages[0].content
    assert body['prompt'].endswith('Vertical Barriers: [[25, 10, 22]]\nGenerated Path:')
    # The special tokens of a model are its server's business.
    assert '<|' not in body['prompt']


def test_what_a_model_goes_on_with_after_its_answer_is_not_taken_for_the_answer(chat_server):
    more = 'Start Point: [1, 1]\nGoal Point: [2, 2]\nGenerated Path: [[1, 1], [2, 2]]'
    chat_server.script = [text_reply(f' [[5, 5], [26, 9], [20, 20]]\n\n{more}', 'length')]
    source = source_for(chat_server, prompt_form='completion')
    reply = source.waypoints(QUERY)
    assert chat_server.requests[0]['stop'] == ['\nStart Point:']
    assert reply.waypoints == PATH
    assert reply.text.strip() == '[[5, 5], [26, 9], [20, 20]]'
    chat_server.script = [text_reply(more)]
    reply = source.waypoints(replace(QUERY, goal=(21, 20)))
    assert (reply.status, reply.text) == (SourceStatus.MALFORMED, '')


@pytest.mark.parametrize('format_', ['json_schema', 'json_object'])
def test_a_completion_endpoint_that_knows_no_response_format_is_asked_without(
    chat_server, format_
):
    chat_server.script = [
        chat_server.error(400, 'Unrecognized request argument supplied: response_format'),
        chat_server.error(400, 'Unrecognized request argument supplied: response_format'),
        text_reply('{"path": [{"x": 5, "y": 5}, {"x": 26, "y": 9}, {"x": 20, "y": 20}]}'),
    ][0 if format_ == 'json_schema' else 1 :]
    source = source_for(chat_server, prompt_form='completion', response_format=format_)
    assert source.waypoints(QUERY).waypoints == PATH
    assert 'response_format' not in chat_server.requests[-1]


def test_the_words_of_an_endpoint_without_completions_are_kept(chat_server):
    chat_server.script = [chat_server.error(404, 'This is a chat model, use chat/completions')]
    reply = source_for(chat_server, prompt_form='completion').waypoints(QUERY)
    assert reply.status is SourceStatus.ERROR
    assert 'HTTP 404: This is a chat model' in reply.detail
    assert len(chat_server.requests) == 1


def test_a_recording_says_which_model_and_prompt_its_reply_is_of(chat_server, tmp_path):
    status, headers, body = chat_server.completion('Generated Path: [[5, 5], [20', 'length')
    chat_server.script = [(status, headers, body | {'system_fingerprint': 'fp_1\x1b' + 'x' * 500})]
    record = tmp_path / 't.jsonl'
    mine = tmp_path / 'mine.txt'
    mine.write_text('{start} {goal} {horizontal_barriers} {vertical_barriers}')
    source_for(chat_server, prompt=str(mine), record=str(record), temperature=0.5).waypoints(QUERY)
    (exchange,) = read_transcript(record)
    made = exchange.provenance
    assert (made.finish_reason, made.temperature, made.seed) == ('length', 0.5, None)
    assert made.model_digest.startswith('fp_1')
    assert len(made.model_digest) == 200
    assert made.prompt_digest == hashlib.sha256(mine.read_bytes()).hexdigest()


def starts_of(prompt):
    """The start points of a prompt's examples, its question left out."""
    return re.findall(r'Start Point: (\[\d+, \d+\])', prompt)[:-1]


def test_the_most_similar_samples_replace_the_examples(chat_server):
    maps = load_barrier_maps(find_file('samples_1000.json', 'maps'))
    query = WaypointQuery(Costmap(maps[4].to_grid()), *maps[4].samples[2][:2])
    source = source_for(chat_server, prompt='zero_shot', retrieved_examples=3)
    reply = source.waypoints(query)
    assert reply.prompt == 'zero_shot+retrieved_3'
    text = chat_server.requests[0]['messages'][0]['content']
    shown = starts_of(text)
    assert len(shown) == 3
    assert '[5, 5]' not in shown
    # None is of the query's own map, whose barriers stand in the question alone.
    question = text[text.rindex('Start Point') :]
    for barriers in re.findall(r'Barriers: \[\[.*', question):
        assert text.count(barriers) == 1
    again = source_for(chat_server, prompt='few_shot', retrieved_examples=3).waypoints(query)
    assert again.messages == reply.messages
    turns = source_for(chat_server, prompt_form='turns', retrieved_examples=3).waypoints(query)
    assert [message.role for message in turns.messages] == [
        'system', *['user', 'assistant'] * 3, 'user'
    ]  # fmt: skip
    assert [starts_of(m.content + '\nStart Point: [0, 0]') for m in turns.messages[1::2][:3]] == [
        [start] for start in shown
    ]


def test_retrieved_examples_keep_to_the_tokens_of_a_prompt(chat_server):
    source = source_for(chat_server, retrieved_examples=40, max_prompt_tokens=600)
    source.waypoints(QUERY)
    few = len(starts_of(chat_server.requests[0]['messages'][0]['content']))
    assert 2 < few < 8


def test_examples_come_from_a_file_of_the_users(chat_server, tmp_path):
    path = tmp_path / 'mine.json'
    wall = BarrierMap(0, (0, 51), (0, 31), (), (Barrier(30, 3, 20),), (Sample((7, 7), (43, 8)),))
    save_maps([wall], path)
    source_for(chat_server, retrieved_examples=1, examples_file=str(path)).waypoints(QUERY)
    text = chat_server.requests[0]['messages'][0]['content']
    assert starts_of(text) == ['[7, 7]']
    assert 'Generated Path: [[7, 7], ' in text
    with pytest.raises(ExamplesError, match=r'mine\.json: samples: 1, where 2 to 100000'):
        source_for(chat_server, retrieved_examples=2, examples_file=str(path))
