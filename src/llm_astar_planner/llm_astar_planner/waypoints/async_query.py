# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Query waypoint sources on threads of their own, so that nothing they do can stop a plan.

The threads are bounded: what waits for one is answered newest first, and what nobody waits for
any more is dropped.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import InitVar, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from llm_astar_planner.plugins import PluginError
from llm_astar_planner.search.arrays import POLL_PERIOD_S, StopFlag
from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

if TYPE_CHECKING:
    from llm_astar_planner.costmap.costmap import Costmap

_LOG = logging.getLogger(__name__)
# A source that keeps its time limit replies at that time, and with a more exact reason than ours:
# wait for it this many seconds longer, or this share of the limit.
GRACE_SECONDS, GRACE_SHARE = 0.05, 0.1
# A thread without a query ends after so many seconds.
IDLE_SECONDS = 5.0
NEWER_CAME = 'not asked, since newer queries came'
TOO_LATE = 'not asked: its time was over before its turn'


def query_source(
    source: sources.WaypointSource, query: WaypointQuery, stop: StopFlag | None = None
) -> tuple[WaypointReply, float]:
    """Query a source; return its reply and the seconds it took.

    An exception becomes an ERROR reply, and so does what is no WaypointReply of plain values.
    Where the source exceeds the query's time limit, or `stop[0]` becomes 1, the reply is a TIMEOUT
    and the source's own is dropped. Only the first 1000 waypoints are kept.
    """
    return start_query(source, query, lambda _: None).result(stop)


@dataclass(eq=False)
class QueryTask:
    """A query to the source `name`, put into a QueryQueue at once.

    `ask` is called on a thread of the queue, unless `time_limit` seconds have passed before; its
    flag is raised when nobody waits any more. `on_reply` gets a reply that comes before `close`,
    usually on that thread; a later one is dropped.
    """

    name: str
    ask: Callable[[StopFlag], WaypointReply]
    time_limit: float
    on_reply: Callable[[WaypointReply], None]
    queue: InitVar[QueryQueue | None]

    def __post_init__(self, queue: QueryQueue | None) -> None:
        """Put the query into the queue; without one, ask now."""
        self._begin = time.monotonic()
        self.deadline = self._begin + self.time_limit
        self._stop: StopFlag = np.zeros(1, dtype=np.uint8)
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._answer: tuple[WaypointReply, float] | None = None
        if queue is None:
            self.run()
        else:
            queue.put(self)

    @property
    def reply(self) -> WaypointReply | None:
        """The reply, None as long as there is none."""
        return self._answer[0] if self._answer else None

    def run(self) -> None:
        """Ask now, if the answer is still wanted; never raises."""
        if self._stop[0] or time.monotonic() >= self.deadline:
            self.finish(WaypointReply(status=SourceStatus.TIMEOUT, detail=TOO_LATE))
            return
        try:
            reply = sources.checked_reply(self.ask(self._stop))
        except BaseException as error:  # noqa: BLE001 - no source may ever stop a plan or a thread
            _LOG.exception('the waypoint source failed')
            detail = f'{type(error).__name__} in source {self.name}'
            if isinstance(error, PluginError):
                detail = f'source {self.name}: {error}'
            reply = WaypointReply(status=SourceStatus.ERROR, detail=detail)
        self.finish(reply)

    def finish(self, reply: WaypointReply) -> None:
        """Take the reply, unless there is one already or nobody waits for it any more."""
        with self._lock:
            if self._answer is None and not self._stop[0]:
                self._answer = reply, time.monotonic() - self._begin
                self.on_reply(reply)
        self._done.set()

    def wait(self, seconds: float, stop: StopFlag | None = None) -> bool:
        """Wait for the reply until `seconds` have passed or `stop[0]` is 1; True if it came."""
        deadline = time.monotonic() + seconds
        while not self._done.wait(min(POLL_PERIOD_S, max(0.0, deadline - time.monotonic()))):
            if time.monotonic() >= deadline or (stop is not None and stop[0]):
                return self._done.is_set()
        return True

    def result(self, stop: StopFlag | None = None) -> tuple[WaypointReply, float]:
        """Wait for the reply, and return it with the seconds it took.

        It is a TIMEOUT when the time limit has passed, or `stop[0]` becomes 1.
        """
        grace = min(GRACE_SECONDS, GRACE_SHARE * self.time_limit)
        answered = self.wait(self.time_limit + grace, stop)
        reply, seconds = self.close()
        if answered:
            return reply, seconds
        seconds = time.monotonic() - self._begin
        detail = f'{self.name} had not answered after {seconds:.2f} s'
        return WaypointReply(status=SourceStatus.TIMEOUT, detail=detail), seconds

    def close(self) -> tuple[WaypointReply, float]:
        """Return the reply and the seconds it took; a LATE reply where it has not come yet."""
        with self._lock:
            self._stop[0] = 1
            if self._answer is not None:
                return self._answer
        detail = f'the search was done before {self.name} answered'
        return WaypointReply(status=SourceStatus.LATE, detail=detail), 0.0


class QueryQueue:
    """Threads that run queries, the newest first. Thread-safe.

    At most `at_a_time` queries run that are within their time limit. One that has exceeded it
    keeps its thread until it returns, and another takes its place, up to `threads` in all; where
    all of them are late, queries are refused. Of more than `waiting` queries that wait, the
    oldest is refused. Threads are started as needed and end when they have nothing to do.
    """

    def __init__(self, at_a_time: int, threads: int, waiting: int) -> None:
        """Start without a thread."""
        self._at_a_time = at_a_time
        self._most_threads = threads
        self._most_waiting = waiting
        self._changed = threading.Condition()
        self._waiting: deque[QueryTask] = deque()
        # Each with its deadline.
        self._running: dict[QueryTask, float] = {}
        self._idle = self._threads = 0

    def put(self, task: QueryTask) -> None:
        """Have a query run on one of the threads, or refuse it or the oldest that waits."""
        refused, reason = None, NEWER_CAME
        with self._changed:
            now = time.monotonic()
            free = self._at_a_time - sum(map(now.__lt__, self._running.values()))
            if free == self._at_a_time and len(self._running) == self._most_threads:
                refused, reason = task, f'{len(self._running)} queries have not come back yet'
            else:
                self._waiting.append(task)
                if len(self._waiting) > self._most_waiting + max(0, free):
                    refused = self._waiting.popleft()
                needed = max(1, min(len(self._waiting), free))
                if self._idle < needed and self._threads < self._most_threads:
                    self._threads += 1
                    threading.Thread(target=self.work, name='waypoints', daemon=True).start()
                self._changed.notify()
        # Not under the lock: a callback may put another query.
        if refused is not None:
            refused.finish(WaypointReply(status=SourceStatus.REFUSED, detail=reason))

    def work(self) -> None:
        """Run queries until there are none for a while."""
        while True:
            task = self.take()
            if task is None:
                return
            task.run()
            with self._changed:
                self._running.pop(task, None)
            # A thread that waits must not keep a map alive.
            del task

    def take(self) -> QueryTask | None:
        """Wait for the newest query; None where none comes, and the thread is to end."""
        task: QueryTask | None = None
        with self._changed:
            self._idle += 1
            while True:
                now = time.monotonic()
                ends = [end for end in self._running.values() if end > now]
                if self._waiting and len(ends) < self._at_a_time:
                    task = self._waiting.pop()
                    self._running[task] = task.deadline
                    break
                # One that runs may exceed its time limit meanwhile, and free its place.
                patience = min(IDLE_SECONDS, min(ends) - now) if self._waiting else IDLE_SECONDS
                if not self._changed.wait(patience) and not self._waiting:
                    self._threads -= 1
                    break
            self._idle -= 1
            return task

    def close(self) -> None:
        """Answer all askers at once with a refusal; a query that runs is left alone."""
        with self._changed:
            tasks = [*self._waiting, *self._running]
            self._waiting.clear()
        for task in tasks:
            task.finish(WaypointReply(status=SourceStatus.REFUSED, detail='the queue was closed'))


# The queries of plans. Most sources only wait there, for a node or a server.
PLANS = QueryQueue(at_a_time=32, threads=64, waiting=32)


def start_query(
    source: sources.WaypointSource,
    query: WaypointQuery,
    on_reply: Callable[[WaypointReply], None],
    queue: QueryQueue = PLANS,
) -> QueryTask:
    """Start a query to a source, for example while the search is already running.

    `on_reply` gets a reply that comes before `close`. A source with a cache keeps a reply that
    comes too late all the same.
    """

    def ask(stop: StopFlag) -> WaypointReply:
        return source.waypoints(replace(query, stop=stop))

    is_ready = getattr(source, 'service_is_ready', None)
    asked_in = queue if is_ready is None or is_ready() else None
    return QueryTask(name_of(source), ask, query.time_limit, on_reply, asked_in)


def helps_on(source: sources.WaypointSource, costmap: Costmap) -> bool:
    """Tell whether a source is worth asking on a costmap: not where it says that it is not."""
    try:
        asked = getattr(source, 'helps_on', None)
        return asked is None or bool(asked(costmap))
    except Exception:  # noqa: BLE001 - of foreign code, which is asked and fails within its limits
        return True


def name_of(source: object) -> str:
    """Return a source's name; that of its type where it has none."""
    try:
        name = getattr(source, 'name', None)
    except Exception:  # noqa: BLE001 - of foreign code
        name = None
    return name if type(name) is str else type(source).__name__
