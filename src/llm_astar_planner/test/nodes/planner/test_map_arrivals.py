"""When another map is due, by the times at which the last ones came."""

import math

import pytest
from llm_astar_planner.nodes.planner.map_manager import MapArrivals


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def arrivals(clock):
    return MapArrivals(clock)


def arrive(arrivals, clock, *intervals):
    arrivals.note()
    for interval in intervals:
        clock.now += interval
        arrivals.note()


def test_no_map_is_due_before_one_came_nor_after_one_that_is_published_once(arrivals, clock):
    assert not arrivals.is_due(3600.0)
    assert arrivals.warnings() == ()
    arrive(arrivals, clock)
    clock.now += 1e6
    assert not arrivals.is_due(3600.0)
    assert arrivals.warnings() == ()
    assert (arrivals.last, arrivals.latest) == (100.0, math.inf)


def test_maps_that_come_every_second_are_due_within_a_second(arrivals, clock):
    arrive(arrivals, clock, 1.0, 1.0)
    assert arrivals.is_due(1.0)
    assert not arrivals.is_due(0.9)
    clock.now += 0.5
    assert arrivals.is_due(0.5)
    assert not arrivals.is_due(0.0)


def test_maps_that_come_seldom_are_not_waited_for(arrivals, clock):
    arrive(arrivals, clock, 20.0, 25.0, 20.0)
    assert not arrivals.is_due(2.5)
    clock.now += 18.0
    assert arrivals.is_due(2.5)


def test_a_costmap_of_1_hz_may_leave_out_every_other_message_as_navs_does(arrivals, clock):
    arrive(arrivals, clock, 2.0, 1.0, 2.0, 2.0)
    assert arrivals.is_due(1.0)
    clock.now += 2.9
    assert arrivals.warnings() == ()


def test_a_publisher_that_stops_is_noticed_and_not_waited_for(arrivals, clock):
    arrive(arrivals, clock, *[0.5] * 6)
    clock.now += 1.9
    assert arrivals.is_due(2.0)
    assert arrivals.warnings() == ()
    clock.now += 7.1
    assert not arrivals.is_due(2.0)
    [warning] = arrivals.warnings()
    assert warning == 'no map or update has come for 9.0 s; before, one came every 0.50 s'
    arrivals.note()
    assert arrivals.warnings() == ()


def test_a_costmap_is_stale_after_its_limit_if_it_came_at_regular_times(arrivals, clock):
    arrive(arrivals, clock, *[0.5] * 6)
    clock.now += 4.9
    assert arrivals.warnings(5.0) == ()
    clock.now += 0.2
    assert arrivals.warnings(5.0) == arrivals.warnings() != ()


def test_a_map_published_now_and_then_is_never_overdue(arrivals, clock):
    arrive(arrivals, clock, 0.1, 5.0, 0.3, 0.1, 60.0)
    clock.now += 3600.0
    assert arrivals.warnings() == ()
    assert not arrivals.is_due(2.5)


def test_a_map_is_as_old_as_its_message_and_never_older_than_the_one_before(arrivals, clock):
    arrivals.note(0.2)
    assert arrivals.last == pytest.approx(99.8)
    clock.now += 0.1
    arrivals.note(0.4)
    assert arrivals.last == pytest.approx(99.8)
