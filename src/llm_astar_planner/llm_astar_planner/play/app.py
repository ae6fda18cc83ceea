"""The web application behind the page: what it serves, and to whom."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from llm_astar_planner.play.encoding import map_json, options_json, reply_json
from llm_astar_planner.play.errors import PlayError
from llm_astar_planner.play.maps import Maps
from llm_astar_planner.play.planning import PlanningService
from llm_astar_planner.play.request import read_request

PAGE = Path(__file__).parent / 'page'
MAX_BODY = 2**20


class PlayApp:
    """The page's routes on some maps."""

    def __init__(self, maps: Maps, hosts: Iterable[str] = ()) -> None:
        """Serve these maps to requests that name one of the hosts."""
        self._maps = maps
        self._hosts = frozenset(hosts)
        self._service = PlanningService()
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix='plan')

    def asgi(self) -> Starlette:
        """Return the application."""
        return Starlette(
            routes=[
                Route('/', self.index),
                Route('/api/options', self.options),
                Route('/api/map', self.map),
                Route('/api/plan', self.plan, methods=['POST']),
                Mount('/page', StaticFiles(directory=PAGE)),
            ],
            exception_handlers={PlayError: refuse},
        )

    async def index(self, _request: Request) -> Response:
        """Send the page."""
        return FileResponse(PAGE / 'index.html')

    async def options(self, _request: Request) -> Response:
        """Send what there is to choose from."""
        return JSONResponse(options_json(self._maps, live=False))

    async def map(self, request: Request) -> Response:
        """Send a map."""
        return JSONResponse(map_json(self._maps.get(request.query_params.get('id', ''))))

    async def plan(self, request: Request) -> Response:
        """Plan, and send the plans."""
        body = await read_body(request)
        asked = read_request(body, self._maps)
        stop = np.zeros(1, dtype=np.uint8)

        def work() -> dict[str, Any]:
            planner = self._service.planner_for(asked)
            return reply_json(asked, planner, self._service.plan(asked, stop))

        loop = asyncio.get_running_loop()
        return JSONResponse(await loop.run_in_executor(self._threads, work))


async def read_body(request: Request) -> object:
    """Return the JSON value in the body of a request. Raises PlayError."""
    body = b''
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_BODY:
            raise PlayError(f'the body is over {MAX_BODY} bytes; send less', status=413)
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        raise PlayError('the body is not JSON', status=400) from None


async def refuse(_request: Request, error: Exception) -> Response:
    """Send why a request is not served."""
    status = error.status if isinstance(error, PlayError) else 400
    field = error.field if isinstance(error, PlayError) else ''
    return JSONResponse({'error': str(error), 'field': field}, status)
