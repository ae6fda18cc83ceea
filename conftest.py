"""What every test runs under: a graph of its own, checked message fields, no foreign keys."""

import contextlib
import gc
import json
import os
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from hypothesis import HealthCheck, settings

# The same examples every run, on slow machines too: a failure is never a matter of luck.
settings.register_profile(
    'tests',
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile('tests')

# One domain a worker, away from a robot's usual ones; set before anything imports rclpy.
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:])
os.environ['ROS_DOMAIN_ID'] = str(40 + (os.getpid() + _WORKER) % 60)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
# A worker has one core: threads that share a product of matrices only wait for each other there.
os.environ.setdefault('OMP_NUM_THREADS', '1')
# What a person has confirmed is remembered in a folder that ends with the tests.
_STATE = tempfile.TemporaryDirectory()
os.environ['XDG_STATE_HOME'] = _STATE.name


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect no garbage among the tests and their modules: to look took half of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


class ChatServer:
    """An OpenAI-compatible endpoint on loopback that misbehaves as it is told to.

    Answers POST requests from a script: the last responder goes on for ever.

    A responder is (status, headers, body) or a function of the request handler.
    """

    def __init__(self):
        self.script = [self.completion('Generated Path: [[5, 5], [26, 9], [20, 20]]')]
        self.requests = []
        self.headers = []
        self.paths = []
        self.stopping = threading.Event()
        self.lock = threading.Lock()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers['Content-Length']))
                with outer.lock:
                    outer.requests.append(json.loads(body))
                    outer.headers.append(dict(self.headers))
                    outer.paths.append(self.path)
                    turn = min(len(outer.requests), len(outer.script)) - 1
                    responder = outer.script[turn]
                with contextlib.suppress(OSError):  # the client may have gone, as it should
                    outer.respond(self, responder)

            def log_message(self, *args):
                pass

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, *args):
                pass  # a TLS hello is no request

        self.server = Server(('127.0.0.1', 0), Handler)
        self.base_url = f'http://127.0.0.1:{self.server.server_port}/v1'
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.02,))
        self.thread.start()

    def respond(self, handler, responder):
        if callable(responder):
            responder(handler)
            return
        status, headers, body = responder
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        handler.send_response(status)
        for name, value in {'Content-Length': str(len(data)), **headers}.items():
            handler.send_header(name, value)
        handler.end_headers()
        handler.wfile.write(data)

    @staticmethod
    def completion(text, finish_reason='stop', **message):
        return (
            200,
            {},
            {
                'choices': [
                    {'message': {'content': text, **message}, 'finish_reason': finish_reason}
                ],
                'usage': {'prompt_tokens': 100, 'completion_tokens': 20},
            },
        )

    @staticmethod
    def error(status, message='', code='', headers=None):
        return status, headers or {}, {'error': {'message': message, 'code': code}}

    def drip(self, prefix, pause=0.05):
        """Return a responder that sends `prefix` and then a byte at a time, without an end."""

        def responder(handler):
            handler.wfile.write(prefix)
            while not self.stopping.wait(pause):
                handler.wfile.write(b' ')
                handler.wfile.flush()

        return responder

    def wait(self, seconds, then=None):
        """Return a responder that is silent for some seconds before it answers."""

        def responder(handler):
            self.stopping.wait(seconds)
            if then is not None:
                self.respond(handler, then)

        return responder

    def stop(self):
        self.stopping.set()
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()


@pytest.fixture
def chat_server():
    server = ChatServer()
    yield server
    server.stop()


@pytest.fixture(autouse=True)
def no_foreign_environment(monkeypatch):
    """Keep the machine's own proxies and keys out of the tests."""
    for name in ('HTTP_PROXY', 'HTTPS_PROXY', 'ALL_PROXY', 'NO_PROXY', 'OPENAI_API_KEY'):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.lower(), raising=False)
