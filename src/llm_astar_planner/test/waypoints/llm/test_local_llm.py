"""A real language model over real HTTP: protocol and robustness, not quality."""

import time
from dataclasses import replace

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.llm.source import client_of
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery
from local_llm import LocalLlm, needs_llm

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25),), (Barrier(25, 10, 22),))
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
KEY = 'local-secret-key'
ANSWERED = (SourceStatus.OK, SourceStatus.NO_WAYPOINTS, SourceStatus.MALFORMED)


@pytest.fixture(scope='module')
def server():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('LOCAL_API_KEY', KEY)
        with LocalLlm(api_key_env='LOCAL_API_KEY') as running:
            yield running


def ask(server, query=QUERY, prompt='zero_shot', **settings):
    source = make_source(
        SourceSettings(
            source='endpoint',
            base_url=server.base_url,
            prompt=prompt,
            max_output_tokens=32,
            **{
                'timeout_s': 60.0,
                'max_retries': 0,
                'api_key_env': 'LOCAL_API_KEY',
                **settings,
            },
        )
    )
    return source, source.waypoints(query)


@needs_llm
def test_a_real_model_answers(server, monkeypatch):
    monkeypatch.setenv('LOCAL_API_KEY', KEY)
    _, reply = ask(server)
    assert reply.status in ANSWERED, reply
    assert reply.text
    assert reply.prompt_tokens > 200
    assert 0 < reply.completion_tokens <= 64
    assert (reply.status is SourceStatus.OK) == bool(reply.waypoints)


@needs_llm
def test_a_real_model_keeps_to_the_schema(server, monkeypatch):
    monkeypatch.setenv('LOCAL_API_KEY', KEY)
    _, reply = ask(server, response_format='json_schema')
    assert reply.text.lstrip().startswith('{')
    assert '"path"' in reply.text


@needs_llm
def test_a_real_server_completes_a_text(server, monkeypatch, tmp_path):
    monkeypatch.setenv('LOCAL_API_KEY', KEY)
    path = tmp_path / 'short.txt'
    path.write_text(
        'From: [1, 1]\nTo: [4, 4]\nWalls: [] []\nPath: [[1, 1], [4, 4]]\n\n'
        'From: {start}\nTo: {goal}\nWalls: {horizontal_barriers} {vertical_barriers}\nPath:'
    )
    _, reply = ask(server, prompt=str(path), prompt_form='completion')
    assert reply.prompt == 'short+completion'
    assert reply.status in ANSWERED, reply
    assert reply.text
    assert '\nFrom:' not in reply.text
    assert reply.prompt_tokens > 60


@needs_llm
def test_a_real_server_rejects_a_wrong_key(server, monkeypatch):
    _, reply = ask(server, api_key_env='')
    assert reply.status is SourceStatus.AUTH
    monkeypatch.setenv('LOCAL_API_KEY', 'another-key')
    assert ask(server)[1].status is SourceStatus.AUTH


@needs_llm
def test_the_client_returns_at_the_deadline_of_a_slow_real_server(server, monkeypatch):
    monkeypatch.setenv('LOCAL_API_KEY', KEY)
    started = time.monotonic()
    source, reply = ask(server, replace(QUERY, time_limit=0.05), timeout_s=0.3)
    assert time.monotonic() - started < 5.0
    assert reply.status is SourceStatus.TIMEOUT
    assert client_of(source).budget.calls.total == 1


@needs_llm
def test_the_error_of_a_real_context_that_is_too_short_is_recognised():
    with LocalLlm(context=256) as small:
        source, reply = ask(small, prompt='few_shot', api_key_env='')
    assert reply.status is SourceStatus.ERROR
    assert 'context' in reply.detail
    assert client_of(source).budget.calls.total == 1
