"""The path monitor, with maps that come faster than a replan is made."""

import threading
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.nodes.planner.goals import PlanGoal, PlanResponse, PreemptingGoalSlot
from llm_astar_planner.nodes.planner.path_monitor import PathMonitor
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest

START, GOAL = (2, 2), (17, 2)


def planner_with_wall(height):
    cells = np.zeros((20, 20), dtype=np.int8)
    cells[:height, 10] = 100
    return Planner(GridMap(cells))


class SlowHandler:
    """Answers a replan when it is told to, on the planner that is newest then."""

    is_active = True

    def __init__(self, maps):
        self.maps = maps
        self.asked, self.go = threading.Semaphore(0), threading.Semaphore(0)
        self.tokens = []

    def answer(self, goal, token, replan_reason):
        self.tokens.append(token)
        planner = self.maps.newest.planner
        self.asked.release()
        self.go.acquire()
        return response_of(planner)


def response_of(planner):
    request = PlanRequest(START, GOAL)
    return PlanResponse(
        PlanGoal(()), planner.plan(request), None, planner=planner, request=request
    )


@pytest.fixture
def parts():
    maps = SimpleNamespace(newest=SimpleNamespace(planner=planner_with_wall(0)))
    handler = SlowHandler(maps)
    errors = []
    logger = SimpleNamespace(info=lambda *_, **__: None, error=errors.append)
    monitor = PathMonitor(
        logger,
        {'replan_on_map': False},
        maps,
        replans=PreemptingGoalSlot(),
        cache=None,
        footprint=SimpleNamespace(current=None),
    )
    monitor.start(handler)
    yield SimpleNamespace(maps=maps, handler=handler, monitor=monitor)
    handler.go.release(100)
    monitor.close()
    assert not errors


def watch(parts):
    response = response_of(parts.maps.newest.planner)
    parts.monitor.tasks.put(partial(parts.monitor.watch, response))


def give_map(parts, height):
    parts.maps.newest = SimpleNamespace(planner=planner_with_wall(height))
    parts.monitor.check(parts.maps.newest.planner)


def test_maps_that_come_during_a_replan_do_not_cancel_it_and_are_checked_after_it(parts):
    watch(parts)
    give_map(parts, 12)
    assert parts.handler.asked.acquire(timeout=60)
    for height in (13, 14, 15, 16):
        give_map(parts, height)
    (token,) = parts.handler.tokens
    assert not token.reason
    parts.handler.go.release()
    # The path around 12 cells of wall is blocked by 16, and so replanned once more.
    assert parts.handler.asked.acquire(timeout=60)
    assert len(parts.handler.tokens) == 2
    assert not any(token.reason for token in parts.handler.tokens)


def test_another_change_cancels_a_replan(parts):
    watch(parts)
    give_map(parts, 12)
    assert parts.handler.asked.acquire(timeout=60)
    parts.monitor.check(parts.maps.newest.planner, 'the instruction has changed')
    assert parts.handler.tokens[0].reason == 'the instruction has changed'
