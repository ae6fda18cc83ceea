"""One thread that plans, one request after the other."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from llm_astar_planner.search.stop import StopFlag, no_stop

from llm_astar_lab.play.errors import PlayError

# Requests that may wait for their turn.
MAX_WAITING = 8
_T = TypeVar('_T')


class Worker:
    """Runs one job at a time on a thread of its own, and stops jobs that nobody waits for."""

    def __init__(self) -> None:
        """Start idle."""
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix='plan')
        self._stops: dict[int, StopFlag] = {}

    async def run(self, job: Callable[[StopFlag], _T], gone: asyncio.Task[None]) -> _T:
        """Return what a job returns; the flag that it gets is raised once `gone` is done.

        Raises PlayError where too many jobs wait (503) and where the job was stopped (499), and
        what the job raises.
        """
        if len(self._stops) > MAX_WAITING:
            raise PlayError('other plans are being made; ask again in a moment', status=503)
        stop = no_stop()
        self._stops[id(stop)] = stop
        future = self._threads.submit(job, stop)
        try:
            waiting = asyncio.wrap_future(future)
            both: set[asyncio.Future[Any]] = {waiting, gone}
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            if waiting.done():
                return waiting.result()
            raise PlayError('the page has asked anew', status=499)
        finally:
            stop[0] = 1
            future.cancel()
            del self._stops[id(stop)]

    def close(self) -> None:
        """Stop what is running, drop what waits, and end the thread."""
        for stop in self._stops.values():
            stop[0] = 1
        self._threads.shutdown(wait=False, cancel_futures=True)
