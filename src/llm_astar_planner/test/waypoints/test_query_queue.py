"""The queue of queries: newest first, bounded in threads, and never held up by a source."""

import gc
import threading
import time
import weakref

import pytest
from llm_astar_planner.waypoints.async_query import QueryQueue, QueryTask
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

LONG = 60.0


class Gate:
    """Answers when it is opened, and notes who asked."""

    def __init__(self):
        self.opened = threading.Event()
        self.asked = []

    def ask(self, queue, name, time_limit=LONG):
        """Put a query into the queue that waits at this gate."""

        def answer(stop):
            self.asked.append(name)
            self.opened.wait(LONG)
            return WaypointReply(detail=str(name))

        return QueryTask('gate', answer, time_limit, lambda _: None, queue)

    def wait_for(self, *names):
        wait_until(lambda: self.asked == list(names))


@pytest.fixture
def gate():
    gate = Gate()
    yield gate
    gate.opened.set()


def wait_until(condition):
    deadline = time.monotonic() + LONG
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def query_threads():
    return sum(thread.name == 'waypoints' for thread in threading.enumerate())


def test_the_newest_query_is_asked_first(gate):
    queue = QueryQueue(at_a_time=1, threads=4, waiting=8)
    tasks = [gate.ask(queue, 'first')]
    gate.wait_for('first')
    tasks += [gate.ask(queue, name) for name in ('second', 'third', 'fourth')]
    gate.opened.set()
    assert [task.result()[0].detail for task in tasks] == ['first', 'second', 'third', 'fourth']
    assert gate.asked == ['first', 'fourth', 'third', 'second']


def test_of_too_many_that_wait_the_oldest_is_refused_and_never_asked(gate):
    queue = QueryQueue(at_a_time=1, threads=4, waiting=2)
    gate.ask(queue, 'first')
    gate.wait_for('first')
    tasks = [gate.ask(queue, name) for name in ('second', 'third', 'fourth')]
    reply, _ = tasks[0].result()
    assert (reply.status, reply.detail) == (
        SourceStatus.REFUSED,
        'not asked, since newer queries came',
    )
    gate.opened.set()
    assert [task.result()[0].status for task in tasks[1:]] == [SourceStatus.OK] * 2
    assert gate.asked == ['first', 'fourth', 'third']


def test_a_query_that_nobody_waits_for_any_more_is_never_asked(gate):
    queue = QueryQueue(at_a_time=1, threads=4, waiting=8)
    first = gate.ask(queue, 'first')
    gate.wait_for('first')
    dropped, late = gate.ask(queue, 'dropped'), gate.ask(queue, 'late', 0.01)
    wanted = gate.ask(queue, 'wanted')
    assert dropped.close()[0].status is SourceStatus.LATE
    assert late.result()[0].status is SourceStatus.TIMEOUT
    gate.opened.set()
    assert [task.result()[0].detail for task in (first, wanted)] == ['first', 'wanted']
    wait_until(lambda: not queue._waiting)
    assert gate.asked == ['first', 'wanted']


def test_sources_that_hang_are_replaced_until_the_threads_are_used_up_and_then_refused(gate):
    queue = QueryQueue(at_a_time=1, threads=3, waiting=8)

    def hang():
        assert gate.ask(queue, 'hang', 0.02).result()[0].status is SourceStatus.TIMEOUT
        return len(gate.asked) == 3

    wait_until(hang)
    reply, _ = gate.ask(queue, 'last').result()
    assert reply.status is SourceStatus.REFUSED
    assert reply.detail == '3 queries have not come back yet'
    assert len(queue._running) == queue._threads == 3
    gate.opened.set()
    wait_until(lambda: not queue._running)
    assert gate.ask(queue, 'again').result()[0].detail == 'again'


def test_a_flood_takes_no_more_threads_than_allowed(gate):
    queue = QueryQueue(at_a_time=2, threads=4, waiting=8)
    before = query_threads()
    tasks = [gate.ask(queue, number) for number in range(500)]
    assert query_threads() - before <= 4
    gate.opened.set()
    statuses = [task.result()[0].status for task in tasks]
    assert statuses.count(SourceStatus.OK) == len(gate.asked) <= 12
    assert set(statuses) == {SourceStatus.OK, SourceStatus.REFUSED}


def test_closing_answers_all_at_once(gate):
    queue = QueryQueue(at_a_time=1, threads=4, waiting=8)
    tasks = [gate.ask(queue, number) for number in range(3)]
    queue.close()
    assert [task.result()[0].status for task in tasks] == [SourceStatus.REFUSED] * 3


@pytest.mark.parametrize('error', [SystemExit, KeyboardInterrupt, MemoryError])
def test_a_source_that_raises_anything_ends_no_thread(error):
    queue = QueryQueue(at_a_time=1, threads=1, waiting=8)

    def fail(stop):
        raise error

    for _ in range(3):
        reply, _ = QueryTask('bad', fail, LONG, lambda _: None, queue).result()
        assert (reply.status, reply.detail) == (
            SourceStatus.ERROR,
            f'{error.__name__} in source bad',
        )


def test_an_idle_thread_keeps_no_map_alive():
    queue = QueryQueue(at_a_time=1, threads=1, waiting=8)

    class Map:
        pass

    grid_map = Map()
    known = weakref.ref(grid_map)

    def answer(stop, kept=grid_map):
        return WaypointReply()

    assert QueryTask('map', answer, LONG, lambda _: None, queue).result()[0].detail == ''
    del grid_map, answer
    wait_until(lambda: gc.collect() >= 0 and known() is None)
    assert queue._threads == 1
