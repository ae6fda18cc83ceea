"""The planner with guided search: bounds, late waypoints, better plans on the way."""

import threading
import time

import numpy as np
import pytest
from grids import checker_of
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning import segment
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.landmarks import LandmarkManager
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

MAP = BarrierMap(0, (0, 41), (0, 31), (Barrier(15, 8, 32),), (Barrier(32, 6, 15),))
PLANNER = Planner.for_barrier_map(MAP).prepare()
START, GOAL = (20, 8), (20, 22)
AROUND = [(7, 14), (7, 16)]


class Source:
    """Answers when it is let, and tells when it was asked."""

    name = 'test'

    def __init__(self, answer=(), *, held=False):
        self.answer = answer
        self.asked, self.let = threading.Event(), threading.Event()
        if not held:
            self.let.set()

    def waypoints(self, query):
        self.asked.set()
        self.let.wait(min(query.time_limit, 30.0))
        return WaypointReply(tuple(self.answer), label='test:model')


def maze(size):
    """Walls in turn from above and below, one gap each: long to search, with one way through."""
    blocked = np.zeros((size, size), dtype=np.int8)
    for number, x in enumerate(range(4, size - 4, 4)):
        blocked[:, x] = 100
        blocked[-2 if number % 2 else 1, x] = 0
    return GridMap(blocked)


def test_landmarks_make_the_proof_cheap_once_they_are_measured():
    request = PlanRequest(START, GOAL, max_suboptimality=1.05)
    before = Planner.for_barrier_map(MAP).plan(request)
    after = PLANNER.plan(request)
    assert after.expansions < before.expansions
    assert after.length <= 1.05 * before.length


def test_a_guided_plan_tells_what_is_proven_of_it():
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=Source(AROUND), max_suboptimality=1.05))
    shortest = PLANNER.plan(PlanRequest(START, GOAL, 'exact_astar'))
    assert plan.code is ResultCode.NONE
    assert plan.guided_by == 'test:model'
    assert 1.0 <= plan.suboptimality_bound <= 1.05
    assert shortest.suboptimality_bound == 1.0
    assert shortest.length <= plan.length <= plan.suboptimality_bound * shortest.length + 1e-6
    assert 0 < plan.first_expansions <= plan.expansions
    assert 'proven within' in plan.message


@pytest.mark.parametrize(
    'waypoints',
    [
        [(39, 29), (1, 1), (39, 1), (1, 29)],
        [(20, 15)] * 300,
        [(float('nan'), 3.0), (1e30, -1e30), (7.5, 14.25)],
    ],
)
def test_hostile_waypoints_cost_at_most_twice_and_break_no_bound(waypoints):
    exact = PLANNER.plan(PlanRequest(START, GOAL, 'exact_astar'))
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=Source(waypoints), max_suboptimality=1.1))
    assert plan.code is ResultCode.NONE
    assert plan.length <= 1.1 * exact.length + 1e-6
    assert plan.expansions <= 2.1 * exact.expansions


def test_waypoints_at_the_maps_edge_may_lead_guided_though_not_the_papers():
    cells = np.zeros((20, 20), dtype=np.int8)
    planner = Planner(GridMap(cells)).prepare()
    edge = Source([(10, 0)])
    assert planner.plan(PlanRequest((1, 1), (18, 1), source=edge)).guided_by == 'test:model'
    assert planner.plan(PlanRequest((1, 1), (18, 1), 'llm_astar', edge)).guided_by == 'none'


def test_the_search_does_not_wait_for_waypoints_it_does_not_need():
    source = Source(AROUND, held=True)
    begin = time.monotonic()
    plan = PLANNER.plan(
        PlanRequest(START, GOAL, source=source, search_while_waiting=True, time_limit=20.0)
    )
    assert time.monotonic() - begin < 10.0
    assert source.asked.is_set()
    assert plan.code is ResultCode.NONE
    assert plan.source_status is SourceStatus.LATE
    assert (plan.guided_by, plan.checked_waypoints) == ('none', ())
    assert 'before test answered' in plan.message
    source.let.set()


def test_a_source_that_answers_at_once_leads_a_search_that_does_not_wait(monkeypatch):
    monkeypatch.setattr(segment, 'HEAD_START', 20.0)  # of a busy machine
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=Source(AROUND), search_while_waiting=True))
    assert (plan.source_status, plan.guided_by) == (SourceStatus.OK, 'test:model')


def test_a_search_that_is_canceled_draws_no_picture():
    planner, stop = Planner(maze(60), CostmapConfig(corner_cutting=True)), no_stop()
    asked = PlanRequest((1, 1), (58, 58), max_suboptimality=1.0, source=Source([(1, 58), (58, 1)]))
    for plan in planner.plans(asked, stop):  # noqa: B007 - the last one counts
        stop.fill(1)
    assert plan.code is ResultCode.NONE
    assert not plan.expanded.any()
    assert planner.plan(asked).expanded.any()


def test_a_source_that_fails_is_reported_while_the_search_goes_on():
    class Broken(Source):
        def waypoints(self, query):
            self.asked.set()
            raise RuntimeError('secret')

    source = Broken()
    planner = Planner(maze(800))
    begin = planner.plan(
        PlanRequest((1, 1), (798, 798), source=source, search_while_waiting=True, time_limit=60.0)
    )
    assert begin.code is ResultCode.NONE
    assert begin.source_status in (SourceStatus.ERROR, SourceStatus.LATE)
    assert begin.guided_by == 'none'
    assert 'secret' not in begin.message


def test_better_plans_come_as_they_are_found_and_only_get_better():
    planner = Planner(maze(60), CostmapConfig(corner_cutting=True))
    request = PlanRequest(
        (1, 1), (58, 58), source=Source([(1, 58), (58, 1)]), max_suboptimality=1.0
    )
    *seen, plan = planner.plans(request)
    assert plan.is_final
    assert not any(better.is_final for better in seen)
    assert plan.code is ResultCode.NONE
    costs = [better.cost for better in seen]
    assert costs
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] == pytest.approx(plan.cost)
    for better in seen:
        checker = checker_of(planner.costmap.blocked, corner_cutting=True)
        problem = checker.path_problem(better.path, (1, 1), (58, 58))
        assert problem is None


def test_a_cancelled_search_keeps_the_path_it_had():
    """Cancelled at its first path, it answers with that one instead of proving on."""
    stop = no_stop()
    cells = np.zeros((41, 41), dtype=np.int8)
    cells[:, 20] = 100
    cells[[0, 24], 20] = 0
    planner = Planner(GridMap(cells))
    request = PlanRequest((0, 20), (40, 20), source=Source([(20, 0)]), max_suboptimality=1.0)
    full = planner.plan(request)
    assert full.expansions > full.first_expansions
    for plan in planner.plans(request, stop):  # noqa: B007 - the last one counts
        stop[0] = 1
    assert plan.code is ResultCode.NONE
    assert plan.expansions < full.expansions
    assert plan.suboptimality_bound > 1.0
    assert 'stopped' in plan.message


def test_graded_cells_are_avoided_as_far_as_they_cost():
    cells = np.zeros((21, 41), dtype=np.int8)
    cells[8:13, 10:31] = 60
    request = PlanRequest((2, 10), (38, 10), max_suboptimality=1.0)
    around = Planner(GridMap(cells)).plan(request)
    through = Planner(GridMap(cells), CostmapConfig(cost_travel_multiplier=0.0)).plan(request)
    assert through.length == 36.0
    assert around.length > through.length
    assert not (cells[around.path[:, 1], around.path[:, 0]] > 0).any()
    assert through.cost == through.length


def test_the_any_angle_path_is_shorter_and_free():
    plan = PLANNER.plan(PlanRequest(START, GOAL, max_suboptimality=1.0, any_angle=True))
    shortened = plan.any_angle
    assert shortened.length < plan.length
    assert shortened.points[0].tolist() == list(START)
    assert shortened.points[-1].tolist() == list(GOAL)
    checker = checker_of(PLANNER.costmap.blocked, corner_cutting=True)
    assert checker.segments_problem(shortened.points) is None


def test_landmarks_are_carried_from_map_to_map_while_cells_only_become_blocked():
    keeper = LandmarkManager()
    first = Planner(GridMap(np.zeros((50, 50), dtype=np.int8)), landmarks=keeper).prepare()
    with keeper.lend(first.costmap.grid_graph) as held:
        assert held is not None
    cells = np.zeros((50, 50), dtype=np.int8)
    cells[5:45, 25] = 100
    second = Planner(GridMap(cells), landmarks=keeper).prepare(wait=False)
    with keeper.lend(second.costmap.grid_graph) as landmarks:
        assert landmarks is held
    third = Planner(GridMap(np.zeros((50, 50), dtype=np.int8)), landmarks=keeper).prepare()
    plan = third.plan(PlanRequest((2, 2), (47, 30), max_suboptimality=1.0))
    assert plan.suboptimality_bound == 1.0
    keeper.close()


SEGMENT_CELLS = np.zeros((9, 9), dtype=bool)
SEGMENT_CELLS[4, 4] = True


@pytest.mark.parametrize(
    ('points', 'corner_cutting', 'problem'),
    [
        ([[0, 0], [8, 2]], False, None),
        ([[0, 0], [8, 8]], False, 'hits an obstacle at (4, 4)'),
        ([[0, 4], [8, 4]], False, 'hits an obstacle at (4, 4)'),
        ([[4, 0], [4, 8]], True, 'hits an obstacle at (4, 4)'),
        ([[0, 3], [8, 5]], True, 'hits an obstacle at (4, 4)'),
        ([[3, 4], [4, 5]], True, None),
        ([[3, 4], [4, 5]], False, 'cuts a corner'),
        ([[4, 3], [5, 4], [5, 5]], False, 'cuts a corner'),
        ([[2, 2]], False, None),
    ],
)
def test_segments_at_any_angle_are_checked_cell_by_cell(points, corner_cutting, problem):
    checker = checker_of(SEGMENT_CELLS, corner_cutting=corner_cutting)
    found = checker.segments_problem(np.array(points, dtype=np.int32))
    assert found is None if problem is None else problem in found
