"""When the stop flag of a search is raised."""

import time

from llm_astar_planner.search.stop import POLL_PERIOD_S, deadline_guard, no_stop


def wait_for(flag):
    end = time.monotonic() + 10.0
    while not flag[0] and time.monotonic() < end:
        time.sleep(POLL_PERIOD_S / 10.0)
    return flag[0]


def test_the_flag_is_raised_at_the_deadline():
    stop, begin = no_stop(), time.monotonic()
    with deadline_guard(stop, begin + 0.05) as flag:
        assert flag[0] == 0
        assert wait_for(flag) == 1
        assert time.monotonic() >= begin + 0.05
    assert stop[0] == 0


def test_a_deadline_that_has_passed_raises_the_flag_at_once():
    with deadline_guard(no_stop(), time.monotonic() - 1.0) as flag:
        assert flag[0] == 1


def test_the_callers_flag_raises_it_too():
    stop = no_stop()
    with deadline_guard(stop, time.monotonic() + 60.0) as flag:
        stop[0] = 1
        assert wait_for(flag) == 1


def test_a_flag_raised_before_the_search_begins_cancels_it_at_once():
    stop = no_stop()
    stop[0] = 1
    with deadline_guard(stop, time.monotonic() + 60.0) as flag:
        assert flag[0] == 1
