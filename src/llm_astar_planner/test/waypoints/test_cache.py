"""The cache: one call for equal queries, a bounded size, and no caller left waiting."""

import threading
import time
from dataclasses import replace

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.llm import source as endpoint_source
from llm_astar_planner.waypoints.llm.source import CachedSource
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
)

QUERY = WaypointQuery(Costmap(GridMap(np.zeros((30, 50), dtype=np.int8))), (5, 5), (20, 20))


class Scripted:
    """Counts its queries; answers with the given status once its gate is open."""

    name = 'scripted'

    def __init__(self, status=SourceStatus.OK, opened=True):
        self.status = status
        self.queries = []
        self.gate = threading.Event()
        if opened:
            self.gate.set()

    def waypoints(self, query):
        self.queries.append(query)
        assert self.gate.wait(20)
        if self.status is None:
            raise RuntimeError('a bug')
        return WaypointReply(((1.0, 2.0),), 'scripted', self.status, prompt_tokens=7)


def test_a_repeated_query_makes_one_call():
    inner = Scripted()
    source = CachedSource(inner, model='tiny')
    replies = [source.waypoints(QUERY) for _ in range(100)]
    assert len(inner.queries) == 1
    assert {reply.waypoints for reply in replies} == {((1.0, 2.0),)}
    assert sum(reply.prompt_tokens for reply in replies) == 7
    assert source.name == 'scripted'


def test_a_query_that_differs_makes_another_call():
    inner = Scripted()
    source = CachedSource(inner)
    other_map = GridMap(np.full((30, 50), 100, dtype=np.int8))
    variants = (
        QUERY,
        replace(QUERY, start=(6, 5)),
        replace(QUERY, goal=(6, 5)),
        replace(QUERY, costmap=Costmap(other_map)),
        replace(QUERY, costmap=Costmap(QUERY.grid_map, CostmapConfig(occupied_threshold=99))),
        replace(QUERY, sample=SampleKey(0, 0)),
    )
    for query in variants * 2:
        source.waypoints(query)
    assert len(inner.queries) == len(variants)


def test_answers_without_a_route_are_kept_and_failures_are_not():
    for status, calls in (
        (SourceStatus.NO_WAYPOINTS, 1),
        (SourceStatus.MALFORMED, 1),
        (SourceStatus.TIMEOUT, 2),
        (SourceStatus.UNREACHABLE, 2),
        (SourceStatus.REFUSED, 2),
    ):
        inner = Scripted(status)
        source = CachedSource(inner)
        assert [source.waypoints(QUERY).status for _ in range(2)] == [status] * 2
        assert len(inner.queries) == calls


def test_the_oldest_answer_is_dropped():
    inner = Scripted()
    source = CachedSource(inner, size=2)
    first, second, third = (replace(QUERY, goal=(x, 20)) for x in (20, 21, 22))
    for query in (first, second, first, third, first):
        source.waypoints(query)
    assert len(inner.queries) == 3
    source.waypoints(second)
    assert len(inner.queries) == 4


def test_identical_queries_are_sent_once_and_a_late_answer_is_kept():
    inner = Scripted(opened=False)
    source = CachedSource(inner, timeout_s=20.0)
    replies = []
    threads = [
        threading.Thread(target=lambda: replies.append(source.waypoints(QUERY))) for _ in range(5)
    ]
    for thread in threads:
        thread.start()
    hasty = source.waypoints(replace(QUERY, time_limit=0.05))
    assert hasty.status is SourceStatus.TIMEOUT
    assert 'a late one is kept' in hasty.detail
    inner.gate.set()
    for thread in threads:
        thread.join()
    assert [reply.status for reply in replies] == [SourceStatus.OK] * 5
    assert len(inner.queries) == 1
    assert inner.queries[0].time_limit <= 20.0
    assert source.waypoints(replace(QUERY, time_limit=0.0)).status is SourceStatus.OK


def test_running_queries_are_bounded(monkeypatch):
    monkeypatch.setattr(endpoint_source, 'MAX_PENDING', 2)
    inner = Scripted(opened=False)
    source = CachedSource(inner)
    hasty = [replace(QUERY, goal=(20 + i, 20), time_limit=0.3) for i in range(3)]
    statuses = [source.waypoints(query).status for query in hasty]
    assert statuses == [SourceStatus.TIMEOUT, SourceStatus.TIMEOUT, SourceStatus.REFUSED]
    inner.gate.set()
    deadline = time.monotonic() + 60.0
    while source.waypoints(hasty[1]).status is not SourceStatus.OK:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_bug_in_the_source_is_an_error_reply(caplog):
    inner = Scripted(status=None)
    reply = CachedSource(inner).waypoints(QUERY)
    assert reply.status is SourceStatus.ERROR
    assert 'RuntimeError' in reply.detail
    assert 'the waypoint source failed' in caplog.text
