"""Floods of the page's server: half-open connections, and more users than it has cores."""

import concurrent.futures
import contextlib
import socket
import threading
import time

import httpx
import pytest
from llm_astar_lab.play import planning
from llm_astar_lab.play import server as play_app

DEMO = {'map': 'demo.json:0', 'start': [39, 18], 'goal': [7, 19]}
PATIENCE = 60.0


def port_of(url):
    return int(url.rpartition(':')[2])


def ask(url, **fields):
    answer = httpx.post(
        f'{url}/api/plan',
        json={**DEMO, **fields},
        headers={'x-page': fields.get('source', '')},
        trust_env=False,
        timeout=PATIENCE,
    )
    return answer.status_code, answer.json()


@contextlib.contextmanager
def half_open(url, count, head=b'GET / HTTP/1.1\r\nHost: loc'):
    """Connect so many times, each time with half of a request's head."""
    with contextlib.ExitStack() as stack:
        address = '127.0.0.1', port_of(url)
        held = [
            stack.enter_context(socket.create_connection(address, PATIENCE)) for _ in range(count)
        ]
        for connection in held:
            connection.sendall(head)
        yield held


def is_closed(connection):
    """Wait until the other end closes a connection."""
    try:
        return connection.recv(1) == b''
    except ConnectionResetError:
        return True


def test_half_open_connections_keep_nobody_out_and_are_closed(play_url, monkeypatch):
    monkeypatch.setattr(play_app, 'HEAD_S', 0.5)
    with half_open(play_url, 64) as held:
        assert ask(play_url)[0] == 200
        assert all(map(is_closed, held))


def test_the_oldest_of_too_many_connections_make_way(play_url, monkeypatch):
    monkeypatch.setattr(play_app, 'HEAD_S', 600.0)
    monkeypatch.setattr(play_app, 'MAX_CONNECTIONS', 8)
    on_tick, looked = play_app.PlayServer.on_tick, threading.Event()

    async def noticed(self, counter):
        ends = await on_tick(self, counter)
        looked.set()
        return ends

    with half_open(play_url, 8) as older:
        # Its connection is accepted after theirs.
        assert ask(play_url)[0] == 200
        monkeypatch.setattr(play_app.PlayServer, 'on_tick', noticed)
        assert looked.wait(PATIENCE)
        with half_open(play_url, 12):
            assert all(map(is_closed, older))
            assert ask(play_url)[0] == 200


def test_a_connection_that_waits_for_its_next_request_is_closed_too(play_url, monkeypatch):
    monkeypatch.setattr(play_app, 'HEAD_S', 0.5)
    whole = b'GET /api/options HTTP/1.1\r\nHost: localhost\r\n\r\n'
    with half_open(play_url, 1, whole + b'GET /api/op') as (connection,):
        received = b''
        while part := connection.recv(65536):
            received += part
        assert received.startswith(b'HTTP/1.1 200')


def test_twelve_users_at_once_all_get_their_plans(play_url):
    def user(number):
        return [ask(play_url, start=[5 + number, 5 + turn])[0] for turn in range(3)]

    with concurrent.futures.ThreadPoolExecutor(12) as users:
        assert list(users.map(user, range(12))) == [[200] * 3] * 12


@pytest.fixture
def held_up(play_url, monkeypatch):
    """Plans that do not end before the test."""
    go, begun = threading.Event(), threading.Semaphore(0)

    def work(self, asked, stop):
        begun.release()
        go.wait(PATIENCE)
        return b'{}'

    monkeypatch.setattr(play_app.PlayApp, 'work', work)
    with concurrent.futures.ThreadPoolExecutor(planning.AT_A_TIME + 2) as threads:
        running = [threads.submit(ask, play_url) for _ in range(planning.AT_A_TIME)]
        for _ in running:
            assert begun.acquire(timeout=PATIENCE)
        yield threads
        go.set()
        assert [one.result()[0] for one in running] == [200] * planning.AT_A_TIME


def queue_of(url, name):
    return httpx.get(f'{url}/api/queue', params={'page': name}, trust_env=False).json()


def wait_for_place(url, name, place):
    deadline = time.monotonic() + PATIENCE
    while (queue := queue_of(url, name))['place'] != place:
        assert time.monotonic() < deadline, queue
        time.sleep(0.02)
    return queue


def test_a_page_that_waits_can_ask_for_its_place(play_url, held_up):
    first = held_up.submit(ask, play_url, source='random')
    wait_for_place(play_url, 'random', 1)
    second = held_up.submit(ask, play_url, source='straight')
    queue = wait_for_place(play_url, 'straight', 2)
    assert queue == {'running': planning.AT_A_TIME, 'waiting': 2, 'place': 2}
    assert queue_of(play_url, 'another')['place'] == 0
    assert not first.done()
    assert not second.done()


def test_too_many_plans_of_one_address_hear_that_it_is_busy(play_url, held_up, monkeypatch):
    monkeypatch.setattr(planning, 'MAX_OF_ONE', 1)
    waiting = held_up.submit(ask, play_url, source='random')
    wait_for_place(play_url, 'random', 1)
    status, answer = ask(play_url)
    assert (status, answer['error']) == (
        503,
        'busy: 1 plans are waiting, 1 of this address; ask again in a moment',
    )
    assert not waiting.done()
