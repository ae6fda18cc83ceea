"""The endpoint source without failures: requests, answers, recordings and questions."""

import json
from dataclasses import replace
from datetime import datetime, timezone

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Sample
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.llm.source import client_of
from llm_astar_planner.waypoints.replay import dataset_digest
from llm_astar_planner.waypoints.source import SampleKey, SourceStatus, WaypointQuery
from llm_astar_planner.waypoints.transcript import read_transcript

MAP = BarrierMap(
    id=0,
    range_x=(0, 51),
    range_y=(0, 31),
    horizontal_barriers=(Barrier(10, 0, 25), Barrier(15, 30, 50)),
    vertical_barriers=(Barrier(25, 10, 22),),
    samples=(Sample((5, 5), (20, 20)),),
)
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
PATH = ((5.0, 5.0), (26.0, 9.0), (20.0, 20.0))


def source_for(server, dataset=None, **settings):
    return make_source(
        SourceSettings(
            source='endpoint',
            base_url=server.base_url,
            model='tiny',
            **{'timeout_s': 20.0, **settings},
        ),
        dataset,
    )


def test_one_query(chat_server):
    source = source_for(chat_server)
    reply = source.waypoints(QUERY)
    assert reply.waypoints == PATH
    assert reply.status is SourceStatus.OK
    assert (reply.label, reply.model, reply.prompt) == ('endpoint:tiny', 'tiny', 'few_shot')
    assert (reply.prompt_tokens, reply.completion_tokens) == (100, 20)
    assert 0 < reply.seconds < 10
    assert reply.text == 'Generated Path: [[5, 5], [26, 9], [20, 20]]'
    (body,) = chat_server.requests
    assert chat_server.paths == ['/v1/chat/completions']
    assert set(body) == {'model', 'messages', 'stream', 'max_tokens', 'temperature'}
    assert body['stream'] is False
    assert body['messages'][0]['content'] == reply.messages[0].content
    assert 'Start Point: [5, 5]\nGoal Point: [20, 20]' in reply.messages[0].content
    assert 'Authorization' not in chat_server.headers[0]
    assert source.name == 'endpoint'


@pytest.mark.parametrize('prompt', ['few_shot', 'cot', 'repe'])
@pytest.mark.parametrize('response_format', ['json_schema', 'json_object'])
def test_structured_output(chat_server, prompt, response_format):
    path = [{'x': x, 'y': y} for x, y in PATH]
    chat_server.script = [chat_server.completion(json.dumps({'thought': 'up', 'path': path}))]
    source = source_for(chat_server, prompt=prompt, response_format=response_format)
    assert source.waypoints(QUERY).waypoints == PATH
    (body,) = chat_server.requests
    assert body['response_format']['type'] == response_format
    assert 'JSON' in body['messages'][0]['content']
    if response_format == 'json_schema':
        schema = body['response_format']['json_schema']['schema']
        thoughts = [] if prompt == 'few_shot' else ['thought']
        assert schema['required'] == [*thoughts, 'path']


def test_the_second_query_is_answered_from_the_cache(chat_server):
    source = source_for(chat_server)
    first = source.waypoints(QUERY)
    second = source.waypoints(QUERY)
    assert second.waypoints == first.waypoints
    assert second.detail == 'from the cache'
    assert (second.prompt_tokens, second.completion_tokens, second.seconds) == (0, 0, 0.0)
    source.waypoints(replace(QUERY, goal=(21, 20)))
    source.waypoints(replace(QUERY, costmap=Costmap(MAP.to_grid(resolution=0.5))))
    assert len(chat_server.requests) == 3


def test_a_key_is_sent_to_the_endpoint_it_is_named_for(chat_server, monkeypatch):
    monkeypatch.setenv('ROBOT_API_KEY', 'one-two-three')
    source = source_for(chat_server, api_key_env='ROBOT_API_KEY')
    source.waypoints(QUERY)
    monkeypatch.setenv('ROBOT_API_KEY', 'four-five-six')
    source.waypoints(replace(QUERY, goal=(21, 20)))
    sent = [headers['Authorization'] for headers in chat_server.headers]
    assert sent == ['Bearer one-two-three', 'Bearer four-five-six']


def test_a_loopback_endpoint_bypasses_proxies(chat_server, monkeypatch):
    monkeypatch.setenv('HTTP_PROXY', 'http://127.0.0.1:1')
    monkeypatch.setenv('ALL_PROXY', 'http://127.0.0.1:1')
    assert source_for(chat_server).waypoints(QUERY).status is SourceStatus.OK


def test_exchanges_are_recorded_and_replayed(chat_server, tmp_path):
    chat_server.script = [
        chat_server.completion('Generated Path: [[5, 5], [26, 9], [20, 20]]'),
        chat_server.completion('no idea'),
        chat_server.completion('none at all'),
    ]
    record = tmp_path / 't.jsonl'
    source = source_for(chat_server, record=str(record))
    other = replace(QUERY, goal=(40, 20), sample=SampleKey(0, 9, 2))
    live = [source.waypoints(QUERY), source.waypoints(QUERY), source.waypoints(other)]
    first, second = read_transcript(record)
    assert (first.map, first.pair) == (QUERY.grid_map.digest, '5,5->20,20')
    assert (first.messages, first.status) == (live[0].messages, SourceStatus.OK)
    assert (second.map, second.pair, second.scale) == (0, 9, 2)
    assert [message.role for message in second.messages] == ['user', 'assistant', 'user']
    replay = make_source(SourceSettings(source='replay', transcript=str(record)))
    replayed = replay.waypoints(QUERY)
    assert (replayed.waypoints, replayed.label) == (live[0].waypoints, 'replay:tiny')
    assert replay.waypoints(other).status is SourceStatus.MALFORMED


def test_a_recording_is_keyed_by_the_dataset(chat_server, tmp_path):
    record = tmp_path / 't.jsonl'
    source = source_for(chat_server, [MAP], record=str(record))
    source.waypoints(replace(QUERY, costmap=Costmap(MAP.to_grid(0.05))))
    assert read_transcript(record)[0].sample == SampleKey(0, 0, 1)


def test_a_recording_says_of_which_dataset_it_is_and_when_it_was_made(chat_server, tmp_path):
    record = tmp_path / 't.jsonl'
    before = datetime.now(timezone.utc).replace(microsecond=0)
    source = source_for(chat_server, [MAP], record=str(record))
    source.waypoints(QUERY)
    known = read_transcript(record)[0].provenance
    assert known.dataset_digest == dataset_digest([MAP])
    assert before <= datetime.fromisoformat(known.time) <= datetime.now(timezone.utc)
    replay = make_source(SourceSettings(source='replay', transcript=str(record)))
    assert replay.waypoints(replace(QUERY, sample=SampleKey(0, 0))).provenance == known
    # Of no sample of the dataset.
    source.waypoints(replace(QUERY, goal=(40, 20)))
    assert read_transcript(record)[1].provenance.dataset_digest == ''


def test_a_coarse_map_is_replayed_as_it_was_answered(chat_server, tmp_path):
    blobs = tuple(Barrier(50 * i, 3 + i, 5 + i * 9) for i in range(1, 10))
    grid_map = BarrierMap(0, (0, 600), (0, 600), blobs, blobs).to_grid()
    cells = grid_map.cells.copy()
    cells[100:200, 300:500] = 100
    query = WaypointQuery(Costmap(replace(grid_map, cells=cells)), (10, 10), (590, 590))
    chat_server.script = [chat_server.completion('Generated Path: [[1, 1], [60, 20], [98, 98]]')]
    record = tmp_path / 't.jsonl'
    source = source_for(chat_server, record=str(record))
    reply = source.waypoints(query)
    assert reply.unit == read_transcript(record)[0].unit == 6
    assert reply.waypoints == ((10.0, 10.0), (362.0, 122.0), (590.0, 590.0)) or (
        reply.waypoints[0] == (10.0, 10.0) and reply.waypoints[2] == (590.0, 590.0)
    )
    replay = make_source(SourceSettings(source='replay', transcript=str(record)))
    assert replay.waypoints(query).waypoints == reply.waypoints


def test_a_follow_up_that_fails_leaves_the_first_exchange(chat_server):
    chat_server.script = [
        chat_server.completion('Go east.'),
        chat_server.error(401),
    ]
    reply = source_for(chat_server).waypoints(QUERY)
    assert (reply.status, reply.text) == (SourceStatus.MALFORMED, 'Go east.')
    assert len(reply.messages) == 1
    assert len(chat_server.requests) == 2


def test_without_time_no_request_is_made(chat_server):
    reply = source_for(chat_server).waypoints(replace(QUERY, time_limit=0.0))
    assert reply.status is SourceStatus.TIMEOUT
    assert chat_server.requests == []


def test_an_answer_stands_even_if_its_route_collides(chat_server):
    chat_server.script = [chat_server.completion('Generated Path: [[25, 15]]')]
    assert source_for(chat_server).waypoints(QUERY).waypoints == ((25.0, 15.0),)
    assert len(chat_server.requests) == 1


def test_the_client_reports_its_problem_and_counts(chat_server):
    source = source_for(chat_server)
    source.waypoints(QUERY)
    client = client_of(source)
    assert client.problem() is None
    assert (client.budget.calls.total, client.budget.tokens.total) == (1, 120)
    assert client_of(make_source(SourceSettings(source='none'))) is None
