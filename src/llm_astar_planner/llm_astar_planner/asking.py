"""Ask a waypoint source so that nothing it does can stop a plan."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from llm_astar_planner.waypoint_source.base import (
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)
from llm_astar_planner.waypoint_source.wish import with_outcome


def ask(source: WaypointSource, query: WaypointQuery) -> tuple[WaypointReply, float]:
    """Return a source's reply and the seconds it took; what it raises becomes an ERROR.

    The reply to a wish says what became of it, whatever the source says.
    """
    begin = time.monotonic()
    try:
        reply = source.waypoints(query)
    except Exception as error:  # noqa: BLE001 - no source may ever stop a plan
        detail = f'{type(error).__name__} in source {source.name}'
        reply = WaypointReply(status=SourceStatus.ERROR, detail=detail)
    return with_outcome(reply, query, source.name), time.monotonic() - begin


class Asking:
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
        self._begin = time.monotonic()
        self._answer: tuple[WaypointReply, float] | None = None
        self._thread = threading.Thread(
            target=self._run, args=(source, query), name='waypoints', daemon=True
        )
        self._thread.start()

    def _run(self, source: WaypointSource, query: WaypointQuery) -> None:
        answer = ask(source, query)
        with self._lock:
            if not self._closed:
                self._answer = answer
                self._then(answer[0])

    def close(self, source_name: str) -> tuple[WaypointReply, float]:
        """Return the reply that came in time, else a LATE one, and the seconds waited so far."""
        with self._lock:
            self._closed = True
            if self._answer is not None:
                return self._answer
        detail = f'the search was done before {source_name} answered'
        return WaypointReply(status=SourceStatus.LATE, detail=detail), 0.0
