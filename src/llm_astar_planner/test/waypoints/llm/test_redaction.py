"""A key that a server echoes stands in no output, however the server spells it."""

import base64
import html
import json
import logging
import quopri
import re
import time
import unicodedata
from urllib.parse import quote, unquote

import httpx
import pytest
from llm_astar_msgs_adapter.errors import printable
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.chain import make_interpreter
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.llm.credentials import LEAK, WITHHELD, redact
from llm_astar_planner.waypoints.llm.source import client_of
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 0, 25), Barrier(15, 30, 50)))
QUERY = WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20))
GOOD = 'Generated Path: [[5, 5], [26, 9], [20, 20]]'
KEY = 'sk-proj-Pl4nt3d/Secret+K3y_0123456789'
BEARER = f'Bearer {KEY}'


def each(form):
    return ''.join(form(letter) for letter in KEY)


def code(form):
    return each(lambda letter: form.format(ord(letter)))


def encoded(data):
    return base64.b64encode(data).decode()


def letters(text):
    """Return the ASCII letters and digits of a text, without their case and accents."""
    plain = unicodedata.normalize('NFKD', text).lower()
    return ''.join(letter for letter in plain if letter.isascii() and letter.isalnum())


# A part of the key that no text may show.
HIDDEN = letters(KEY)[7 : 7 + LEAK]
# How a server may spell the key in a text.
SPELLINGS = {
    'plain': KEY,
    'upper case': KEY.upper(),
    'slashes': KEY.replace('/', r'\/'),
    'unicode escapes': code('\\u{:04x}'),
    'two levels': code('\\\\u{:04X}'),
    'as JSON of JSON': json.dumps(json.dumps({'authorization': code('\\u{:04x}')})),
    'long escapes': code('\\U{:08x}'),
    'braces': code('\\u{{{:x}}}'),
    'hexadecimal escapes': code('\\x{:02x}'),
    'octal escapes': code('\\{:03o}'),
    'percent': code('%{:02X}'),
    'percent twice': code('%25{:02x}'),
    'percent of JavaScript': code('%u{:04x}'),
    'a quoted URL': quote(BEARER, safe=''),
    'entities': code('&#{};'),
    'entities in hexadecimal': code('&#x{:X};'),
    'entities without an end': code('&#{} '),
    'entities twice': html.escape(code('&#{:05d};')),
    'named entities': KEY.replace('/', '&sol;').replace('+', '&plus;').replace('_', '&lowbar;'),
    'quoted-printable': quopri.encodestring(f'{" x" * 27}{BEARER}'.encode()).decode(),
    'base64': encoded(KEY.encode()),
    'base64 of the header': encoded(BEARER.encode()),
    'base64 at the third offset': encoded(f'ab{KEY}cd'.encode()),
    'base64 for URLs': base64.urlsafe_b64encode(BEARER.encode()).decode(),
    'base64 in lines': base64.encodebytes(f'{" " * 30}{BEARER}'.encode()).decode(),
    'base64, escaped': quote(encoded(BEARER.encode()), safe=''),
    'UTF-16 read as Latin-1': KEY.encode('utf-16-le').decode('latin-1'),
    'UTF-32 read as Latin-1': KEY.encode('utf-32-be').decode('latin-1'),
    'accents': each(lambda letter: letter + '\u0301'),
    'no width': '\u200b'.join(KEY),
    'two lines': f'{KEY[:11]}\n{KEY[11:]}',
    'two lines, escaped': f'{KEY[:11]}\\n{KEY[11:]}',
    'quoted lines': f'"{KEY[:11]}" +\r\n    "{KEY[11:]}"',
    'spelt with dots': '.'.join(KEY),
    'colours': f'\x1b[1m{KEY[:11]}\x1b[0m{KEY[11:]}',
    'no width within escapes': '\u200b'.join(code('\\u{:04x}')),
    'blanks within escapes': ' '.join(code('%{:02x}')),
    'escapes in capitals': code('\\u{:04x}').upper(),
    'its first part': KEY[: 8 + LEAK + 3],
    'a part of it': KEY[9 : 9 + LEAK + 2],
}


def source_for(server, **settings):
    values = {'base_url': server.base_url, 'model': 'tiny', 'max_retries': 0, 'timeout_s': 20.0}
    values |= {'source': 'endpoint', 'api_key_env': 'ROBOT_API_KEY', **settings}
    return make_source(SourceSettings(**values))


def leaks(text):
    """Return the texts that show the key once each spelling is undone, by the means of Python."""
    closed = re.sub('[ \u200b]', '', text).replace('\\U00', '\\u00')
    return [one for start in (text, closed) for one in undone(start) if HIDDEN in letters(one)]


def undone(text):
    """Yield a text in each form that decoders of Python's library give it."""
    yield text
    last = text
    for _ in range(3):
        last = html.unescape(unquote(last)).replace('\\/', '/')
        raw = last.encode('ascii', 'backslashreplace')
        yield re.sub(r'[\\%]u\{?([0-9a-fA-F]{2,4})\}?', lambda code: chr(int(code[1], 16)), last)
        yield quopri.decodestring(last.encode(errors='replace')).decode('utf-8', 'replace')
        yield re.sub('\x1b\\[0?m', '', last)
        last = raw.decode('unicode_escape', 'replace')
        yield last
    for run in re.findall('[A-Za-z0-9+/]{16,}', re.sub(r'\\n|\s', '', unquote(text))):
        for start in range(4):
            part = run[start:]
            yield base64.b64decode(part[: len(part) // 4 * 4]).decode('latin-1')
    for run in re.findall('(?:[0-9a-f]{2}:?){12,}', text.lower()):
        yield bytes.fromhex(run.replace(':', '')).decode('latin-1')
    for run in re.findall(r'(?:\d{2,3}, ){12,}', text):
        yield ''.join(map(chr, map(int, run.split(', ')[:-1])))


@pytest.mark.parametrize('name', SPELLINGS)
def test_a_spelling_of_the_key_is_found_in_a_text(name):
    text = f'HTTP says: {SPELLINGS[name]} and more'
    assert leaks(text)
    shown = redact(text, KEY)
    assert shown in (text.replace(KEY, '***'), WITHHELD)
    assert (shown == WITHHELD) == (name != 'plain')


def test_ordinary_texts_stay_as_they_are():
    for text in (
        'Incorrect API key provided: sk-proj-********6789. See https://x.y/account/api-keys.',
        GOOD * 50,
        'caf\u00e9 \u2192 100 % of \\alpha &amp; =3D, base64 like Q2xhdWRl',
        json.dumps([[index, 3 * index % 50] for index in range(500)]),
        f'{"=" * 80}\n{"-" * 80}\n| a | b |\n{"%" * 9} {"&" * 9} C:\\\\x \\frac{{1}}{{2}} \u2550',
    ):
        assert redact(text, KEY) == text
    assert redact('a secret', 'short') == 'a secret'
    assert redact('any text', '') == 'any text'


def test_escapes_without_an_end_are_withheld_quickly():
    started = time.thread_time()
    for text in ('%' + '25' * 32000, '\\' * 65536, '&' + 'amp;' * 16000, 'a\u0301\u0316' * 20000):
        redact(text, KEY)
    assert time.thread_time() - started < 5.0
    assert redact('%' + '25' * 3000, KEY) == WITHHELD


def test_what_a_terminal_would_obey_is_not_printable():
    assert printable('a\x1b[2J\x07\x9b1m\u202eb\r\nc\ud800\x00') == 'a?[2J??1m?b c??'


@pytest.mark.parametrize(
    ('where', 'step'),
    [('message', 1), ('code', 5), ('body', 3), ('content', 1), ('refusal', 5), ('parts', 5)],
)
def test_no_spelling_of_the_key_gets_out_of_the_client(
    chat_server, monkeypatch, tmp_path, caplog, capfd, where, step
):
    caplog.set_level(logging.DEBUG)
    monkeypatch.setenv('ROBOT_API_KEY', KEY)
    seen = []
    for number, spelt in enumerate([*SPELLINGS.values()][::step]):
        error = {'error': {'message': f'You sent {spelt}', 'code': 'bad_key'}}
        chat_server.script = [
            {
                'message': (401, {}, error),
                'code': (400, {}, {'error': {'message': 'no', 'code': spelt, 'type': spelt}}),
                'body': (500, {}, f'<html>{spelt}</html>'.encode('utf-8', 'replace')),
                'content': chat_server.completion(f'{spelt} {GOOD}'),
                'refusal': chat_server.completion('', refusal=spelt),
                'parts': chat_server.completion(
                    [{'type': 'text', 'text': part} for part in (spelt[:9], spelt[9:], GOOD)]
                ),
            }[where]
        ]
        record = tmp_path / f'{number}.jsonl'
        source = source_for(chat_server, record=str(record))
        reply = source.waypoints(QUERY)
        seen += [repr(reply), repr(source), str(client_of(source).problem()), record.read_text()]
    assert chat_server.headers[0]['Authorization'] == BEARER
    captured = capfd.readouterr()
    for text in (*seen, caplog.text, captured.out, captured.err):
        assert not leaks(text)
        assert not set(text) & set(map(chr, (*range(9), 11, 12, *range(14, 32), *range(127, 160))))
    assert 'http' not in {record.name[:4] for record in caplog.records}


@pytest.mark.parametrize('encoding', ['utf-16', 'utf-16-be', 'utf-32', 'utf-8-sig'])
@pytest.mark.parametrize('status', [200, 403])
def test_a_body_in_another_encoding_and_in_pieces(chat_server, monkeypatch, encoding, status):
    monkeypatch.setenv('ROBOT_API_KEY', KEY)
    body = chat_server.completion(f'{KEY} {GOOD}')[2]
    if status != 200:
        body = {'error': {'message': f'no key like {KEY}', 'code': 'invalid'}}
    data = json.dumps(body).encode(encoding)

    def in_pieces(handler):
        handler.send_response(status)
        handler.send_header('Transfer-Encoding', 'chunked')
        handler.end_headers()
        for start in range(0, len(data), 7):
            piece = data[start : start + 7]
            handler.wfile.write(f'{len(piece):x}\r\n'.encode() + piece + b'\r\n')
        handler.wfile.write(b'0\r\n\r\n')

    chat_server.script = [in_pieces]
    reply = source_for(chat_server).waypoints(QUERY)
    assert not leaks(repr(reply))
    if status == 200:
        assert reply.waypoints
        assert '***' in reply.text
    else:
        assert reply.detail == 'HTTP 403 (invalid): no key like ***'


@pytest.mark.parametrize(
    ('body', 'detail'),
    [
        ({'error': {'message': 'bad', 'type': 'invalid'}}, 'HTTP 400 (invalid): bad'),
        ({'error': 'model "x" not found'}, 'HTTP 400: model "x" not found'),
        ({'object': 'error', 'message': 'too long', 'code': 40003}, 'HTTP 400 (40003): too long'),
        ({'detail': 'Not Found'}, 'HTTP 400: Not Found'),
        ([{'error': {'code': 400, 'message': 'no', 'status': 'INVALID'}}], 'HTTP 400 (400): no'),
        ({'detail': [{'msg': 'x'}]}, 'HTTP 400: {"detail": [{"msg": "x"}]}'),
        (b'<b>\x1b]0;owned\x07 no</b>', 'HTTP 400: <b>?]0;owned? no</b>'),
        ({'error': {'message': {'deep': 1}, 'code': 10**30}}, 'HTTP 400: {"error": {"message"'),
        (b'', 'HTTP 400'),
    ],
)
def test_an_error_is_quoted_as_status_code_and_message(chat_server, body, detail):
    chat_server.script = [(400, {}, body)]
    reply = source_for(chat_server, api_key_env='').waypoints(QUERY)
    assert reply.status is SourceStatus.ERROR
    assert reply.detail.startswith(detail)
    assert len(reply.detail) <= 300


def test_a_key_in_a_header_or_a_reason_gets_out_nowhere(chat_server, monkeypatch, caplog):
    caplog.set_level(logging.DEBUG)
    monkeypatch.setenv('ROBOT_API_KEY', KEY)

    def echo(handler):
        handler.send_response(200, f'Hello {KEY}')
        handler.send_header('Content-Encoding', KEY)
        handler.send_header('Retry-After', KEY)
        handler.end_headers()

    chat_server.script = [echo]
    reply = source_for(chat_server).waypoints(QUERY)
    assert 'was not asked for' in reply.detail or WITHHELD in reply.detail
    assert not leaks(repr(reply) + caplog.text)


def test_the_loggers_of_httpx_speak_of_other_requests(chat_server, caplog):
    caplog.set_level(logging.DEBUG)
    source_for(chat_server, api_key_env='').waypoints(QUERY)
    assert not [record for record in caplog.records if record.name.startswith('http')]
    known = {name for name in logging.root.manager.loggerDict if name.startswith('httpcore.')}
    httpx.post(f'{chat_server.base_url}/mine', json={})
    names = {record.name for record in caplog.records if record.name.startswith('http')}
    assert {'httpx', 'httpcore.http11', 'httpcore.connection'} <= names
    assert all(logging.getLogger(name).filters for name in known)


def test_a_key_in_the_reply_to_an_instruction_gets_out_nowhere(chat_server, monkeypatch, tmp_path):
    monkeypatch.setenv('ROBOT_API_KEY', KEY)
    record = tmp_path / 'told.jsonl'
    values = {'source': 'endpoint', 'base_url': chat_server.base_url, 'record': str(record)}
    values |= {'api_key_env': 'ROBOT_API_KEY', 'max_retries': 0}
    for spelt in ('base64', 'percent', 'two lines', 'entities'):
        chat_server.script = [chat_server.completion(f'{{"clauses": "{SPELLINGS[spelt]}"}}')]
        interpreter = make_interpreter(values)
        answer = interpreter.interpret('please waltz around the big thing', NO_PLACES, 10.0)
        assert not leaks(repr(answer) + record.read_text())
    assert chat_server.headers
