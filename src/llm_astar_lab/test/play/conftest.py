"""A real server on loopback, for all tests of the page's server."""

import signal
import threading

import httpx
import pytest
from llm_astar_lab.play.maps import Maps
from llm_astar_lab.play.server import PlayApp, PlayServer, listen


@pytest.fixture(scope='session')
def played_maps():
    return Maps()


@pytest.fixture(scope='session')
def play_url(played_maps):
    app, listener = PlayApp(played_maps), listen('127.0.0.1', 0)
    server = PlayServer(app, '127.0.0.1')
    thread = threading.Thread(target=server.run, kwargs={'sockets': [listener]})
    thread.start()
    yield f'http://127.0.0.1:{listener.getsockname()[1]}'
    server.handle_exit(signal.SIGINT, None)
    thread.join()
    listener.close()


@pytest.fixture
def page(play_url):
    """A client that asks as the page does."""
    with httpx.Client(base_url=play_url, trust_env=False, timeout=60.0) as client:
        yield client
