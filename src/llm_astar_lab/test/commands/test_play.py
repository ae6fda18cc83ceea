"""How `llm-astar play` starts, and what it says where it cannot."""

import builtins
import signal
import socket
import subprocess
import sys

import pytest
from llm_astar_lab.play.maps import MAX_CELLS
from llm_astar_lab.play.server import listen, url_of
from llm_astar_planner.cli.main import main


def refused(capsys, *arguments):
    """Return the exit code and the one line that the command prints."""
    code = main(['play', '--no-browser', *arguments])
    out, err = capsys.readouterr()
    assert out == ''
    assert len(err.splitlines()) == 1
    return code, err


def test_a_port_that_is_in_use_is_named_with_the_fix(capsys):
    with listen('127.0.0.1', 0) as taken:
        port = str(taken.getsockname()[1])
        code, sentence = refused(capsys, '--port', port)
    assert code == 2
    assert f'--port {port}: is in use' in sentence
    assert 'choose another' in sentence


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--port', '65536'), '--port 65536: is not in 0 to 65535'),
        (('--host', '203.0.113.7', '--port', '0'), '--host 203.0.113.7'),
        (('--host', 'a' * 70 + '.example', '--port', '0'), '--host aaa'),
        (('--map', 'missing.yaml'), 'missing.yaml'),
    ],
)
def test_where_it_cannot_serve_it_says_why_in_one_line(capsys, arguments, words):
    code, sentence = refused(capsys, *arguments)
    assert code == 2
    assert words in sentence


def test_a_map_that_is_too_large_for_a_page_is_refused(capsys, tmp_path):
    side = int(MAX_CELLS**0.5) + 1
    (tmp_path / 'large.pgm').write_bytes(b'P5 %d %d 255\n' % (side, side) + b'\xff' * side**2)
    (tmp_path / 'large.yaml').write_text(
        'image: large.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.25\n'
    )
    code, sentence = refused(capsys, '--map', str(tmp_path / 'large.yaml'))
    assert code == 2
    assert 'large.yaml' in sentence
    assert str(MAX_CELLS) in sentence


def test_a_missing_library_is_named_with_what_says_how_to_install_it(capsys, monkeypatch):
    real_import = builtins.__import__

    def without_uvicorn(name, *arguments):
        if name == 'uvicorn':
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)
        return real_import(name, *arguments)

    monkeypatch.delitem(sys.modules, 'llm_astar_lab.play.server', raising=False)
    monkeypatch.setattr(builtins, '__import__', without_uvicorn)
    code, sentence = refused(capsys)
    assert code == 1
    assert "No module named 'uvicorn'; `llm-astar doctor` says what to install" in sentence


def test_the_address_for_a_browser():
    assert url_of('127.0.0.1', 8321) == 'http://127.0.0.1:8321/'
    assert url_of('::', 80) == 'http://localhost:80/'
    assert url_of('::1', 80) == 'http://[::1]:80/'


def test_sigterm_ends_it_while_a_page_is_connected():
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'play', '--no-browser']
    with subprocess.Popen(
        [*command, '--port', '0'], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        port = int(process.stdout.readline().split(':')[2].split('/')[0])
        with socket.create_connection(('127.0.0.1', port)) as connection:
            connection.sendall(b'GET /api/options HTTP/1.1\r\nHost: localhost\r\n\r\n')
            assert b' 200 ' in connection.recv(100)
            process.terminate()
            _, err = process.communicate(timeout=60.0)
    assert err == ''
    assert process.returncode in (0, -signal.SIGTERM)
