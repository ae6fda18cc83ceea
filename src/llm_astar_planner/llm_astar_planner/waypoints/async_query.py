"""Query a waypoint source on a thread, so that nothing it does can stop or delay a plan."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.stop import POLL_PERIOD_S
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

_LOG = logging.getLogger(__name__)
# A source that keeps its time limit replies at that time, and with a more exact reason than ours:
# wait for it this many seconds longer, or this share of the limit.
GRACE_SECONDS, GRACE_SHARE = 0.05, 0.1
# More waypoints than any route needs; checking an unlimited number would take unlimited time.
MAX_WAYPOINTS = 1000


def query_source(
    source: WaypointSource, query: WaypointQuery, stop: NDArray[np.uint8] | None = None
) -> tuple[WaypointReply, float]:
    """Query a source; return its reply and the seconds it took.

    An exception becomes an ERROR reply. Where the source exceeds the query's time limit, or
    `stop[0]` becomes 1, the reply is a TIMEOUT and the source's own is dropped. Only the first
    1000 waypoints are kept.
    """
    begin = time.monotonic()
    task = WaypointQueryTask(source, query, lambda _: None)
    grace = min(GRACE_SECONDS, GRACE_SHARE * query.time_limit)
    answered = task.wait(query.time_limit + grace, stop)
    reply, seconds = task.close()
    if answered:
        return reply, seconds
    seconds = time.monotonic() - begin
    detail = f'{source.name} had not answered after {seconds:.2f} s'
    return WaypointReply(status=SourceStatus.TIMEOUT, detail=detail), seconds


class WaypointQueryTask:
    """A query that runs on its own thread, for example while the search is already running.

    A reply that comes after `close` is dropped; a source with a cache keeps it all the same.
    """

    def __init__(
        self,
        source: WaypointSource,
        query: WaypointQuery,
        on_reply: Callable[[WaypointReply], None],
    ) -> None:
        """Start the query; `on_reply` gets a reply that comes before `close`, on the thread."""
        self._source_name = source.name
        self._on_reply = on_reply
        self._lock = threading.Lock()
        self._closed = False
        self._done = threading.Event()
        self._answer: tuple[WaypointReply, float] | None = None
        self._thread = threading.Thread(
            target=self._run, args=(source, query), name='waypoints', daemon=True
        )
        self._thread.start()

    def _run(self, source: WaypointSource, query: WaypointQuery) -> None:
        begin = time.monotonic()
        try:
            reply = limit_waypoints(source.waypoints(query))
        except Exception as error:  # noqa: BLE001 - no source may ever stop a plan
            _LOG.exception('the waypoint source failed')
            detail = f'{type(error).__name__} in source {source.name}'
            reply = WaypointReply(status=SourceStatus.ERROR, detail=detail)
        answer = reply, time.monotonic() - begin
        with self._lock:
            if not self._closed:
                self._answer = answer
                self._on_reply(answer[0])
        self._done.set()

    @property
    def reply(self) -> WaypointReply | None:
        """The reply, None as long as there is none."""
        return self._answer[0] if self._answer else None

    def wait(self, seconds: float, stop: NDArray[np.uint8] | None = None) -> bool:
        """Wait for the reply until `seconds` have passed or `stop[0]` is 1; True if it came."""
        deadline = time.monotonic() + seconds
        while not self._done.wait(min(POLL_PERIOD_S, max(0.0, deadline - time.monotonic()))):
            if time.monotonic() >= deadline or (stop is not None and stop[0]):
                return self._done.is_set()
        return True

    def close(self) -> tuple[WaypointReply, float]:
        """Return the reply and the seconds it took; a LATE reply where it has not come yet."""
        with self._lock:
            self._closed = True
            if self._answer is not None:
                return self._answer
        detail = f'the search was done before {self._source_name} answered'
        return WaypointReply(status=SourceStatus.LATE, detail=detail), 0.0


def limit_waypoints(reply: WaypointReply) -> WaypointReply:
    """Return the reply with at most MAX_WAYPOINTS waypoints; the detail says if some were cut."""
    count = len(reply.waypoints)
    if count <= MAX_WAYPOINTS:
        return reply
    cut = f'only the first {MAX_WAYPOINTS} of {count} waypoints are taken'
    detail = f'{reply.detail}; {cut}' if reply.detail else cut
    return replace(reply, waypoints=reply.waypoints[:MAX_WAYPOINTS], detail=detail)
