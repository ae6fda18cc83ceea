"""The small parts of the endpoint source, each by itself."""

import math
import time
from dataclasses import fields, replace
from email.utils import formatdate

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SettingsError, SourceSettings
from llm_astar_planner.waypoints.factory import make_source
from llm_astar_planner.waypoints.llm.credentials import Endpoint
from llm_astar_planner.waypoints.llm.protocol import Dialect, is_context_too_long
from llm_astar_planner.waypoints.llm.resilience import (
    COOLDOWN_S,
    MAX_DETAIL,
    THRESHOLD,
    CallBudget,
    CircuitBreaker,
    EndpointFailure,
    RetryPolicy,
    is_retryable,
    retry_after,
)
from llm_astar_planner.waypoints.llm.route_feedback import MAX_FAULTS_NAMED, find_faults, follow_up
from llm_astar_planner.waypoints.prompts.map_description import Lattice
from llm_astar_planner.waypoints.replay import ReplayError
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply
from llm_astar_planner.waypoints.transcript import TranscriptError


class Clock:
    now = 1000.0

    def __call__(self):
        return self.now


def failure(status=SourceStatus.UNREACHABLE, **facts):
    return EndpointFailure(status, 'gone', retryable=True, **facts)


def is_open(breaker):
    try:
        breaker.check()
    except EndpointFailure:
        return True
    return False


def test_backoff_doubles_with_jitter_under_a_cap():
    policy = RetryPolicy(max_retries=8)
    for attempt in range(1, 9):
        expected = min(8.0, 0.5 * 2 ** (attempt - 1))
        delays = [policy.delay(failure(), attempt) for _ in range(50)]
        assert all(0.75 * expected <= delay <= 1.25 * expected for delay in delays)
        assert len(set(delays)) > 1
    assert policy.delay(failure(), 9) is None
    assert policy.delay(EndpointFailure(SourceStatus.AUTH, ''), 1) is None
    assert policy.delay(failure(retry_after=42.0), 1) == 42.0


def test_what_may_pass():
    assert all(is_retryable(http, '') for http in (408, 409, 429, 500, 502, 503, 504, 529))
    assert not any(is_retryable(http, '') for http in (301, 400, 401, 403, 404, 422))
    assert not is_retryable(429, '{"code": "insufficient_quota"}')


def test_retry_after_in_seconds_or_as_a_date():
    assert retry_after({'Retry-After': '3'}) == 3.0
    assert retry_after({'retry-after': '0.5'}) == 0.5
    assert retry_after({'retry-after': '-5'}) == 0.0
    date = formatdate(time.time() + 100, usegmt=True)
    assert 90 < retry_after({'retry-after': date}) <= 100
    for odd in ('', 'soon', 'nan', 'inf', '1e999'):
        assert retry_after({'retry-after': odd}) is None
    assert retry_after({}) is None


def test_the_breaker_opens_after_failures_in_a_row_and_closes_again():
    clock = Clock()
    breaker = CircuitBreaker(clock)
    for _ in range(THRESHOLD - 1):
        breaker.record_failure(failure())
    breaker.record_success()
    for _ in range(THRESHOLD - 1):
        breaker.record_failure(failure())
    assert not is_open(breaker)
    breaker.record_failure(failure(SourceStatus.TIMEOUT))
    assert is_open(breaker)
    clock.now += COOLDOWN_S + 1
    assert not is_open(breaker)
    breaker.record_failure(failure())
    assert is_open(breaker)


def test_the_breaker_heeds_what_the_failure_means():
    for status, facts, seconds in (
        (SourceStatus.AUTH, {}, math.inf),
        (SourceStatus.REFUSED, {}, COOLDOWN_S),
        (SourceStatus.REFUSED, {'retry_after': 100.0}, 100.0),
        (SourceStatus.REFUSED, {'retry_after': 1e9}, 3600.0),
        (SourceStatus.REFUSED, {'is_ours': True}, 0.0),
        (SourceStatus.NOT_CONFIGURED, {}, 0.0),
        (SourceStatus.MALFORMED, {}, 0.0),
    ):
        clock = Clock()
        breaker = CircuitBreaker(clock)
        for _ in range(5):
            breaker.record_failure(failure(status, **facts))
        clock.now += min(seconds, 1e6) - 1
        assert is_open(breaker) == (seconds > 0)
        clock.now += 2
        assert is_open(breaker) == math.isinf(seconds)


def test_a_long_detail_is_cut():
    assert len(str(EndpointFailure(SourceStatus.ERROR, 'x\n' * 1000))) == MAX_DETAIL


def test_budget_windows_slide():
    clock = Clock()
    budget = CallBudget(2, 100, clock)
    budget.admit()
    budget.admit()
    with pytest.raises(EndpointFailure, match='max_calls_per_hour: 2 are made; next in 3600 s'):
        budget.admit()
    clock.now += 3600
    budget.admit()
    budget.spend(100)
    clock.now += 3600
    with pytest.raises(EndpointFailure) as refused:
        budget.admit()
    assert str(refused.value) == 'max_tokens_per_day: 100 are used; next in 82800 s'
    assert refused.value.status is SourceStatus.REFUSED
    clock.now += 82800
    budget.admit()
    assert budget.values() == {
        'calls_made': 4,
        'calls_left': 1,
        'tokens_used': 100,
        'tokens_left': 100,
    }
    unlimited = CallBudget()
    unlimited.spend(10**9)
    for _ in range(1000):
        unlimited.admit()
    assert unlimited.total_calls == 1000
    assert (unlimited.values()['calls_left'], unlimited.values()['tokens_left']) == (None, None)


def test_a_dialect_gives_way_until_nothing_is_left():
    dialect = Dialect(response_format='json_schema')
    everything = 'response_format, max_tokens and temperature are unknown'
    steps = []
    while dialect is not None:
        steps.append((dialect.response_format, dialect.tokens_field, dialect.temperature))
        dialect = dialect.adapted(everything)
    assert steps == [
        ('json_schema', 'max_tokens', 0.0),
        ('json_object', 'max_tokens', 0.0),
        ('text', 'max_tokens', 0.0),
        ('text', 'max_completion_tokens', 0.0),
        ('text', '', 0.0),
        ('text', '', None),
    ]
    assert Dialect().adapted('something else') is None


@pytest.mark.parametrize(
    'words',
    [
        "This model's maximum context length is 4097 tokens",
        '{"code": "context_length_exceeded"}',
        'the request exceeds the available context size, try increasing it',
        'prompt is too long: 210000 tokens > 200000 maximum',
    ],
)
def test_words_for_a_prompt_too_long(words):
    assert is_context_too_long(words)
    assert not is_context_too_long('max_tokens is unknown')


@pytest.mark.parametrize(
    'url',
    [
        'ftp://host/v1', 'host/v1', '', 'http://', 'http://user:secret@host/v1',
        'https://host/v1?api-key=secret', 'https://host/v1#secret', 'http://host:port/v1',
    ],
)  # fmt: skip
def test_a_url_that_is_none_or_holds_a_secret(url):
    with pytest.raises(ValueError, match='base_url: ') as error:
        Endpoint(url)
    assert 'secret' not in str(error.value)


@pytest.mark.parametrize('name', ['sk-pasted-secret', 'gsk_PastedSecret', 'with space', 'A' * 65])
def test_a_key_pasted_for_its_name_is_not_repeated(name):
    with pytest.raises(ValueError, match='api_key_env: the NAME') as error:
        Endpoint('http://localhost:1/v1', name)
    assert name not in str(error.value)


def test_what_is_loopback():
    hosts = ('localhost', '127.0.0.1', '127.9.9.9', '[::1]', 'LOCALHOST', 'robot.localhost')
    assert all(Endpoint(f'http://{host}:8080/v1').is_loopback for host in hosts)
    others = ('10.0.0.1', 'robot', 'localhost.example.com', '0.0.0.0', '[::2]')  # noqa: S104
    assert not any(Endpoint(f'http://{host}/v1').is_loopback for host in others)
    assert Endpoint('http://localhost:8080/v1/').url == 'http://localhost:8080/v1/chat/completions'


def test_openai_gets_its_own_key_by_default(monkeypatch):
    monkeypatch.setenv('OPENAI_API_KEY', ' secret-of-openai\n')
    assert Endpoint('https://api.openai.com/v1').key() == 'secret-of-openai'
    assert Endpoint('http://localhost:8080/v1').key() == ''


def test_faults_of_a_route():
    cells = np.zeros((30, 50), dtype=np.int8)
    cells[10, 0:26] = 100
    costmap = Costmap(GridMap(cells))
    assert find_faults(costmap, (5, 5), (30, 20), [(28.0, 9.0)]) == []
    assert find_faults(costmap, (5, 5), (5, 5), []) == []
    faults = find_faults(costmap, (5, 5), (5, 20), [(5.0, 10.0), (-1.0, 3.0), (1e9, 0.0)])
    assert [fault.kind for fault in faults] == [
        'occupied', 'off the map', 'off the map', 'collides',
    ]  # fmt: skip
    told = follow_up(faults, Lattice(unit=5))
    assert 'The straight way from [1, 1] to [1, 4] meets a barrier at [1, 2].' in told
    many = follow_up(faults * 5, Lattice())
    assert many.count('\n- ') == MAX_FAULTS_NAMED + 1
    assert 'and 12 more like these' in many


def test_settings_are_checked_by_name():
    good = SourceSettings(source='endpoint', base_url='http://localhost:1/v1')
    assert make_source(good).name == 'endpoint'
    assert make_source(SourceSettings(source='none')).name == 'none'
    for change, words in (
        (
            {'source': 'magic'},
            "source: 'magic' is not one of none, embedded, replay",
        ),
        ({'temperature': 3.0}, 'temperature: 3.0 is not in 0 to 2'),
        ({'timeout_s': math.nan}, 'timeout_s: nan is not'),
        ({'timeout_s': 0.0}, 'timeout_s: 0.0 is not'),
        ({'max_retries': 99}, 'max_retries: 99 is not in 0 to 10'),
        ({'max_concurrent': 0}, 'max_concurrent: 0'),
        ({'max_output_tokens': 0}, 'max_output_tokens: 0'),
        ({'max_prompt_tokens': 1}, 'max_prompt_tokens: 1'),
        ({'repair_rounds': -1}, 'repair_rounds: -1'),
        ({'candidates': 0}, 'candidates: 0 is not in 1 to 64'),
        ({'max_calls_per_hour': -1}, 'max_calls_per_hour: -1'),
        ({'max_tokens_per_day': -1}, 'max_tokens_per_day: -1'),
        ({'cache_size': 0}, 'cache_size: 0'),
        ({'response_format': 'xml'}, "'xml' is not one of text, json_object, json_schema"),
        ({'prompt': 'mine'}, "prompt: 'mine' is none of few_shot, cot, repe"),
        ({'base_url': 'nowhere'}, 'base_url: '),
        ({'source': 'replay'}, 'transcript: '),
    ):
        with pytest.raises(SettingsError, match=words):
            make_source(replace(good, **change))


def test_files_that_are_wrong_are_named(tmp_path):
    replay = SourceSettings(source='replay', transcript=str(tmp_path / 'none.jsonl'))
    with pytest.raises(TranscriptError, match=r'none\.jsonl'):
        make_source(replay)
    (tmp_path / 'none.jsonl').touch()
    with pytest.raises(ReplayError, match='it holds: nothing'):
        make_source(replay)


def test_settings_hold_the_parameters_of_the_design():
    names = {field.name for field in fields(SourceSettings)}
    assert names >= {'source', 'base_url', 'model', 'prompt', 'timeout_s', 'max_retries'}
    assert names >= {'max_output_tokens', 'temperature', 'response_format', 'api_key_env'}
    assert names >= {'repair_rounds', 'max_calls_per_hour', 'max_tokens_per_day'}
    assert WaypointReply().messages == ()
