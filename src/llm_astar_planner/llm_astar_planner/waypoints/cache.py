"""A cache of replies: a query that was answered before is answered from memory, at no cost."""

from __future__ import annotations

import threading
import time
from collections.abc import Hashable
from dataclasses import KW_ONLY, dataclass, replace

from cachetools import LRUCache

from llm_astar_planner.waypoints.async_query import QueryQueue, WaypointQueryTask
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

# Different queries that may run at a time; the endpoint's client lets fewer requests through.
MAX_PENDING = 16


@dataclass(eq=False)
class CachedSource:
    """Answers from memory where it can; queries `inner` once for identical concurrent queries.

    When a caller's time is up the query continues in the background, as long as `inner` lets it,
    and its late reply goes to the cache. Keyed by the costmap (map and rules), start, goal
    and sample; of more than `size` replies the least recently used is dropped.
    `model` and `prompt` label the replies of failures. Thread-safe.
    """

    inner: WaypointSource
    _: KW_ONLY
    model: str = ''
    prompt: str = ''
    size: int = 256
    timeout_s: float = 4.0

    def __post_init__(self) -> None:
        """Start with an empty cache and no running query."""
        # Reentrant: a query that the queue refuses is answered on the thread that puts it there.
        self._lock = threading.RLock()
        self._queue = QueryQueue(MAX_PENDING, MAX_PENDING, MAX_PENDING)
        self._replies: LRUCache[Hashable, WaypointReply] = LRUCache(self.size)
        self._running: dict[Hashable, WaypointQueryTask] = {}

    @property
    def name(self) -> str:
        """The name of the wrapped source."""
        return self.inner.name

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the reply in memory, else wait up to `timeout_s` or the query's time limit."""
        started = time.monotonic()
        query = replace(query, time_limit=min(self.timeout_s, query.time_limit))
        key = (query.costmap.key, query.start, query.goal, query.sample)
        with self._lock:
            kept = self._replies.get(key)
            if kept is not None:
                return as_cached(kept)
            task = self._running.get(key)
            if task is None:
                if len(self._running) >= MAX_PENDING:
                    return self._failure(
                        SourceStatus.REFUSED, f'{MAX_PENDING} queries are running', started
                    )
                task = self._running[key] = WaypointQueryTask(
                    self.inner, query, lambda reply: self._store(key, reply), self._queue
                )
                if task.reply is not None:
                    del self._running[key]
        task.wait(query.time_limit, query.stop)
        if task.reply is not None:
            return task.reply
        detail = f'no answer within {query.time_limit:.1f} s; a late one is kept for the next time'
        return self._failure(SourceStatus.TIMEOUT, detail, started)

    def _store(self, key: Hashable, reply: WaypointReply) -> None:
        with self._lock:
            # A reply without a route is kept too; after a failure the source is asked again.
            if reply.status.is_answer:
                self._replies[key] = reply
            self._running.pop(key, None)

    def _failure(self, status: SourceStatus, detail: str, started: float) -> WaypointReply:
        return WaypointReply(
            label=f'{self.name}:{self.model}',
            status=status,
            detail=detail,
            model=self.model,
            prompt=self.prompt,
            seconds=time.monotonic() - started,
        )


def as_cached(reply: WaypointReply) -> WaypointReply:
    """Return a reply from memory: no tokens, no time."""
    detail = '; '.join(part for part in ('from the cache', reply.detail) if part)
    return replace(reply, detail=detail, prompt_tokens=0, completion_tokens=0, seconds=0.0)
