"""What is a retry, which map it waits for, and what a wait costs, on a clock of its own."""

import math
from types import SimpleNamespace

import pytest
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.writing import pose_to_message
from llm_astar_planner.nodes.planner.goals import PlanGoal
from llm_astar_planner.nodes.planner.map_manager import (
    MAX_FAILURES,
    MAX_WAITING,
    NOT_WAITED,
    RETRY_SECONDS,
    CostmapWait,
    MapArrivals,
)


class Maps:
    """Maps that are ready so many seconds after a wait began, on a clock that waiting moves."""

    def __init__(self):
        self.now = 1000.0
        self.newest = SimpleNamespace(arrived=self.now)
        self.is_preparing = False
        self.ready_after = math.inf
        self.arrivals = MapArrivals(self.clock)
        self.waits = []

    def clock(self):
        return self.now

    def wait(self, seconds, may_wait, newer_than=None):
        assert may_wait()
        self.waits.append((seconds, newer_than))
        self.now += min(seconds, self.ready_after)
        return self.ready_after <= seconds


@pytest.fixture
def maps():
    maps = Maps()
    for _ in range(5):
        maps.now += 1.0
        maps.arrivals.note()
    return maps


@pytest.fixture
def waits(maps):
    return CostmapWait(maps, lambda: 2.5, maps.clock)


def goal_at(x, y=0.0, *more, start=None, frame='map'):
    poses = [pose_to_message(Pose2D(*at), frame, Time()) for at in ((x, y), *more)]
    if start is not None:
        start = pose_to_message(Pose2D(*start), 'map', Time())
    return PlanGoal(tuple(poses), start)


def wait(waits, maps, *, is_retry):
    return waits.wait(maps.now, 0.9, lambda: True, is_retry=is_retry)


def test_a_retry_is_the_same_request_once_more_a_moment_later(waits, maps):
    assert not waits.is_retry(goal_at(1.0))
    waits.note(goal_at(1.0), failed=True)
    assert waits.is_retry(goal_at(1.0))
    assert waits.is_retry(goal_at(1.1, 0.1))
    assert not waits.is_retry(goal_at(1.5))
    assert not waits.is_retry(goal_at(1.0, frame='odom'))
    assert not waits.is_retry(goal_at(1.0, 0.0, (2.0, 0.0)))
    assert not waits.is_retry(goal_at(1.0, start=(0.0, 0.0)))
    assert not waits.is_retry(goal_at(math.nan))
    maps.now += RETRY_SECONDS + 0.1
    assert not waits.is_retry(goal_at(1.0))


def test_a_retry_from_another_start_is_another_request(waits):
    waits.note(goal_at(1.0, start=(0.0, 0.0)), failed=True)
    assert waits.is_retry(goal_at(1.0, start=(0.1, 0.0)))
    assert not waits.is_retry(goal_at(1.0, start=(1.0, 0.0)))


def test_a_goal_that_was_reached_is_forgotten_and_others_are_not(waits):
    for x in (1.0, 2.0):
        waits.note(goal_at(x), failed=True)
    waits.note(goal_at(1.0), failed=False)
    assert not waits.is_retry(goal_at(1.0))
    assert waits.is_retry(goal_at(2.0))


def test_failures_take_little_memory(waits, maps):
    for x in range(3 * MAX_FAILURES):
        waits.note(goal_at(float(x)), failed=True)
    assert len(waits.failures) == MAX_FAILURES
    maps.now += RETRY_SECONDS + 0.1
    waits.note(goal_at(0.0), failed=False)
    assert len(waits.failures) == 0


def test_a_retry_waits_for_a_map_newer_than_itself_beside_its_planning_time(waits, maps):
    maps.ready_after = 1.2
    begin = maps.now
    waited = wait(waits, maps, is_retry=True)
    assert maps.waits == [(2.5, begin)]
    assert (waited.seconds, waited.extra) == (pytest.approx(1.2), pytest.approx(1.2))
    assert waited.warnings == ()


def test_a_first_request_waits_only_for_a_map_that_is_being_prepared(waits, maps):
    assert wait(waits, maps, is_retry=False) == NOT_WAITED
    assert maps.waits == []
    maps.is_preparing, maps.ready_after = True, 0.1
    waited = wait(waits, maps, is_retry=False)
    assert maps.waits == [(0.45, None)]
    assert (waited.seconds, waited.extra) == (pytest.approx(0.1), 0.0)
    maps.ready_after = math.inf
    [warning] = wait(waits, maps, is_retry=False).warnings
    assert warning == 'the newest map was not ready after 0.45 s: the last one is used'


def test_a_retry_waits_for_no_map_that_is_not_due(waits, maps):
    maps.arrivals = MapArrivals(maps.clock)
    maps.arrivals.note()
    assert wait(waits, maps, is_retry=True) == NOT_WAITED
    assert maps.waits == []


def test_a_retry_stops_waiting_when_maps_have_stopped_coming(waits, maps):
    maps.now += 2.0
    waited = wait(waits, maps, is_retry=True)
    assert waited.seconds == pytest.approx(1.0)
    assert waited.warnings[0] == 'no newer map was ready after 1.00 s: the last one is used'
    maps.now += 1.0
    waited = wait(waits, maps, is_retry=True)
    assert len(maps.waits) == 1
    assert 'no map or update has come for 4.0 s' in waited.warnings[-1]


def test_only_some_retries_wait_at_a_time(waits, maps):
    waiting = []

    def another():
        waiting.append(maps.now)
        waits.wait(maps.now, 0.9, another, is_retry=True)
        return True

    another()
    assert len(waiting) == MAX_WAITING + 1
    assert len(maps.waits) == MAX_WAITING


def test_without_a_map_the_first_warning_says_so(waits, maps):
    maps.newest = None
    waited = wait(waits, maps, is_retry=False)
    assert maps.waits == [(2.5, -math.inf)]
    assert waited.warnings[0] == 'no map has arrived yet, after 2.50 s'
    maps.is_preparing = True
    assert 'is not ready yet' in wait(waits, maps, is_retry=False).warnings[0]
