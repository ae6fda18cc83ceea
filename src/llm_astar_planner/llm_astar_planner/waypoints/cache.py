"""A cache of answers: a planner that asks again gets the answer it had, and pays once."""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from dataclasses import replace
from typing import NamedTuple

from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

_LOG = logging.getLogger(__name__)
# Questions that may be under way at a time; the endpoint itself takes fewer in turns.
MAX_PENDING = 16
# An answer, even one without a route, is kept; a failure is asked again.
_KEPT = (SourceStatus.OK, SourceStatus.NO_WAYPOINTS, SourceStatus.MALFORMED)


class _Key(NamedTuple):
    digest: str
    start: tuple[int, int]
    goal: tuple[int, int]
    sample: SampleKey | None
    model: str
    prompt: str
    instruction: str


class _Pending:
    """A question under way; whoever asks the same waits for the same answer."""

    def __init__(self) -> None:
        self.done = threading.Event()
        self.reply = WaypointReply(status=SourceStatus.ERROR)


class CachedSource:
    """Answers from memory where it can; asks `inner` once where several ask the same.

    The question goes on in the background when a caller's time is up, as long as `inner` lets it,
    and its late answer lands in the cache. Keyed by map digest, start, goal, model, prompt and
    wish; the least recently used of more than `size` answers is dropped. Thread-safe.
    """

    def __init__(
        self,
        inner: WaypointSource,
        *,
        model: str = '',
        prompt: str = '',
        size: int = 256,
        timeout_s: float = 4.0,
    ) -> None:
        """Wrap `inner`, which is asked by `model` with `prompt` (a name or a digest)."""
        self.inner = inner
        self._model = model
        self._prompt = prompt
        self._size = size
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._replies: OrderedDict[_Key, WaypointReply] = OrderedDict()
        self._pending: dict[_Key, _Pending] = {}

    @property
    def name(self) -> str:
        """The name of the source inside."""
        return self.inner.name

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the answer in memory, else wait for it, `timeout_s` or the query's time limit."""
        started = time.monotonic()
        query = replace(query, time_limit=min(self._timeout_s, query.time_limit))
        key = self._key(query)
        with self._lock:
            kept = self._replies.get(key)
            if kept is not None:
                self._replies.move_to_end(key)
                return _from_cache(kept)
            pending = self._pending.get(key)
            if pending is None:
                if len(self._pending) >= MAX_PENDING:
                    return self._failure(
                        SourceStatus.REFUSED, f'{MAX_PENDING} questions are under way', started
                    )
                pending = self._pending[key] = _Pending()
                threading.Thread(
                    target=self._ask, args=(key, query, pending), name='waypoints', daemon=True
                ).start()
        if pending.done.wait(max(0.0, query.time_limit)):
            return pending.reply
        detail = f'no answer within {query.time_limit:.1f} s; a late one is kept for the next time'
        return self._failure(SourceStatus.TIMEOUT, detail, started)

    def _ask(self, key: _Key, query: WaypointQuery, pending: _Pending) -> None:
        """Ask `inner`, in a thread of its own."""
        try:
            pending.reply = self.inner.waypoints(query)
        except Exception as error:  # noqa: BLE001 - its callers must not be left waiting
            _LOG.exception('the waypoint source failed')
            detail = f'{type(error).__name__} in the source'
            pending.reply = self._failure(SourceStatus.ERROR, detail, time.monotonic())
        finally:
            with self._lock:
                if pending.reply.status in _KEPT:
                    self._replies[key] = pending.reply
                    while len(self._replies) > self._size:
                        self._replies.popitem(last=False)
                del self._pending[key]
            pending.done.set()

    def _key(self, query: WaypointQuery) -> _Key:
        return _Key(
            query.grid_map.digest,
            query.start,
            query.goal,
            query.sample,
            self._model,
            self._prompt,
            query.instruction,
        )

    def _failure(self, status: SourceStatus, detail: str, started: float) -> WaypointReply:
        return WaypointReply(
            label=f'{self.name}:{self._model}',
            status=status,
            detail=detail,
            model=self._model,
            prompt=self._prompt,
            seconds=time.monotonic() - started,
        )


def _from_cache(reply: WaypointReply) -> WaypointReply:
    """Return a kept answer as one that cost nothing."""
    detail = '; '.join(part for part in ('from the cache', reply.detail) if part)
    return replace(reply, detail=detail, prompt_tokens=0, completion_tokens=0, seconds=0.0)
