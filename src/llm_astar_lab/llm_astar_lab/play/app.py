"""The web application behind the page: its routes, and the limits on what they take."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any, NoReturn

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_planner.search.stop import StopFlag
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from llm_astar_lab.play.encoding import map_json, options_json, reply_json
from llm_astar_lab.play.live import LiveFeed
from llm_astar_lab.play.maps import Maps, PlayError
from llm_astar_lab.play.planning import PlanningService, Worker
from llm_astar_lab.play.request import PlayRequest, read_request

PAGE = Path(__file__).parent / 'page'
MAX_BODY = 2**20
TOO_LONG = f'the body is over {MAX_BODY} bytes; edit fewer walls'
# A request holds walls, these cells, and these numbers.
MAX_DEPTH = 5
# Seconds in which a body has to arrive.
BODY_S = 10.0
# Characters of a sentence about foreign text.
MAX_SENTENCE = 400


class PlayApp:
    """The page's routes on some maps."""

    def __init__(self, maps: Maps, feed: LiveFeed | None = None) -> None:
        """Serve these maps, and what a running graph feeds, if there is one."""
        self._maps = maps
        self._feed = feed
        self._service = PlanningService()
        self._worker = Worker()

    def asgi(self) -> Starlette:
        """Return the application."""
        return Starlette(
            routes=[
                Route('/', self.index),
                Route('/api/options', self.options),
                Route('/api/map', self.map),
                Route('/api/plan', self.plan, methods=['POST']),
                Route('/api/live', self.live),
                Mount('/page', StaticFiles(directory=PAGE)),
            ],
            exception_handlers={LlmAstarError: refuse, HTTPException: refuse_route},
        )

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

    async def plan(self, request: Request) -> Response:
        """Plan, and send the plans; stop when the page has asked anew or is gone."""
        asked = read_request(await read_body(request), self._maps)
        gone = asyncio.create_task(wait_until_gone(request))
        try:
            reply = await self._worker.run(lambda stop: self.work(asked, stop), gone)
        finally:
            gone.cancel()
        return Response(reply, media_type='application/json')

    async def live(self, _request: Request) -> Response:
        """Send what a running graph shows, as server-sent events."""
        if self._feed is None:
            raise PlayError('no graph is shown; start `llm-astar play --live`', status=404)
        return StreamingResponse(self._feed.follow(), media_type='text/event-stream')

    def work(self, asked: PlayRequest, stop: StopFlag) -> bytes:
        """Return the answer to a request, as JSON."""
        planner, plans = self._service.plan(asked, stop)
        return json.dumps(reply_json(asked, planner, plans), allow_nan=False).encode()


async def read_body(request: Request) -> object:
    """Return the JSON value in the body of a request. Raises PlayError."""
    declared = request.headers.get('content-length', '0')
    if not declared.isdecimal() or int(declared[:20]) > MAX_BODY:
        raise PlayError(TOO_LONG, status=413)
    try:
        body = await asyncio.wait_for(received(request), BODY_S)
    except asyncio.TimeoutError:
        raise PlayError(f'the body did not arrive within {BODY_S:g} s', status=408) from None
    try:
        value: object = json.loads(body, parse_constant=refuse_constant)
        is_too_deep = depth_of(value) > MAX_DEPTH
    except RecursionError:
        is_too_deep = True
    except ValueError as error:
        raise PlayError(f'the body is not JSON: {error}', status=400) from None
    if is_too_deep:
        raise PlayError('the body is nested too deeply for a plan; send less', status=400)
    return value


async def received(request: Request) -> bytes:
    """Return a body of at most MAX_BODY bytes. Raises PlayError."""
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_BODY:
            raise PlayError(TOO_LONG, status=413)
    return bytes(body)


def depth_of(value: object) -> int:
    """Return how deeply a JSON value is nested: 1 for a number, 2 for a list of numbers."""
    if not isinstance(value, (dict, list)):
        return 1
    return 1 + max(map(depth_of, value.values() if isinstance(value, dict) else value), default=0)


def refuse_constant(name: str) -> NoReturn:
    """Raise ValueError for NaN and infinities, which JSON does not have."""
    raise ValueError(f'{name} is not a number')


async def wait_until_gone(request: Request) -> None:
    """Return when the client has closed the connection."""
    while (await request.receive())['type'] != 'http.disconnect':
        pass


def error_response(sentence: str, field: str, status: int) -> Response:
    """Return the JSON of an error."""
    return JSONResponse({'error': sentence[:MAX_SENTENCE], 'field': field}, status)


async def refuse(_request: Request, error: Exception) -> Response:
    """Say why a request is not served."""
    if isinstance(error, PlayError):
        return error_response(str(error), error.field, error.status)
    return error_response(str(error), '', 422)


async def refuse_route(request: Request, error: Exception) -> Response:
    """Say that there is no such page, or no such method."""
    status = error.status_code if isinstance(error, HTTPException) else 404
    words: dict[int, Any] = {404: 'there is no such page', 405: f'{request.method} is not allowed'}
    return error_response(words.get(status, str(error)), '', status)
