"""A real server on loopback, for all tests of the page's server."""

import socket
import threading

import httpx
import pytest
import uvicorn
from llm_astar_planner.play.app import PlayApp
from llm_astar_planner.play.maps import Maps


@pytest.fixture(scope='session')
def played_maps():
    return Maps()


@pytest.fixture(scope='session')
def play_url(played_maps):
    listener = socket.create_server(('127.0.0.1', 0))
    config = uvicorn.Config(PlayApp(played_maps).asgi(), log_level='error')
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={'sockets': [listener]})
    thread.start()
    yield f'http://127.0.0.1:{listener.getsockname()[1]}'
    server.should_exit = True
    thread.join()
    listener.close()


@pytest.fixture
def page(play_url):
    """A client that asks as the page does."""
    with httpx.Client(base_url=play_url, trust_env=False, timeout=60.0) as client:
        yield client
