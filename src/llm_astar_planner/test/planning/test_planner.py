"""The facade: always a code, whatever the request, the map or the source may be."""

import math
import threading
import time

import numpy as np
import pytest
from grids import checker_of
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode, WaypointStatus
from llm_astar_planner.search import any_angle
from llm_astar_planner.search.any_angle import string_pull
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import GuidedSearch
from llm_astar_planner.search.methods import METHODS, SEARCH_METHODS, WAYPOINT_METHODS
from llm_astar_planner.search.problem import SearchProblem, search_method
from llm_astar_planner.search.result import SearchResult, SearchStatus
from llm_astar_planner.waypoints.replay import FixedReply
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

MAP = BarrierMap(0, (0, 21), (0, 15), (Barrier(7, 4, 14),), (Barrier(16, 3, 11),))
PLANNER = Planner.for_barrier_map(MAP)
START, GOAL = (9, 3), (9, 11)


class Source:
    """A source that does what a test tells it to."""

    name = 'test'

    def __init__(self, answer=(), error=None):
        self.answer, self.error = answer, error
        self.queries = []

    def waypoints(self, query):
        self.queries.append(query)
        if self.error:
            raise self.error
        return WaypointReply(tuple(self.answer), label='test:model')


def walled(*, gap):
    cells = np.zeros((9, 9), dtype=np.int8)
    cells[:, 4] = 100
    if gap:
        cells[7, 4] = 0
    return GridMap(cells)


@pytest.mark.parametrize('kind', [list, np.array, lambda cell: tuple(np.int16(x) for x in cell)])
def test_cells_may_be_whole_numbers_of_any_kind(kind):
    request = PlanRequest(kind(START), kind(GOAL), via=[kind((3, 7))])
    assert (request.start, request.goal, request.via) == (START, GOAL, ((3, 7),))
    assert PLANNER.plan(request).code is ResultCode.NONE


@pytest.mark.parametrize('cell', [(1.0, 2), (1, 2, 3), 'ab', None, 7])
def test_a_field_that_is_not_a_cell_is_named(cell):
    for name, make in {
        'start': lambda: PlanRequest(cell, GOAL),
        'goal': lambda: PlanRequest(START, cell),
        'via': lambda: PlanRequest(START, GOAL, via=(cell,)),
    }.items():
        with pytest.raises(ValueError, match=f'{name}: .* is not a cell'):
            make()


def test_a_plan_tells_its_path_its_work_and_what_guided_it():
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=Source([(3, 7), (40, 7), (8, 7)])))
    assert plan.code is ResultCode.NONE
    checker = checker_of(PLANNER.costmap.blocked, corner_cutting=True)
    assert checker.path_problem(plan.path, START, GOAL) is None
    assert plan.length == pytest.approx(np.hypot(*np.diff(plan.path, axis=0).T).sum())
    assert plan.guided_by == 'test:model'
    assert (plan.source, plan.source_status) == ('test', SourceStatus.OK)
    verdicts = [point.status.value for point in plan.checked_waypoints]
    assert verdicts == ['accepted', 'out_of_bounds', 'occupied']
    # Stale entries are popped and counted too, as in the published code.
    assert plan.expansions >= plan.expanded.sum() > 0
    assert plan.storage >= plan.expanded.sum()
    assert '1 of 3 waypoints' in plan.message
    assert min(plan.seconds_source, plan.seconds_search) > 0


def test_a_waypoint_that_the_robots_body_cannot_take_is_occupied():
    beside_a_barrier = Source([(8, 6)])
    request = PlanRequest(START, GOAL, 'llm_astar', beside_a_barrier)
    assert PLANNER.plan(request).checked_waypoints[0].status is WaypointStatus.ACCEPTED
    planner = Planner(MAP.to_grid(), CostmapConfig(robot_radius=1.0), MAP)
    assert planner.plan(request).checked_waypoints[0].status is WaypointStatus.OCCUPIED


def test_a_plan_whose_waypoints_were_all_dropped_is_guided_by_none():
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=Source([(40, 7)])))
    unguided = PLANNER.plan(PlanRequest(START, GOAL))
    assert plan.guided_by == 'none'
    assert plan.expansions == unguided.expansions


@pytest.mark.parametrize('method', sorted(set(METHODS) - WAYPOINT_METHODS))
def test_methods_without_waypoints_ask_nobody(method):
    source = Source([(3, 7)])
    plan = PLANNER.plan(PlanRequest(START, GOAL, method, source))
    assert plan.code is ResultCode.NONE
    assert source.queries == []
    assert plan.source_status is SourceStatus.NONE


FAILURES = [
    (PLANNER, PlanRequest((25, 3), GOAL), ResultCode.START_OUTSIDE_MAP, '(25, 3)'),
    (PLANNER, PlanRequest((-1, 3), GOAL), ResultCode.START_OUTSIDE_MAP, '21 x 15'),
    (PLANNER, PlanRequest(START, (9, 15)), ResultCode.GOAL_OUTSIDE_MAP, '(9, 15)'),
    (PLANNER, PlanRequest((9, 7), GOAL), ResultCode.START_OCCUPIED, 'occupancy 100'),
    (PLANNER, PlanRequest(START, (16, 5)), ResultCode.GOAL_OCCUPIED, '(16, 5)'),
    (PLANNER, PlanRequest(START, GOAL, 'theta'), ResultCode.INVALID_PLANNER, 'llm_astar'),
    (
        PLANNER,
        PlanRequest(START, GOAL, heuristic='l7'),
        ResultCode.INVALID_PLANNER,
        'octile',
    ),
    (
        Planner(walled(gap=False)),
        PlanRequest((1, 1), (7, 7)),
        ResultCode.NO_VALID_PATH,
        'cut the goal cell (7, 7) off from the start cell (1, 1)',
    ),
]


@pytest.mark.parametrize(('planner', 'request_', 'code', 'words'), FAILURES)
def test_every_cause_of_failure_has_its_code_and_sentence(planner, request_, code, words):
    plan = planner.plan(request_)
    assert plan.code is code
    assert words in plan.message
    assert len(plan.path) == 0
    assert np.isnan(plan.length)


def test_no_source_is_asked_about_what_cannot_be_planned():
    source = Source()
    for planner, request, _, _ in FAILURES:
        planner.plan(PlanRequest(request.start, request.goal, request.method, source))
    queried = [query.start for query in source.queries]
    assert queried == [START]  # the unknown heuristic alone; its request is sound otherwise


def test_a_gap_lets_the_path_through():
    plan = Planner(walled(gap=True)).plan(PlanRequest((1, 1), (7, 7)))
    assert plan.code is ResultCode.NONE
    assert [4, 7] in plan.path.tolist()


def test_a_diagonal_gap_is_passable_only_if_corners_may_be_cut():
    cells = np.zeros((6, 6), dtype=np.int8)
    cells[:3, 3] = 100
    cells[3:, 2] = 100
    cut = Planner(GridMap(cells), CostmapConfig(corner_cutting=True))
    assert cut.plan(PlanRequest((0, 0), (5, 5))).code is ResultCode.NONE
    walked = Planner(GridMap(cells), CostmapConfig(corner_cutting=False))
    assert walked.plan(PlanRequest((0, 0), (5, 5))).code is ResultCode.NO_VALID_PATH


def test_unknown_cells_block_only_on_request():
    cells = np.zeros((5, 7), dtype=np.int8)
    cells[:, 3] = -1
    crossing = PlanRequest((1, 2), (5, 2))
    assert Planner(GridMap(cells)).plan(crossing).code is ResultCode.NONE
    strict = Planner(GridMap(cells), CostmapConfig(allow_unknown=False))
    assert strict.plan(crossing).code is ResultCode.NO_VALID_PATH


def test_start_equal_to_goal_is_one_cell_and_asks_nobody():
    source = Source([(3, 7)])
    plan = PLANNER.plan(PlanRequest(START, START, source=source))
    assert plan.code is ResultCode.NONE
    assert plan.path.tolist() == [list(START)]
    assert plan.length == 0.0
    assert source.queries == []


def test_a_source_that_raises_never_stops_a_plan():
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=Source(error=RuntimeError('secret'))))
    assert plan.code is ResultCode.NONE
    assert plan.source_status is SourceStatus.ERROR
    assert plan.guided_by == 'none'
    assert 'RuntimeError' in plan.message
    assert 'secret' not in plan.message


def test_a_source_gets_a_part_of_the_time_and_no_more():
    source = Source()
    PLANNER.plan(PlanRequest(START, GOAL, source=source, time_limit=5.0))
    assert 0.0 < source.queries[0].time_limit <= 4.0
    PLANNER.plan(PlanRequest(START, GOAL, source=source, source_time_limit=0.05))
    assert source.queries[1].time_limit == 0.05


@pytest.fixture(scope='module')
def halved():
    """Return a planner on a large map whose halves are joined at its lower edge alone."""
    cells = np.zeros((2000, 2000), dtype=np.int8)
    cells[1:, 1000] = 100
    # Where corners may be cut no search can jump, which would not take any time here.
    planner = Planner(GridMap(cells), CostmapConfig(corner_cutting=True))
    planner.costmap.prepare()
    return planner


@pytest.mark.parametrize('method', METHODS)
def test_a_search_past_its_time_is_a_timeout_not_no_path(halved, method):
    plan = halved.plan(PlanRequest((800, 1900), (1200, 1900), method, time_limit=0.005))
    assert plan.code is ResultCode.TIMEOUT
    assert 'out of time after' in plan.message
    assert len(plan.path) == 0


# The other methods of the paper search as these do, and take longer here.
@pytest.mark.parametrize('method', ['guided', 'exact_astar', 'llm_astar'])
def test_a_first_path_is_looked_for_longer_than_a_better_one(halved, method):
    request = PlanRequest(
        (800, 1900), (1200, 1900), method, time_limit=0.005, first_path_time_limit=300.0
    )
    plan = halved.plan(request)
    assert plan.code is ResultCode.NONE
    assert len(plan.path) > 0
    assert plan.path[-1].tolist() == [1200, 1900]


def test_the_longer_limit_is_named_when_it_is_over(halved):
    request = PlanRequest((800, 1900), (1200, 1900), time_limit=0.001, first_path_time_limit=0.005)
    plan = halved.plan(request)
    assert plan.code is ResultCode.TIMEOUT
    assert 'the limit is 0.005 s, first_path_time_limit' in plan.message


def test_with_a_path_the_search_ends_at_the_shorter_limit():
    blocked = np.random.default_rng(5).random((300, 300)) < 0.3
    blocked[0, 0] = blocked[-1, -1] = False
    grid = GridGraph(blocked, corner_cutting=True)
    problem = SearchProblem(
        grid, (0, 0), (299, 299), max_suboptimality=1.0, deadline=-1.0,
        first_path_deadline=math.inf,
    )  # fmt: skip
    search = GuidedSearch(problem)
    search.guide([(150, 150)])
    found = list(search.solutions())
    assert len(found) == 1
    assert search.result().status is SearchStatus.STOPPED


@pytest.mark.parametrize('method', METHODS)
def test_no_plan_starts_a_thread(monkeypatch, method):
    def refuse(thread):
        raise AssertionError(f'{thread.name} was started')

    monkeypatch.setattr(threading.Thread, 'start', refuse)
    assert PLANNER.plan(PlanRequest(START, GOAL, method)).code is ResultCode.NONE


def test_a_path_at_any_angle_that_does_not_fit_into_the_time_is_left_out(monkeypatch):
    request = PlanRequest(START, GOAL, 'exact_astar', any_angle=True)
    assert PLANNER.plan(request).warnings == ()
    monkeypatch.setattr(any_angle, 'string_pull', late_pull)
    plan = PLANNER.plan(request)
    assert plan.code is ResultCode.NONE
    assert len(plan.path) > 0
    assert plan.any_angle is None
    assert plan.warnings == ('the path at any angle is left out: there was no time for it',)


def late_pull(grid, path, deadline):
    assert deadline > time.monotonic()
    return string_pull(grid, path, deadline=time.monotonic())


def test_another_thread_cancels_a_search():
    planner = Planner(GridMap(np.zeros((3000, 3000), dtype=np.int8)))
    planner.prepare()  # once a map: it is the search that shall be cancelled
    request = PlanRequest((1, 1), (2998, 1200), 'dynamic_weighted_astar', time_limit=300.0)

    def cancelled_after(seconds):
        stop, plans = no_stop(), []
        thread = threading.Thread(target=lambda: plans.append(planner.plan(request, stop)))
        thread.start()
        time.sleep(seconds)
        stop[0] = 1
        thread.join(60.0)
        assert not thread.is_alive()
        assert plans[0].code is ResultCode.TIMEOUT
        return plans[0]

    # A busy machine may begin to search late.
    plans = map(cancelled_after, (0.2, 0.8, 3.2))
    plan = next(plan for plan in plans if plan.expansions)
    assert 'cancelled after' in plan.message


def test_a_request_without_a_time_limit_is_planned():
    plan = PLANNER.plan(PlanRequest(START, GOAL, time_limit=float('inf')))
    assert plan.code is ResultCode.NONE


@pytest.mark.parametrize('broken', [[[9, 3], [9, 11]], [[9, 3]], []])
def test_the_validator_withholds_the_path_of_a_broken_search(monkeypatch, broken):
    path = np.array(broken, dtype=np.int32).reshape(-1, 2)

    @search_method()
    def broken_search(problem):
        return SearchResult(SearchStatus.FOUND, 1, 1, np.zeros_like(problem.blocked), path, 8.0)

    monkeypatch.setitem(SEARCH_METHODS.loaded, 'astar', broken_search)
    plan = PLANNER.plan(PlanRequest(START, GOAL, 'astar'))
    assert plan.code is ResultCode.UNKNOWN
    assert 'withheld' in plan.message
    assert len(plan.path) == 0


def test_one_planner_serves_many_threads_alike():
    expected = PLANNER.plan(PlanRequest(START, GOAL, source=FixedReply('[[3, 7], [3, 9]]')))
    plans = []

    def work():
        for _ in range(20):
            plans.append(
                PLANNER.plan(PlanRequest(START, GOAL, source=FixedReply('[[3, 7], [3, 9]]')))
            )

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(plans) == 80
    assert {(plan.expansions, plan.storage, plan.length) for plan in plans} == {
        (expected.expansions, expected.storage, expected.length)
    }
