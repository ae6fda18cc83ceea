"""What of an earlier plan holds on a changed map: its path, and the waypoints that led to it."""

import time
from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning import plan_reuse
from llm_astar_planner.planning.plan_reuse import WaypointCache, reuse_problem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

WALL = np.zeros((30, 40), dtype=np.int8)
WALL[:25, 20] = 100
CORNER = ((19.0, 26.0), (21.0, 26.0))


class Source:
    """Counts how often it is asked."""

    name = 'counting'

    def __init__(self, *waypoints):
        cost = {'prompt_tokens': 9, 'completion_tokens': 9, 'seconds': 9.0}
        self.reply = WaypointReply(waypoints, 'counting', SourceStatus.OK, **cost)
        self.asked = 0

    def waypoints(self, query):
        self.asked += 1
        return self.reply


class Cached:
    """Asks a source only where what it said before does not hold, as the planner node does."""

    def __init__(self, source):
        self.name, self.source, self.cache = source.name, source, WaypointCache(source.name)

    def waypoints(self, query):
        return self.cache.find(query) or self.source.waypoints(query)


def changed(*cells):
    """Return the walled map with more cells occupied."""
    after = WALL.copy()
    for x, y in cells:
        after[y, x] = 100
    return Planner(GridMap(after))


BEFORE = Planner(GridMap(WALL))
REQUEST = PlanRequest((5, 5), (35, 5), method='guided')


@pytest.fixture(scope='module')
def plan():
    return BEFORE.plan(REQUEST)


def test_a_path_is_kept_on_a_map_that_changed_elsewhere(plan):
    assert reuse_problem(plan, BEFORE.grid_map, changed((2, 28))) is None


def test_a_path_that_the_new_map_blocks_is_not_kept(plan):
    blocked = tuple(plan.path[len(plan.path) // 2].tolist())
    problem = reuse_problem(plan, BEFORE.grid_map, changed(blocked))
    assert 'obstacle' in problem
    assert str(blocked) in problem


def test_a_shortened_path_is_broken_where_it_leaves_its_cells_too():
    before = Planner(GridMap(np.zeros((30, 40), dtype=np.int8)))
    plan = before.plan(replace(REQUEST, goal=(35, 12), any_angle=True))
    middles = np.rint(np.linspace(plan.any_angle.points[0], plan.any_angle.points[-1], 31))
    aside = max(
        middles.astype(int).tolist(), key=lambda cell: np.abs(plan.path - cell).sum(axis=1).min()
    )
    after = before.grid_map.cells.copy()
    after[aside[1], aside[0]] = 100
    problem = reuse_problem(plan, before.grid_map, Planner(GridMap(after)))
    assert str(tuple(aside)) in problem


def test_rules_that_changed_may_break_a_path_too(plan):
    wide = Planner(BEFORE.grid_map, CostmapConfig(robot_radius=2.0))
    assert reuse_problem(plan, BEFORE.grid_map, wide) is not None


@pytest.mark.parametrize(
    'other',
    [
        GridMap(np.zeros((31, 40), dtype=np.int8)),
        GridMap(WALL, resolution=0.5),
        GridMap(WALL, origin=Pose2D(1.0, 0.0)),
        GridMap(WALL, frame_id='odom'),
    ],
)
def test_a_path_is_not_kept_on_a_map_with_another_size_or_origin(plan, other):
    assert 'another' in reuse_problem(plan, BEFORE.grid_map, Planner(other))


def asked(source, *steps):
    """Plan step by step with one cache; return how often the source was asked after each."""
    cached, counts, plans = Cached(source), [], []
    for planner, changes in steps:
        plans.append(plan_with(cached, planner, replace(REQUEST, **changes)))
        counts.append(source.asked)
    return counts, plans


def plan_with(cached, planner, request):
    """Plan with a cache, as the planner node does."""
    started = time.monotonic()
    plan = planner.plan(replace(request, source=cached))
    cached.cache.remember(plan, planner.grid_map, started)
    return plan


def test_waypoints_that_hold_on_a_changed_map_are_not_asked_for_again():
    counts, plans = asked(Source(*CORNER), (BEFORE, {}), (changed((2, 28)), {}))
    assert counts == [1, 1]
    assert [point.status.value for point in plans[1].checked_waypoints] == ['accepted', 'accepted']
    assert plans[1].reply.label == 'counting'
    assert BEFORE.grid_map.digest in plans[1].reply.detail
    reply = plans[1].reply
    assert (reply.prompt_tokens, reply.completion_tokens, reply.seconds) == (0, 0, 0.0)


def ring(x, y):
    return [(x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)]


@pytest.mark.parametrize('cells', [[(10, 12)], ring(10, 12)], ids=['occupied', 'walled in'])
def test_waypoints_that_no_longer_hold_are_asked_for_again(cells):
    source = Source((10.0, 12.0), *CORNER)
    assert asked(source, (BEFORE, {}), (changed(*cells), {}))[0] == [1, 2]


def test_waypoints_that_were_not_all_accepted_are_not_kept():
    source = Source(*CORNER, (20.0, 5.0))
    assert asked(source, (BEFORE, {}), (changed((2, 28)), {}))[0] == [1, 2]


@pytest.mark.parametrize('changes', [{'goal': (34, 6)}, {'start': (5, 28)}])
def test_another_goal_or_far_start_is_another_query(changes):
    assert asked(Source(*CORNER), (BEFORE, {}), (changed((2, 28)), changes))[0] == [1, 2]


def test_a_robot_on_its_way_keeps_the_waypoints_that_are_still_ahead():
    source = Source((10.0, 12.0), *CORNER)
    on_the_way = {'start': (12, 15)}
    counts, plans = asked(source, (BEFORE, {}), (BEFORE, on_the_way))
    assert counts == [1, 1]
    assert [(point.x, point.y) for point in plans[1].checked_waypoints] == list(CORNER)


def test_a_waypoint_the_robot_stands_at_is_passed():
    plan = BEFORE.plan(replace(REQUEST, source=Source(*CORNER)))
    distances = np.hypot(*(plan.path - CORNER[0]).T)
    at_the_first = {'start': tuple(plan.path[distances.argmin()].tolist())}
    counts, plans = asked(Source(*CORNER), (BEFORE, {}), (BEFORE, at_the_first))
    assert counts == [1, 1]
    assert [(point.x, point.y) for point in plans[1].checked_waypoints] == [CORNER[1]]


def test_waypoints_of_a_map_with_another_resolution_are_asked_for_again():
    finer = Planner(GridMap(changed((2, 28)).grid_map.cells, resolution=0.5))
    assert asked(Source(*CORNER), (BEFORE, {}), (finer, {}))[0] == [1, 2]


def test_a_robot_off_the_map_gets_that_code():
    goal = {'goal': (38, 5)}
    off = {**goal, 'start': (40, 5)}
    plans = asked(Source(*CORNER), (BEFORE, goal), (BEFORE, off))[1]
    assert plans[1].code.name == 'START_OUTSIDE_MAP'


def test_the_goals_that_are_kept_are_bounded(monkeypatch):
    monkeypatch.setattr(plan_reuse, 'CACHED_GOALS', 1)
    other, source = {'goal': (34, 6)}, Source(*CORNER)
    counts, _ = asked(source, (BEFORE, {}), (BEFORE, other), (changed((2, 28)), {}))
    assert counts == [1, 2, 3]


def test_a_robot_that_has_passed_them_all_asks_for_no_more():
    near = {'start': (34, 7)}
    counts, plans = asked(Source(*CORNER), (BEFORE, {}), (BEFORE, near), (changed((2, 28)), near))
    assert counts == [1, 1, 1]
    assert [(plan.code, plan.checked_waypoints) for plan in plans[1:]] == [(0, ())] * 2


def test_waypoints_asked_for_before_the_cache_was_cleared_are_asked_for_again():
    source = Source(*CORNER)
    cached = Cached(source)
    answer = source.waypoints

    def answer_at_last(query):
        cached.cache.clear()
        return answer(query)

    source.waypoints = answer_at_last
    for planner in (BEFORE, changed((2, 28))):
        plan_with(cached, planner, REQUEST)
    assert source.asked == 2


def test_a_cleared_cache_asks_again():
    source = Source(*CORNER)
    cached = Cached(source)
    plan_with(cached, BEFORE, REQUEST)
    cached.cache.clear()
    plan_with(cached, changed((2, 28)), REQUEST)
    assert source.asked == 2
