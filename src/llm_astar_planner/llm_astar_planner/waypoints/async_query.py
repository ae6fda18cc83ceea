"""Ask a waypoint source so that nothing it does can stop or hold up a plan."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.stop import POLL_PERIOD_S
from llm_astar_planner.waypoints.instruction_outcome import with_outcome
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

# A source that keeps its time limit answers then, and with a better reason than ours: wait for it
# so many seconds longer, or this part of the limit.
GRACE_SECONDS, GRACE_SHARE = 0.05, 0.1
# More waypoints than any route needs; to judge any number of them would take any time.
MAX_WAYPOINTS = 1000


def ask(
    source: WaypointSource, query: WaypointQuery, stop: NDArray[np.uint8] | None = None
) -> tuple[WaypointReply, float]:
    """Return a source's reply and the seconds it took; what it raises becomes an ERROR.

    A source that outlasts the query's time limit, or its caller's `stop[0] = 1`, is left behind
    and its reply is a TIMEOUT. Of its waypoints the first 1000 are taken, and the detail says so
    where there were more. The reply to a wish says what became of it, whatever the source says.
    """
    begin = time.monotonic()
    asking = WaypointQueryTask(source, query, lambda _: None)
    grace = min(GRACE_SECONDS, GRACE_SHARE * query.time_limit)
    answered = asking.wait(query.time_limit + grace, stop)
    reply, seconds = asking.close(source.name)
    if answered:
        return reply, seconds
    seconds = time.monotonic() - begin
    detail = f'{source.name} had not answered after {seconds:.2f} s'
    reply = WaypointReply(status=SourceStatus.TIMEOUT, detail=detail)
    return with_outcome(reply, query, source.name), seconds


class WaypointQueryTask:
    """A source asked on a thread of its own, while the search is already under way.

    Its reply counts if it comes before `close`; what comes later is nobody's, but a source that
    keeps a cache keeps it for the next time.
    """

    def __init__(
        self,
        source: WaypointSource,
        query: WaypointQuery,
        then: Callable[[WaypointReply], None],
    ) -> None:
        """Ask; `then` gets the reply on the asking thread, if it comes in time."""
        self._then = then
        self._lock = threading.Lock()
        self._closed = False
        self._done = threading.Event()
        self._answer: tuple[WaypointReply, float] | None = None
        self._thread = threading.Thread(
            target=self._run, args=(source, query), name='waypoints', daemon=True
        )
        self._thread.start()

    def _run(self, source: WaypointSource, query: WaypointQuery) -> None:
        answer = _asked(source, query)
        with self._lock:
            if not self._closed:
                self._answer = answer
                self._then(answer[0])
        self._done.set()

    def wait(self, seconds: float, stop: NDArray[np.uint8] | None = None) -> bool:
        """Wait for the reply, so many seconds or until `stop[0]`; tell whether it came."""
        deadline = time.monotonic() + seconds
        while not self._done.wait(min(POLL_PERIOD_S, max(0.0, deadline - time.monotonic()))):
            if time.monotonic() >= deadline or (stop is not None and stop[0]):
                return self._done.is_set()
        return True

    def close(self, source_name: str) -> tuple[WaypointReply, float]:
        """Return the reply that came in time, else a LATE one, and the seconds waited so far."""
        with self._lock:
            self._closed = True
            if self._answer is not None:
                return self._answer
        detail = f'the search was done before {source_name} answered'
        return WaypointReply(status=SourceStatus.LATE, detail=detail), 0.0


def _asked(source: WaypointSource, query: WaypointQuery) -> tuple[WaypointReply, float]:
    begin = time.monotonic()
    try:
        reply = _bounded(source.waypoints(query))
    except Exception as error:  # noqa: BLE001 - no source may ever stop a plan
        detail = f'{type(error).__name__} in source {source.name}'
        reply = WaypointReply(status=SourceStatus.ERROR, detail=detail)
    return with_outcome(reply, query, source.name), time.monotonic() - begin


def _bounded(reply: WaypointReply) -> WaypointReply:
    count = len(reply.waypoints)
    if count <= MAX_WAYPOINTS:
        return reply
    cut = f'only the first {MAX_WAYPOINTS} of {count} waypoints are taken'
    detail = f'{reply.detail}; {cut}' if reply.detail else cut
    return replace(reply, waypoints=reply.waypoints[:MAX_WAYPOINTS], detail=detail)
