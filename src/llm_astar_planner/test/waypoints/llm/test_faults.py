"""Every row of the failure table, with the fault injected over real HTTP."""

import gzip
import json
import logging
import socket
import threading
import time
from dataclasses import replace

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.llm.source import MAX_QUOTED_CHARS, EndpointSource, client_of
from llm_astar_planner.waypoints.prompts.examples import Prompt
from llm_astar_planner.waypoints.prompts.reply_parser import MAX_REPLY_CHARS
from llm_astar_planner.waypoints.prompts.template import load_template
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25), Barrier(15, 30, 50)))
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
GOOD = 'Generated Path: [[5, 5], [26, 9], [20, 20]]'
PATH = ((5.0, 5.0), (26.0, 9.0), (20.0, 20.0))
# A deadline of half a second may take this long on a busy machine; a hang never ends.
GENEROUS = 20.0


@pytest.fixture(autouse=True)
def brief_pauses(monkeypatch):
    monkeypatch.setattr('llm_astar_planner.waypoints.llm.resilience.FIRST_DELAY_S', 0.01)


def source_for(server, **settings):
    defaults = {'base_url': server.base_url, 'model': 'tiny', 'timeout_s': 10.0}
    return make_source(SourceSettings(source='endpoint', **{**defaults, **settings}))


def closed_port():
    with socket.socket() as listener:
        listener.bind(('127.0.0.1', 0))
        return listener.getsockname()[1]


def closes_at_once(handler):
    handler.connection.shutdown(socket.SHUT_RDWR)


def ends_early(handler):
    handler.wfile.write(b'HTTP/1.1 200 OK\r\nContent-Length: 5000\r\n\r\n{"choices"')
    handler.connection.shutdown(socket.SHUT_RDWR)


OK = (SourceStatus.OK, '')
# name: (the script, given the server; status, a word of the detail; requests made)
ROWS = {
    'plain': (lambda s: [s.completion(GOOD)], *OK, 1),
    '500 once': (lambda s: [s.error(500, 'oops'), s.completion(GOOD)], *OK, 2),
    '503 always': (lambda s: [s.error(503, 'loading')], SourceStatus.ERROR, 'HTTP 503', 3),
    '408 once': (lambda s: [s.error(408), s.completion(GOOD)], *OK, 2),
    '409 once': (lambda s: [s.error(409), s.completion(GOOD)], *OK, 2),
    '429 once': (lambda s: [s.error(429), s.completion(GOOD)], *OK, 2),
    '429 always': (lambda s: [s.error(429, 'slow down')], SourceStatus.REFUSED, 'slow down', 3),
    'Retry-After within the deadline': (
        lambda s: [s.error(429, headers={'Retry-After': '0.05'}), s.completion(GOOD)], *OK, 2,
    ),
    'Retry-After beyond the deadline': (
        lambda s: [s.error(429, 'later', headers={'Retry-After': '900'})],
        SourceStatus.REFUSED, 'later', 1,
    ),
    'Retry-After as a date': (
        lambda s: [
            s.error(503, headers={'Retry-After': 'Wed, 21 Oct 2015 07:28:00 GMT'}),
            s.completion(GOOD),
        ], *OK, 2,
    ),
    'no quota': (
        lambda s: [s.error(429, 'You exceeded your quota', 'insufficient_quota')],
        SourceStatus.REFUSED, 'quota', 1,
    ),
    'no quota, said otherwise': (
        lambda s: [s.error(500, 'You exceeded your quota', 'insufficient_quota')],
        SourceStatus.REFUSED, 'quota', 1,
    ),
    '401': (lambda s: [s.error(401, 'bad key')], SourceStatus.AUTH, 'HTTP 401', 1),
    '403': (lambda s: [s.error(403, 'not you')], SourceStatus.AUTH, 'HTTP 403', 1),
    '404': (lambda s: [s.error(404, 'no such model')], SourceStatus.ERROR, 'no such model', 1),
    'redirect': (
        lambda s: [(302, {'Location': 'http://127.0.0.1:1/'}, {})],
        SourceStatus.ERROR, 'HTTP 302', 1,
    ),
    '400 max_tokens': (
        lambda s: [
            s.error(400, "Unsupported parameter: 'max_tokens', use 'max_completion_tokens'"),
            s.completion(GOOD),
        ], *OK, 2,
    ),
    '400 temperature': (
        lambda s: [s.error(400, "'temperature' does not support 0.0"), s.completion(GOOD)], *OK, 2,
    ),
    '400 always': (lambda s: [s.error(400, 'bad')], SourceStatus.ERROR, 'HTTP 400: ', 1),
    '400 on every field': (
        lambda s: [s.error(400, 'max_tokens, temperature: no')], SourceStatus.ERROR, 'HTTP 400', 4,
    ),
    'context too long': (
        lambda s: [s.error(400, 'exceed_context_size_error')], SourceStatus.ERROR, 'context', 1,
    ),
    '413': (lambda s: [s.error(413, 'too large')], SourceStatus.ERROR, 'too large', 1),
    'cut short': (lambda s: [s.completion(GOOD[:-9], 'length')], *OK, 1),
    'cut short before any point': (
        lambda s: [s.completion('Let me think', 'length')], SourceStatus.MALFORMED, 'cut short', 2,
    ),
    'refused': (
        lambda s: [s.completion(None, refusal='I will not')], SourceStatus.MALFORMED,
        'I will not', 2,
    ),
    'filtered': (
        lambda s: [s.completion('', 'content_filter')], SourceStatus.MALFORMED, 'filter', 2,
    ),
    'empty': (lambda s: [s.completion('')], SourceStatus.MALFORMED, 'empty', 2),
    'not a list': (lambda s: [s.completion('Go east.')], SourceStatus.MALFORMED, 'no list', 2),
    'a list on the second try': (
        lambda s: [s.completion('Go east.'), s.completion(GOOD)], *OK, 2,
    ),
    'half a character first': (
        lambda s: [(200, {}, s.completion('Go \ud800.')[2]), s.completion(GOOD)], *OK, 2,
    ),
    'an error on the second try': (
        lambda s: [s.completion('Go east.'), s.error(401)], SourceStatus.MALFORMED, 'no list', 2,
    ),
    'an empty list': (
        lambda s: [s.completion('Generated Path: []')], SourceStatus.NO_WAYPOINTS, 'empty', 1,
    ),
    'text in parts': (
        lambda s: [s.completion([{'type': 'text', 'text': GOOD}])], *OK, 1,
    ),
    'no JSON': (lambda s: [(200, {}, b'<html>')], SourceStatus.MALFORMED, 'completion', 1),
    'no choices': (lambda s: [(200, {}, {'choices': []})], SourceStatus.MALFORMED, 'compl', 1),
    'odd JSON': (lambda s: [(200, {}, [1, 2])], SourceStatus.MALFORMED, 'completion', 1),
    'no bytes': (lambda s: [(200, {}, b'')], SourceStatus.MALFORMED, 'completion', 1),
    'an error with 200': (
        lambda s: [(200, {}, {'error': {'message': 'busy'}})], SourceStatus.ERROR, 'busy', 1,
    ),
    'a huge body': (
        lambda s: [(200, {}, b' ' * (5 * 2**20))], SourceStatus.MALFORMED, 'longer than', 1,
    ),
    'compressed': (
        lambda s: [(200, {'Content-Encoding': 'gzip'}, gzip.compress(bytes(2**26)))],
        SourceStatus.MALFORMED, "'gzip' was not asked for", 1,
    ),
    'closes at once': (lambda s: [closes_at_once], SourceStatus.UNREACHABLE, 'unreachable', 3),
    'ends early': (lambda s: [ends_early], SourceStatus.UNREACHABLE, 'unreachable', 3),
    'ends early once': (lambda s: [ends_early, s.completion(GOOD)], *OK, 2),
}  # fmt: skip


@pytest.mark.parametrize('name', ROWS)
def test_each_row_of_the_failure_table(chat_server, name):
    script, status, word, requests = ROWS[name]
    chat_server.script = script(chat_server)
    started = time.monotonic()
    reply = source_for(chat_server).waypoints(QUERY)
    assert time.monotonic() - started < 10.0 + GENEROUS
    assert reply.status is status, reply
    assert word in reply.detail
    assert len(chat_server.requests) == requests
    if status is SourceStatus.OK:
        assert reply.waypoints
    else:
        assert reply.waypoints == ()
        assert reply.detail


SLOW = {
    'silence': lambda s: s.wait(60),
    'a drip in the headers': lambda s: s.drip(b'HTTP/1.1 200 OK\r\nX-Long: '),
    'a drip in the body': lambda s: s.drip(b'HTTP/1.1 200 OK\r\nContent-Length: 99999\r\n\r\n'),
    'drips without a length': lambda s: s.drip(b'HTTP/1.1 200 OK\r\n\r\n'),
}


@pytest.mark.parametrize('limited_by', ['timeout_s', 'time_limit', 'request'])
@pytest.mark.parametrize('name', SLOW)
def test_no_server_outlives_the_deadline(chat_server, name, limited_by):
    chat_server.script = [SLOW[name](chat_server)]
    started = time.monotonic()
    if limited_by == 'timeout_s':
        reply = source_for(chat_server, timeout_s=0.5).waypoints(QUERY)
    elif limited_by == 'time_limit':
        reply = source_for(chat_server).waypoints(replace(QUERY, time_limit=0.5))
    else:
        # Without a cache around it the request itself ends in time.
        client = client_of(source_for(chat_server))
        bare = EndpointSource(
            client, Prompt(load_template('few_shot')), SourceSettings(timeout_s=0.5)
        )
        reply = bare.waypoints(QUERY)
    assert time.monotonic() - started < 0.5 + GENEROUS
    assert reply.status is SourceStatus.TIMEOUT
    assert 'within 0.' in reply.detail


def test_retries_end_at_the_deadline(chat_server, monkeypatch):
    monkeypatch.setattr('llm_astar_planner.waypoints.llm.resilience.FIRST_DELAY_S', 0.3)
    chat_server.script = [chat_server.error(500)]
    started = time.monotonic()
    reply = source_for(chat_server, timeout_s=0.5, max_retries=10).waypoints(QUERY)
    assert time.monotonic() - started < 0.5 + GENEROUS
    assert reply.status is SourceStatus.ERROR
    assert len(chat_server.requests) <= 3


def test_no_follow_up_is_sent_whose_answer_would_come_too_late(chat_server):
    chat_server.script = [chat_server.wait(0.4, chat_server.completion('Go east.'))]
    source_for(chat_server, timeout_s=0.6).waypoints(QUERY)
    assert len(chat_server.requests) == 1


def test_refused_connections_and_tls_errors_open_the_breaker(chat_server):
    refused = source_for(chat_server, base_url=f'http://127.0.0.1:{closed_port()}/v1')
    tls = source_for(chat_server, base_url=chat_server.base_url.replace('http:', 'https:'))
    for source in (refused, tls):
        for _ in range(3):
            reply = source.waypoints(QUERY)
            assert reply.status is SourceStatus.UNREACHABLE
            assert '127.0.0.1 is unreachable' in reply.detail
        calls = client_of(source).budget.calls.total
        assert calls == 9
        reply = source.waypoints(QUERY)
        assert reply.status is SourceStatus.UNREACHABLE
        assert 'not asked for another' in reply.detail
        assert client_of(source).budget.calls.total == calls
        assert 'UNREACHABLE' in client_of(source).problem()


@pytest.fixture
def no_names(monkeypatch):
    """Let name look-ups hang until released, or fail where `hangs` is cleared."""
    release = threading.Event()
    lookup = socket.getaddrinfo

    def getaddrinfo(host, *args, **kwargs):
        name = host.decode() if isinstance(host, bytes) else host
        if name == 'hangs.example':
            release.wait(30)
        if name in ('hangs.example', 'fails.example'):
            raise socket.gaierror(socket.EAI_NONAME, 'Name or service not known')
        return lookup(host, *args, **kwargs)

    monkeypatch.setattr(socket, 'getaddrinfo', getaddrinfo)
    yield
    release.set()


@pytest.mark.parametrize(
    ('host', 'status', 'word'),
    [
        ('fails.example', SourceStatus.UNREACHABLE, 'fails.example is unreachable'),
        ('hangs.example', SourceStatus.TIMEOUT, ''),
    ],
)
def test_names_that_do_not_resolve(chat_server, monkeypatch, no_names, host, status, word):
    monkeypatch.setenv('ROBOT_API_KEY', 'one-two-three')
    source = source_for(
        chat_server, base_url=f'https://{host}/v1', api_key_env='ROBOT_API_KEY', timeout_s=1.0
    )
    started = time.monotonic()
    reply = source.waypoints(QUERY)
    assert time.monotonic() - started < 1.0 + GENEROUS
    assert reply.status is status
    assert word in reply.detail


@pytest.mark.parametrize('proxy', ['socks5://127.0.0.1:1', 'nonsense://127.0.0.1', 'http://:x'])
def test_proxy_settings_that_do_not_work(monkeypatch, chat_server, no_names, proxy):
    monkeypatch.setenv('ALL_PROXY', proxy)
    monkeypatch.setenv('ROBOT_API_KEY', 'one-two-three')
    source = source_for(
        chat_server,
        base_url='https://fails.example/v1',
        api_key_env='ROBOT_API_KEY',
        timeout_s=2.0,
    )
    reply = source.waypoints(QUERY)
    assert reply.status in (SourceStatus.ERROR, SourceStatus.UNREACHABLE), reply
    assert 'in the source' not in reply.detail


def test_an_auth_failure_is_not_repeated(chat_server):
    chat_server.script = [chat_server.error(401, 'bad key'), chat_server.completion(GOOD)]
    source = source_for(chat_server)
    assert source.waypoints(QUERY).status is SourceStatus.AUTH
    reply = source.waypoints(QUERY)
    assert reply.status is SourceStatus.AUTH
    assert 'until the parameters change' in reply.detail
    assert len(chat_server.requests) == 1
    assert source_for(chat_server).waypoints(QUERY).status is SourceStatus.OK


@pytest.mark.parametrize(
    ('settings', 'environment', 'word'),
    [
        ({'base_url': 'https://llm.example/v1'}, {}, 'no key for llm.example'),
        (
            {'base_url': 'https://llm.example/v1'},
            {'OPENAI_API_KEY': 'planted-secret'},
            'no key for llm.example',
        ),
        (
            {'base_url': 'https://llm.example/v1', 'api_key_env': 'OPENAI_API_KEY'},
            {'OPENAI_API_KEY': 'planted-secret'},
            'the key of api.openai.com and is not sent to llm.example',
        ),
        (
            {'api_key_env': 'OPENAI_API_KEY'},
            {'OPENAI_API_KEY': 'planted-secret'},
            'not sent to 127.0.0.1',
        ),
        (
            {'base_url': 'http://api.openai.com/v1'},
            {'OPENAI_API_KEY': 'planted-secret'},
            'only sent over https',
        ),
        (
            {'base_url': 'http://192.168.1.5:8000/v1', 'api_key_env': 'ROBOT_API_KEY'},
            {'ROBOT_API_KEY': 'planted-secret'},
            'only sent over https, or to this machine',
        ),
        ({'base_url': 'https://api.openai.com/v1'}, {}, 'OPENAI_API_KEY is not set'),
        ({'api_key_env': 'ROBOT_API_KEY'}, {}, 'ROBOT_API_KEY is not set'),
        ({'api_key_env': 'ROBOT_API_KEY'}, {'ROBOT_API_KEY': 'planted\nsecret'}, 'no usable key'),
        ({'api_key_env': 'ROBOT_API_KEY'}, {'ROBOT_API_KEY': 'planted-\u00e4'}, 'no usable key'),
    ],
)
def test_without_its_own_key_nothing_is_asked(
    chat_server, monkeypatch, settings, environment, word
):
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    source = source_for(chat_server, **settings)
    reply = source.waypoints(QUERY)
    assert reply.status is SourceStatus.NOT_CONFIGURED
    assert word in reply.detail
    assert 'planted' not in reply.detail
    assert chat_server.requests == []
    assert client_of(source).budget.calls.total == 0


def test_fields_that_an_endpoint_rejects_are_remembered(chat_server):
    chat_server.script = [
        chat_server.error(400, "Unsupported parameter: 'max_tokens'"),
        chat_server.error(400, "Unsupported value: 'temperature'"),
        chat_server.error(400, 'response_format json_schema is not supported'),
        chat_server.error(422, 'response_format is unknown'),
        chat_server.completion(GOOD),
    ]
    source = source_for(chat_server, response_format='json_schema')
    assert source.waypoints(QUERY).waypoints == PATH
    assert source.waypoints(replace(QUERY, goal=(21, 20))).status is SourceStatus.OK
    formats = [body.get('response_format', {}).get('type') for body in chat_server.requests]
    assert formats == ['json_schema'] * 3 + ['json_object', None, None]
    assert [set(body) & {'max_tokens', 'temperature'} for body in chat_server.requests] == [
        {'max_tokens', 'temperature'},
        {'temperature'},
        *[set()] * 4,
    ]
    assert all(body['max_completion_tokens'] == 1000 for body in chat_server.requests[1:])


def test_a_late_reply_goes_to_the_cache(chat_server):
    chat_server.script = [chat_server.wait(0.6, chat_server.completion(GOOD))]
    source = source_for(chat_server)
    first = source.waypoints(replace(QUERY, time_limit=0.1))
    assert first.status is SourceStatus.TIMEOUT
    assert source.waypoints(QUERY).waypoints == PATH
    assert source.waypoints(replace(QUERY, time_limit=0.1)).waypoints == PATH
    assert len(chat_server.requests) == 1


def test_concurrent_requests_are_bounded(chat_server):
    running, most = [], []

    def responder(handler):
        running.append(1)
        most.append(len(running))
        time.sleep(0.1)
        running.pop()
        chat_server.respond(handler, chat_server.completion(GOOD))

    chat_server.script = [responder]
    source = source_for(chat_server, max_concurrent=2)
    replies = []
    threads = [
        threading.Thread(
            target=lambda i=i: replies.append(source.waypoints(replace(QUERY, goal=(20, 18 + i))))
        )
        for i in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [reply.status for reply in replies] == [SourceStatus.OK] * 6
    assert max(most) <= 2


@pytest.mark.parametrize(
    ('limit', 'value', 'answered'), [('max_calls_per_hour', 2, 2), ('max_tokens_per_day', 200, 2)]
)
def test_a_reached_limit_is_a_refused_reply(chat_server, limit, value, answered):
    source = source_for(chat_server, **{limit: value})
    replies = [source.waypoints(replace(QUERY, goal=(20, 17 + i))) for i in range(4)]
    assert [reply.status for reply in replies] == [SourceStatus.OK] * answered + [
        SourceStatus.REFUSED
    ] * (4 - answered)
    assert limit in replies[-1].detail
    assert len(chat_server.requests) == answered


KEY = 'planted-secret-key-0123456789'


def test_a_key_appears_in_no_output(chat_server, monkeypatch, tmp_path, caplog, capfd):
    """The server echoes what it was sent, in replies and errors, whole and near every cut."""
    caplog.set_level(logging.DEBUG)
    monkeypatch.setenv('ROBOT_API_KEY', KEY)

    def echo(status, pad):
        def responder(handler):
            words = ' ' * pad + handler.headers['Authorization']
            body = {'error': {'message': words}} if status >= 400 else None
            if body is None:
                body = chat_server.completion(f'{words} {GOOD}')[2]
            chat_server.respond(handler, (status, {}, body))

        return responder

    seen = []
    for status in (200, 302, 400, 401, 403, 404, 429, 500):
        for pad in (0, 240, 250, 1980):
            chat_server.script = [echo(status, pad)]
            record = tmp_path / f'{status}-{pad}.jsonl'
            settings = {'api_key_env': 'ROBOT_API_KEY', 'record': str(record), 'max_retries': 0}
            source = source_for(chat_server, **settings)
            reply = source.waypoints(QUERY)
            seen += [
                repr(reply),
                repr(source),
                repr(client_of(source)),
                str(client_of(source).problem()),
            ]
            seen += [json.dumps(SourceSettings(**settings).__dict__), record.read_text()]
    assert chat_server.headers[0]['Authorization'] == f'Bearer {KEY}'
    captured = capfd.readouterr()
    seen += [caplog.text, captured.out, captured.err]
    assert 'httpcore' not in caplog.text
    assert 'HTTP Request' not in caplog.text
    for text in seen:
        assert KEY[:12] not in text
    assert any('***' in text for text in seen)


@pytest.mark.parametrize(
    'before',
    ['', 'HTTP/1.1 200 OK\r\n', 'HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n'],
)
def test_a_key_in_a_response_that_is_not_http_appears_in_no_output(
    chat_server, monkeypatch, before
):
    monkeypatch.setenv('ROBOT_API_KEY', KEY)
    chat_server.script = [
        lambda handler: handler.wfile.write(
            f'{before}{handler.headers["Authorization"]}\r\n\r\n'.encode()
        )
    ]
    source = source_for(chat_server, api_key_env='ROBOT_API_KEY', max_retries=0)
    reply = source.waypoints(QUERY)
    assert reply.status is SourceStatus.UNREACHABLE
    assert 'illegal' in reply.detail
    assert KEY[:12] not in repr(reply) + str(client_of(source).problem())


@pytest.mark.parametrize('field', ['content', 'refusal'])
def test_a_key_escaped_in_json_appears_in_no_output(chat_server, monkeypatch, field):
    monkeypatch.setenv('ROBOT_API_KEY', KEY)
    spelt = ''.join(f'\\u{ord(letter):04x}' for letter in KEY)
    body = json.dumps(chat_server.completion('', **{field: 'I hold KEY'})[2])
    chat_server.script = [(200, {}, body.replace('KEY', spelt).encode())]
    reply = source_for(chat_server, api_key_env='ROBOT_API_KEY').waypoints(QUERY)
    assert 'I hold ***' in reply.text + reply.detail
    assert KEY[:12] not in repr(reply)


def test_the_text_and_the_token_counts_of_an_answer_are_bounded(chat_server):
    status, headers, body = chat_server.completion('x' * 2 * MAX_REPLY_CHARS + GOOD)
    body['usage'] = {'prompt_tokens': -5, 'completion_tokens': 10**30}
    chat_server.script = [(status, headers, body)]
    reply = source_for(chat_server).waypoints(QUERY)
    assert reply.waypoints == PATH
    assert len(reply.text) == MAX_REPLY_CHARS
    assert (reply.prompt_tokens, reply.completion_tokens) == (0, 0)
    chat_server.script += [chat_server.completion('x' * 10_000), chat_server.completion(GOOD)]
    source_for(chat_server).waypoints(QUERY)
    quoted = chat_server.requests[-1]['messages'][-2]
    assert quoted == {'role': 'assistant', 'content': 'x' * MAX_QUOTED_CHARS}
