# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Serves the page: its routes and their limits, who may ask, the socket, and a clean end.

Pages of its own may ask: browsers say in the headers of a request whose it is.
"""

import asyncio
import contextlib
import errno
import ipaddress
import json
import re
import socket
import time
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import uvicorn
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.search.arrays import StopFlag
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from llm_astar_lab.play.encoding import map_json, options_json, reply_json
from llm_astar_lab.play.live import LiveFeed
from llm_astar_lab.play.maps import Maps, PlayError
from llm_astar_lab.play.planning import PlanningService, Worker
from llm_astar_lab.play.request import PlayRequest, read_request

PAGE = Path(__file__).parent / 'page'
MAX_BODY = 2**20
# Of a map that is dropped onto the page.
MAX_DROPPED_BODY = 2**23
TOO_LONG = 'the body is over {} bytes; edit fewer walls, or cut out a part of the map'
# A request holds walls, these cells, and these numbers.
MAX_DEPTH = 5
# Seconds in which the head of a request, and its body, have to arrive.
HEAD_S, BODY_S = 10.0, 10.0
# Characters of a sentence about foreign text.
MAX_SENTENCE = 400
# Seconds that answers under way get at the end.
GRACE_S = 2
MAX_CONNECTIONS = 256
# Characters of the name under which a page asks for its place in the queue.
MAX_NAME = 64
LOOPBACK = ('localhost', '127.0.0.1', '[::1]')
# Addresses that stand for every address of the machine.
EVERY_ADDRESS = ('0.0.0.0', '::')  # noqa: S104 - only compared with
HEADERS = {
    'content-security-policy': "default-src 'self'; img-src 'self' data: blob:; object-src "
    "'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    'x-content-type-options': 'nosniff',
    'referrer-policy': 'no-referrer',
    'cross-origin-resource-policy': 'same-origin',
    'cache-control': 'no-cache',
}
# The name or the address in a Host header, and its port.
HOST = re.compile(r'(\[[^\]]*\]|[^:]*)(:[0-9]+)?')


class PlayApp(Starlette):
    """The page's routes on some maps."""

    def __init__(self, maps: Maps, feed: LiveFeed | None = None) -> None:
        """Serve these maps, and what a running graph feeds, if there is one."""
        self._maps = maps
        self._feed = feed
        self._service = PlanningService()
        self._worker = Worker()
        routes = [
            Route('/', self.index), Route('/api/options', self.options),
            Route('/api/map', self.map), Route('/api/map', self.drop_map, methods=['POST']),
            Route('/api/plan', self.plan, methods=['POST']), Route('/api/queue', self.queue),
            Route('/api/live', self.live), Mount('/page', StaticFiles(directory=PAGE)),
        ]  # fmt: skip
        handlers: dict[Any, Any] = dict.fromkeys((LlmAstarError, HTTPException), refuse)
        super().__init__(routes=routes, exception_handlers=handlers)

    def close(self) -> None:
        """Stop what is running and end the streams, before the server ends."""
        self._worker.close()
        if self._feed is not None:
            self._feed.close()

    async def index(self, _request: Request) -> Response:
        """Send the page."""
        return FileResponse(PAGE / 'index.html')

    async def options(self, _request: Request) -> Response:
        """Send what there is to choose from."""
        return JSONResponse(options_json(self._maps, live=self._feed is not None))

    async def map(self, request: Request) -> Response:
        """Send a map."""
        return JSONResponse(map_json(self._maps.get(request.query_params.get('id', ''))))

    async def drop_map(self, request: Request) -> Response:
        """Take a dropped map, {file name: its contents in base64}, and send its id."""
        files = await read_body(request, MAX_DROPPED_BODY)
        return JSONResponse((await asyncio.to_thread(self._maps.drop, files)).id)

    async def plan(self, request: Request) -> Response:
        """Plan, and send the plans; stop when the page has asked anew or is gone."""
        asked = read_request(await read_body(request, MAX_BODY), self._maps)
        gone = asyncio.create_task(wait_until_gone(request))
        address = request.client.host if request.client else ''
        name = request.headers.get('x-page', '')[:MAX_NAME]
        try:
            reply = await self._worker.run(partial(self.work, asked), gone, address, name)
        finally:
            gone.cancel()
        return Response(reply, media_type='application/json')

    async def queue(self, request: Request) -> Response:
        """Send how many plans run and wait, and the place of the page's own by its name."""
        return JSONResponse(self._worker.queue(request.query_params.get('page', '')[:MAX_NAME]))

    async def live(self, _request: Request) -> Response:
        """Send what a running graph shows, as server-sent events."""
        if self._feed is None:
            raise PlayError('no graph is shown; start `llm-astar play --live`', status=404)
        return StreamingResponse(self._feed.follow(), media_type='text/event-stream')

    def work(self, asked: PlayRequest, stop: StopFlag) -> bytes:
        """Return the answer to a request, as JSON."""
        planner, plans = self._service.plan(asked, stop)
        answer = self._service.answer(asked, planner, stop)
        return json.dumps(reply_json(asked, planner, plans, answer), allow_nan=False).encode()


async def read_body(request: Request, limit: int) -> object:
    """Return the JSON value in the body of a request. Raises PlayError."""
    declared = request.headers.get('content-length', '0')
    if not declared.isdecimal() or int(declared[:20]) > limit:
        raise PlayError(TOO_LONG.format(limit), status=413)
    try:
        body = await asyncio.wait_for(received(request, limit), BODY_S)
        value: object = json.loads(body, parse_constant=refuse_constant)
        is_too_deep = depth_of(value) > MAX_DEPTH
    except asyncio.TimeoutError:
        raise PlayError(f'the body did not arrive within {BODY_S:g} s', status=408) from None
    except RecursionError:
        is_too_deep = True
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise PlayError(f'the body is not JSON: {error}', status=400) from None
    if is_too_deep:
        raise PlayError('the body is nested too deeply for a plan; send less', status=400)
    return value


async def received(request: Request, limit: int) -> bytes:
    """Return a body of at most `limit` bytes. Raises PlayError."""
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > limit:
            raise PlayError(TOO_LONG.format(limit), status=413)
    return bytes(body)


def depth_of(value: object) -> int:
    """Return how deeply a JSON value is nested: 1 for a number, 2 for a list of numbers."""
    if not isinstance(value, (dict, list)):
        return 1
    return 1 + max(map(depth_of, value.values() if isinstance(value, dict) else value), default=0)


def refuse_constant(name: str) -> NoReturn:
    """Raise PlayError for NaN and infinities, which JSON does not have."""
    raise PlayError(f'the body is not JSON: {name} is not a number', status=400)


async def wait_until_gone(request: Request) -> None:
    """Return when the client has closed the connection."""
    while (await request.receive())['type'] != 'http.disconnect':
        pass


def error_response(sentence: str, field: str, status: int) -> Response:
    """Return the JSON of an error."""
    return JSONResponse({'error': sentence[:MAX_SENTENCE], 'field': field}, status)


async def refuse(request: Request, error: Exception) -> Response:
    """Say why a request is not served: what is wrong with it, or that there is no such page."""
    if isinstance(error, HTTPException):
        words = {404: 'there is no such page', 405: f'{request.method} is not allowed'}
        return error_response(words.get(error.status_code, str(error)), '', error.status_code)
    field, status = getattr(error, 'field', ''), getattr(error, 'status', 422)
    return error_response(str(error), field, status)


class Guard:
    """Answers requests of other sites with an error, and adds headers to every response.

    A page of another site can send requests to a server on loopback. Its name for the server
    (DNS rebinding) is in the Host header, itself in Origin, and without asking first it can only
    send forms, whose Content-Type is not JSON.
    """

    def __init__(self, app: ASGIApp, host: str = '127.0.0.1') -> None:
        """Guard an application that is served at an address."""
        self._app = app
        self._any_address = host in EVERY_ADDRESS
        # By which a server at this address is reached.
        self._names = {*LOOPBACK, host.lower(), f'[{host.lower()}]'}
        self._names |= {socket.gethostname().lower()} if self._any_address else set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope['type'] != 'http':
            return await self._app(scope, receive, send)

        async def send_guarded(message: Message) -> None:
            if message['type'] == 'http.response.start':
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                if message['status'] >= 400:
                    # What is left of a body is not waited for.
                    headers['connection'] = 'close'
            await send(message)

        problem = self.problem(scope['method'], Headers(scope=scope))
        answer = self._app if problem is None else error_response(problem[1], '', problem[0])
        return await answer(scope, receive, send_guarded)

    def problem(self, method: str, headers: Headers) -> tuple[int, str] | None:
        """Return with which status and sentence a request is refused, None if it is not."""
        host = headers.getlist('host')
        if len(host) != 1 or not self.knows(host[0]):
            fix = 'open it as localhost, or name the host with --host'
            named = ', '.join(host)[:80] or 'none'
            return 421, f'Host: {named} is not a name of this server; {fix}'
        origin = headers.get('origin')
        if origin is not None and origin.lower() != f'http://{host[0].lower()}':
            return 403, f'Origin: {origin[:80]} is another site; open the page of this server'
        # Pictures and scripts are asked for without an Origin; a link may be followed.
        site, mode = headers.get('sec-fetch-site', 'none'), headers.get('sec-fetch-mode')
        if site not in ('none', 'same-origin') and mode != 'navigate':
            return 403, 'Sec-Fetch-Site: is another site; open the page of this server'
        kind = headers.get('content-type', '').partition(';')[0].strip().lower()
        if method not in ('GET', 'HEAD') and kind != 'application/json':
            return 415, 'Content-Type: is not application/json; send JSON'
        return None

    def knows(self, host: str) -> bool:
        """Tell whether a Host header names this server; the port does not matter."""
        match = HOST.fullmatch(host.strip().lower())
        name = match[1].rstrip('.') if match else ''
        return name in self._names or (self._any_address and is_address(name))


def is_address(name: str) -> bool:
    """Tell whether a name is an IP address: no name server can make another site's of it."""
    with contextlib.suppress(ValueError):
        return bool(ipaddress.ip_address(name.strip('[]')))
    return False


class PlayServer(uvicorn.Server):
    """A server that ends what its application does when it is told to end."""

    def __init__(self, app: PlayApp, host: str) -> None:
        """Serve an application at an address."""
        self._app = app
        # Connections that wait for a request after their last one, since when.
        self._idle: dict[tuple[Any, Any], float] = {}
        silent: dict[str, Any] = {'log_level': 'warning', 'access_log': False}
        silent |= {'server_header': False, 'timeout_graceful_shutdown': GRACE_S}
        super().__init__(uvicorn.Config(Guard(app, host), **silent))

    async def on_tick(self, counter: int) -> bool:
        """Close connections on which no whole head of a request came in HEAD_S.

        Of more than MAX_CONNECTIONS those that have waited for longest make way, so half-open
        connections keep nobody out. Called ten times a second.
        """
        now, before = time.monotonic(), self._idle
        ends = [(one, getattr(one, 'cycle', None)) for one in self.server_state.connections]
        idle = [end for end in ends if end[1] is None or end[1].response_complete]
        self._idle = {end: before.get(end, now) for end in idle}
        oldest = sorted(self._idle.items(), key=lambda item: item[1])
        for place, ((connection, _), since) in enumerate(oldest):
            if now - since > HEAD_S or place < len(ends) - MAX_CONNECTIONS:
                connection.transport.close()
        return await super().on_tick(counter)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End, after Ctrl-C or SIGTERM."""
        self._app.close()
        super().handle_exit(sig, frame)


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens. Raises ParameterError, which names the fix."""
    if not 0 <= port <= 65535:
        raise ParameterError(f'--port {port}: is not in 0 to 65535')
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server((str(address[0]), port), family=family)
    except (OSError, UnicodeError) as error:
        number = error.errno if isinstance(error, OSError) else None
        if number == errno.EADDRINUSE:
            fix = 'is in use, perhaps by another `llm-astar play`; choose another, or 0 for any'
            raise ParameterError(f'--port {port}: {fix}') from None
        if number in (errno.EACCES, errno.EPERM):
            raise ParameterError(f'--port {port}: needs root; choose one above 1023') from None
        reason = getattr(error, 'strerror', None) or error
        message = f'--host {host}: {reason}; name an address of this machine, such as 127.0.0.1'
        raise ParameterError(message) from None


def url_of(host: str, port: int) -> str:
    """Return the address of the page for a browser on this machine."""
    name = 'localhost' if host in EVERY_ADDRESS else host
    return f'http://[{name}]:{port}/' if ':' in name else f'http://{name}:{port}/'


def serve(app: PlayApp, host: str, listener: socket.socket) -> None:
    """Serve an application at the socket of an address, until Ctrl-C or SIGTERM."""
    with contextlib.suppress(KeyboardInterrupt):  # which the server passes on after its end
        PlayServer(app, host).run(sockets=[listener])
