"""The guided search: its suboptimality bound, its work limit, and waypoints that come late."""

import math
import threading

import numpy as np
import pytest
from grids import assert_path, dijkstra, queries
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.search import grid_graph
from llm_astar_planner.search._kernels import astar as kernels
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import (
    HEAD_START,
    GuidedSearch,
    guided,
)
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.problem import SearchProblem
from llm_astar_planner.search.result import SearchStatus

KINDS = ('none', 'random', 'reversed', 'corner', 'thousands', 'duplicates', 'blocked', 'absurd')


def waypoints_of(kind, grid, start, goal, random):
    height, width = grid.blocked.shape
    anywhere = random.uniform(-3.0, (width + 3.0, height + 3.0), (6, 2))
    if kind == 'none':
        return np.empty((0, 2))
    if kind == 'reversed':
        path = exact_astar(grid, start, goal).path[::-3].astype(float)
        return np.concatenate((path, [goal], [start]))
    if kind == 'corner':
        return np.zeros((9, 2))
    if kind == 'thousands':
        return random.uniform(0.0, (width, height), (3000, 2))
    if kind == 'duplicates':
        return np.repeat(anywhere, 40, axis=0)
    if kind == 'blocked':
        return np.argwhere(grid.blocked)[:50, ::-1].astype(float)
    if kind == 'absurd':
        return np.array([[math.nan, 1.0], [math.inf, -math.inf], [1e300, -1e300], [0.5, 0.5]])
    return anywhere


@settings(max_examples=500, deadline=None)
@given(
    query=queries(),
    kind=st.sampled_from(KINDS),
    bound=st.sampled_from([None, 1.0, 1.1, 1.5]),
    with_landmarks=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_suboptimality_bound_holds_and_the_work_is_limited(
    query, kind, bound, with_landmarks, seed
):
    grid, start, goal = query
    waypoints = waypoints_of(kind, grid, start, goal, np.random.default_rng(seed))
    landmarks = Landmarks.build(grid, count=4) if with_landmarks else None
    result = guided(grid, start, goal, waypoints, max_suboptimality=bound, landmarks=landmarks)
    exact = exact_astar(grid, start, goal)
    truth = dijkstra(grid, start, goal)
    reach = max(abs(start[0] - goal[0]), abs(start[1] - goal[1]))
    none = guided(grid, start, goal, [], landmarks=landmarks).expansions
    known = none if math.isfinite(truth) else max(none, reach)
    assert result.plain_expansions <= none
    assert result.guided_expansions <= HEAD_START * known
    assert result.expansions == result.guided_expansions + result.plain_expansions
    if math.isinf(truth):
        assert result.status is SearchStatus.EXHAUSTED
        assert len(result.path) == 0
        return
    assert result.status is SearchStatus.FOUND
    assert_path(grid, result.path, start, goal, result.cost)
    assert result.lower_bound <= exact.cost + 1e-9
    assert result.cost <= result.suboptimality_bound * truth * (1 + 1e-7)
    assert result.suboptimality_bound == pytest.approx(
        max(1.0, result.cost / (result.lower_bound or 1.0))
    )
    if bound is not None:
        assert result.suboptimality_bound <= max(bound, grid.rounding) + 1e-12
    if bound == 1.0:
        assert result.cost <= exact.cost * grid.rounding
    assert result.first_cost >= result.cost
    assert result.first_expansions <= result.expansions


def winding(size=61):
    """Walls with gaps on alternate sides: the path is many times the straight line."""
    blocked = np.zeros((size, size), dtype=bool)
    for index, y in enumerate(range(10, size - 5, 10)):
        blocked[y] = True
        blocked[y, [1, 2, 3] if index % 2 else [-2, -3, -4]] = False
    return blocked


def corners(result):
    path = result.path
    turns = (np.diff(path, n=2, axis=0) != 0).any(axis=1)
    return path[1:-1][turns].astype(float)


def test_good_waypoints_save_most_of_the_work():
    grid = GridGraph(winding())
    exact = exact_astar(grid, (5, 2), (55, 58))
    followed = guided(grid, (5, 2), (55, 58), corners(exact), work_factor=1000.0)
    assert followed.expansions < 0.35 * exact.expansions
    assert followed.cost <= 1.02 * exact.cost
    assert followed.plain_expansions <= 4


def test_without_a_requested_bound_it_ends_at_the_first_path():
    grid = GridGraph(winding())
    exact = exact_astar(grid, (5, 2), (55, 58))
    first = guided(grid, (5, 2), (55, 58), corners(exact), work_factor=1000.0)
    assert first.expansions == first.first_expansions
    assert first.cost == first.first_cost
    assert first.plain_expansions <= 4
    bounded = guided(
        grid, (5, 2), (55, 58), corners(exact), work_factor=1000.0, max_suboptimality=1.0
    )
    assert bounded.first_expansions == first.expansions
    assert bounded.plain_expansions > 0
    assert bounded.cost == exact.cost
    assert bounded.suboptimality_bound == 1.0


def test_landmarks_make_the_proof_cheap():
    grid = GridGraph(winding())
    landmarks = Landmarks.build(grid)
    exact = exact_astar(grid, (5, 2), (55, 58))
    query = (grid, (5, 2), (55, 58), corners(exact))
    without = guided(*query, max_suboptimality=1.1)
    with_landmarks = guided(*query, max_suboptimality=1.1, landmarks=landmarks)
    assert without.suboptimality_bound <= 1.1
    assert with_landmarks.suboptimality_bound <= 1.1
    assert with_landmarks.expansions < 0.5 * without.expansions


def test_bad_waypoints_cost_at_most_three_times_the_work_of_none():
    random = np.random.default_rng(3)
    for _ in range(20):
        blocked = random.random((80, 80)) < 0.25
        blocked[[0, 79], [0, 79]] = False
        grid = GridGraph(blocked)
        landmarks = Landmarks.build(grid)
        # To the far corners and back, again and again.
        far = np.tile([[79.0, 0.0], [0.0, 79.0], [0.0, 0.0]], (30, 1))
        none, followed = (
            guided(grid, (0, 0), (79, 79), waypoints, landmarks=landmarks)
            for waypoints in ([], far)
        )
        assert followed.expansions <= 3.0 * none.expansions
        assert followed.status is none.status


def detour(**options):
    """A search past a wall with two gaps, with a waypoint in the far one."""
    blocked = np.zeros((41, 41), dtype=bool)
    blocked[:, 20] = True
    blocked[[0, 24], 20] = False
    grid = GridGraph(blocked)
    problem = SearchProblem(grid, (0, 20), (40, 20), max_suboptimality=1.0, **options)
    search = GuidedSearch(problem, work_factor=1000.0)
    search.guide([[20.0, 0.0]])
    return grid, search


def test_each_better_path_is_yielded_when_it_is_found():
    grid, search = detour()
    seen = list(search.solutions())
    assert len(seen) > 1
    costs = [solution.cost for solution in seen]
    assert costs == sorted(costs, reverse=True)
    shortest = exact_astar(grid, (0, 20), (40, 20)).cost
    assert costs[-1] == shortest
    for solution in seen:
        assert_path(grid, solution.path, (0, 20), (40, 20), solution.cost)
        assert solution.suboptimality_bound >= solution.cost / shortest
    result = search.result()
    assert result.path.tolist() == seen[-1].path.tolist()
    assert result.first_cost == seen[0].cost
    assert result.first_expansions == seen[0].expansions < result.expansions


def test_the_caller_may_stop_at_the_first_path():
    _, search = detour()
    for solution in search.solutions():
        first = solution
        break
    result = search.result()
    assert result.status is SearchStatus.STOPPED
    assert result.path.tolist() == first.path.tolist()
    assert result.suboptimality_bound == first.suboptimality_bound > 1.0


def test_until_waypoints_arrive_it_is_an_exact_search():
    search = GuidedSearch(SearchProblem(GridGraph(winding()), (5, 2), (55, 58)))
    with pytest.raises(RuntimeError, match='not run'):
        search.result()
    assert [solution.suboptimality_bound for solution in search.solutions()][-1] == 1.0
    result = search.result()
    exact = exact_astar(winding(), (5, 2), (55, 58))
    assert result.expansions == result.plain_expansions > 0
    assert result.cost == exact.cost


def test_without_waypoints_it_is_an_exact_search_that_landmarks_speed_up():
    grid = GridGraph(winding())
    none = guided(grid, (5, 2), (55, 58), [])
    helped = guided(grid, (5, 2), (55, 58), [], landmarks=Landmarks.build(grid))
    assert helped.guided_expansions == 0
    assert helped.suboptimality_bound == 1.0
    assert helped.cost == none.cost
    assert helped.expansions < 0.5 * none.expansions


def test_waypoints_may_arrive_while_it_runs(monkeypatch):
    monkeypatch.setattr('llm_astar_planner.search.guided.EXPANSION_SLICE', 4096)
    grid = GridGraph(winding(201), corner_cutting=True)
    exact = exact_astar(grid, (5, 2), (195, 198))
    search = GuidedSearch(SearchProblem(grid, (5, 2), (195, 198)), work_factor=1.0)
    plain = kernels.astar
    slices = []

    def astar(*arguments):
        slices.append(arguments)
        if len(slices) == 2:
            # The reply comes from another thread, after two slices.
            reply = threading.Thread(target=search.guide, args=(corners(exact),))
            reply.start()
            reply.join()
        return plain(*arguments)

    monkeypatch.setattr(kernels, 'astar', astar)
    for _ in search.solutions():
        pass
    result = search.result()
    assert result.guided_expansions > 0
    assert 0 < result.plain_expansions < exact.expansions
    assert result.status is SearchStatus.FOUND


def test_new_waypoints_replace_the_previous_ones():
    grid = GridGraph(winding(201))
    exact = exact_astar(grid, (5, 2), (195, 198))
    search = GuidedSearch(SearchProblem(grid, (5, 2), (195, 198)))
    search.guide([[195.0, 5.0]] * 3)
    search.guide(corners(exact))
    for _ in search.solutions():
        pass
    once = guided(grid, (5, 2), (195, 198), corners(exact))
    assert search.result().expansions == once.expansions


def test_a_raised_stop_flag_ends_it_with_the_best_path_so_far():
    stop = np.zeros(1, dtype=np.uint8)
    _, search = detour(stop=stop)
    for _ in search.solutions():
        stop[0] = 1
    result = search.result()
    assert result.status is SearchStatus.STOPPED
    assert len(result.path) > 0
    assert result.suboptimality_bound > 1.0
    nothing = GuidedSearch(SearchProblem(GridGraph(winding(301)), (5, 2), (290, 285), stop=stop))
    assert list(nothing.solutions()) == []
    assert nothing.result().status is SearchStatus.STOPPED
    assert nothing.result().suboptimality_bound == math.inf


def test_start_as_goal_is_a_path_of_one_cell():
    for waypoints in ([], [[3.0, 3.0]]):
        result = guided(np.zeros((5, 5), dtype=bool), (1, 2), (1, 2), waypoints)
        assert result.status is SearchStatus.FOUND
        assert result.path.tolist() == [[1, 2]]
        assert result.suboptimality_bound == 1.0


def test_a_blocked_start_or_goal_has_no_path():
    blocked = np.zeros((3, 3), dtype=bool)
    blocked[0, 0] = True
    for start, goal in (((0, 0), (2, 2)), ((2, 2), (0, 0)), ((0, 0), (0, 0))):
        assert guided(blocked, start, goal, []).status is SearchStatus.EXHAUSTED


def test_numbers_out_of_range_are_refused():
    free = np.zeros((3, 3), dtype=bool)
    with pytest.raises(ValueError, match='max_suboptimality'):
        guided(free, (0, 0), (2, 2), [], max_suboptimality=0.9)
    with pytest.raises(ValueError, match='max_suboptimality'):
        guided(free, (0, 0), (2, 2), [], max_suboptimality=math.nan)
    with pytest.raises(ValueError, match='weight'):
        guided(free, (0, 0), (2, 2), [], weight=0.5)
    with pytest.raises(ValueError, match='off a grid'):
        guided(free, (0, 0), (3, 2), [])
    with pytest.raises(ValueError, match='waypoints: shape'):
        guided(free, (0, 0), (2, 2), [[1.0, 2.0, 3.0]])


def test_landmarks_of_another_map_are_refused():
    landmarks = Landmarks.build(GridGraph(np.zeros((4, 4), dtype=bool)))
    with pytest.raises(ValueError, match='landmarks'):
        guided(np.zeros((5, 4), dtype=bool), (0, 0), (2, 2), [], landmarks=landmarks)


def test_a_very_long_path_is_searched_in_coarse_units():
    grid = GridGraph(np.zeros((2, 400), dtype=bool))
    huge = GridGraph(grid.blocked)
    huge.set_units(*(value * 4000 for value in grid_graph.FINE_UNITS))
    huge.ring = 1 << 20
    fine = exact_astar(grid, (0, 0), (399, 1))
    for waypoints in ([], [[200.0, 1.0]]):
        result = guided(huge, (0, 0), (399, 1), waypoints, max_suboptimality=1.0)
        assert result.length == fine.length
        assert result.suboptimality_bound == 1.0


@pytest.mark.parametrize('seed', [216, 458, 1909, 2343])
def test_a_path_is_never_replaced_by_one_that_costs_more(seed):
    """On these grids the goal's g falls to a cost above that of the path already found."""
    random = np.random.default_rng(seed)
    cost, waypoints = random.integers(0, 101, (8, 8)), random.uniform(0.0, 8.0, (4, 2))
    grid = GridGraph(np.zeros((8, 8), dtype=bool), cost=cost, cost_multiplier=20.0)
    search = GuidedSearch(SearchProblem(grid, (0, 0), (7, 7)))
    search.guide(waypoints)
    costs = [solution.cost for solution in search.solutions()]
    assert costs == sorted(costs, reverse=True)
    assert search.result().cost == costs[-1]
