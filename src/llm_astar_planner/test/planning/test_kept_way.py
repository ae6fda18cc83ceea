"""The way of the last plan is kept on the newest map while a new path would gain too little."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from grids import can_see
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_validator import CollisionChecker, via_problem
from llm_astar_planner.planning.plan_reuse import PathHistory, cells_along, way_of
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.grid_graph import path_cost, path_length

# A block in the middle, with a way above it and one below that is as long.
BLOCK = np.zeros((41, 61), dtype=np.int8)
BLOCK[15:26, 20:41] = 100
ASK = PlanRequest((5, 20), (55, 20), max_suboptimality=1.0, switch_margin=0.05)


def changed(*places, cells=BLOCK, **options):
    """Return a planner for the map with the cells [top:bottom, left:right] at places occupied."""
    after = cells.copy()
    for top, bottom, left, right in places:
        after[top:bottom, left:right] = 100
    return Planner(GridMap(after, **options))


BEFORE = changed()


def side_of(plan):
    """Tell on which side of the block a path passes."""
    return 'above' if plan.path[plan.path[:, 0] == 30, 1].min() < 15 else 'below'


def go_on(planner, plan, request=ASK, before=BEFORE, step=0):
    """Plan again with the way of a plan made before, from the cell that is `step` moves on."""
    way = way_of(plan, before.costmap)
    start = tuple(way.cells[step].tolist())
    return planner.plan(replace(request, start=start, last_path=way))


def other_side(plan):
    """Return an obstacle that makes the way of a plan a little longer than that on the other."""
    return (13, 15, 25, 30) if side_of(plan) == 'above' else (26, 28, 25, 30)


@pytest.mark.parametrize('any_angle', [False, True])
def test_the_way_is_kept_while_another_is_a_little_shorter(any_angle):
    request = replace(ASK, any_angle=any_angle)
    first = BEFORE.plan(request)
    after = changed(other_side(first))
    assert side_of(after.plan(request)) != side_of(first)
    # A robot that has passed where its way would have to go round keeps the way that is left.
    planner = Planner(GridMap(np.where(after.grid_map.cells > 0, 100, BLOCK)))
    second = go_on(planner, first, request, step=3)
    assert 'changed: blocked at' in second.message
    third = go_on(BEFORE, second, request, planner)
    assert side_of(third) == side_of(second)
    assert 'kept: ' in third.message


def test_a_kept_path_begins_at_the_robot_and_ends_at_the_goal():
    first = BEFORE.plan(ASK)
    kept = go_on(BEFORE, first, step=10)
    assert kept.path.tolist() == first.path[10:].tolist()
    assert kept.length == pytest.approx(path_length(kept.path))
    assert kept.cost == pytest.approx(path_cost(BEFORE.costmap.grid_graph, kept.path))
    assert kept.message.endswith('kept: at most 0.0 % longer than the best')


def test_a_robot_beside_its_way_joins_it_again():
    first = BEFORE.plan(ASK)
    x, y = first.path[4].tolist()
    way = way_of(first, BEFORE.costmap)
    kept = BEFORE.plan(replace(ASK, start=(x, y + (2 if y <= 20 else -2)), last_path=way))
    assert 'kept: ' in kept.message
    assert side_of(kept) == side_of(first)
    assert BEFORE.checker.path_problem(kept.path, kept.start, kept.goal) is None


def test_a_robot_far_from_its_way_gets_a_new_path_and_reads_why():
    first = BEFORE.plan(ASK)
    far = BEFORE.plan(replace(ASK, start=(5, 38), last_path=way_of(first, BEFORE.costmap)))
    assert 'changed: the robot is ' in far.message
    assert far.path.tolist() == BEFORE.plan(replace(ASK, start=(5, 38))).path.tolist()


def test_what_blocks_the_way_is_named_in_metres():
    planner = changed(resolution=0.5, origin=Pose2D(-3.0, 2.0))
    first = planner.plan(ASK)
    x, y = first.path[25].tolist()
    after = changed((y, y + 1, x, x + 1), resolution=0.5, origin=Pose2D(-3.0, 2.0))
    plan = go_on(after, first, before=planner)
    east, north = -3.0 + 0.5 * (x + 0.5), 2.0 + 0.5 * (y + 0.5)
    assert plan.message.endswith(f'changed: blocked at ({east:.2f}, {north:.2f})')
    assert plan.code is ResultCode.NONE


def test_a_way_that_gains_more_than_the_margin_is_taken():
    walled = changed((0, 15, 30, 31))
    first = walled.plan(replace(ASK, goal=(55, 5)))
    assert side_of(first) == 'below'
    plan = go_on(BEFORE, first, replace(ASK, goal=(55, 5)), walled)
    assert side_of(plan) == 'above'
    old, new = path_length(first.path), path_length(plan.path)
    assert plan.message.endswith(f'changed: {100 * (1 - new / old):.1f} % shorter')
    kept = go_on(BEFORE, first, replace(ASK, goal=(55, 5), switch_margin=1.0), walled)
    assert kept.path.tolist() == first.path.tolist()
    assert kept.message.endswith(f'at most {100 * (old / new - 1):.1f} % longer than the best')


def test_a_way_to_another_goal_is_not_kept():
    first = BEFORE.plan(ASK)
    request = replace(ASK, goal=(55, 22), last_path=way_of(first, BEFORE.costmap))
    assert 'changed: it ends at another cell' in BEFORE.plan(request).message


def test_a_map_that_has_grown_keeps_the_way():
    first = BEFORE.plan(ASK)
    grown = np.pad(BLOCK, ((3, 0), (7, 0)))
    planner = Planner(GridMap(grown, origin=Pose2D(-7.0, -3.0)))
    request = replace(ASK, start=(12, 23), goal=(62, 23), last_path=way_of(first, BEFORE.costmap))
    kept = planner.plan(request)
    assert (kept.path - (7, 3)).tolist() == first.path.tolist()
    assert 'kept: ' in kept.message
    coarser = Planner(GridMap(BLOCK, resolution=0.5))
    plan = coarser.plan(replace(ASK, last_path=way_of(first, BEFORE.costmap)))
    assert 'changed: the map has another resolution or frame' in plan.message


def test_a_search_out_of_time_is_answered_by_the_way_that_is_still_free():
    first = BEFORE.plan(ASK)
    request = replace(ASK, last_path=way_of(first, BEFORE.costmap), time_limit=0.0)
    kept = BEFORE.plan(request)
    assert kept.code is ResultCode.NONE
    assert kept.message.endswith('kept: no better one in time')
    assert kept.path.tolist() == first.path.tolist()


def test_a_cancelled_request_is_not_answered_by_the_last_way():
    first = BEFORE.plan(ASK)
    request = replace(ASK, last_path=way_of(first, BEFORE.costmap))
    stop = np.ones(1, dtype=np.uint8)
    assert 'kept: ' not in BEFORE.plan(request, stop).message


def test_via_points_that_are_left_are_passed_in_their_order():
    request = replace(ASK, via=((30, 5), (50, 35), (30, 35)), goal=(5, 5))
    first = BEFORE.plan(request)
    # At the crossing of its own way, with every via point still to come.
    kept = go_on(BEFORE, first, request, step=5)
    assert kept.path.tolist() == first.path[5:].tolist()
    # And with the first passed.
    passed = next(n for n, cell in enumerate(first.path.tolist()) if cell == [30, 5])
    kept = go_on(BEFORE, first, replace(request, via=request.via[1:]), step=passed + 4)
    assert kept.path.tolist() == first.path[passed + 4 :].tolist()


def test_a_way_that_the_footprint_does_not_pass_is_not_kept():
    first = BEFORE.plan(ASK)
    assert side_of(first) in ('above', 'below')
    footprint = Footprint(((2.5, 1.2), (2.5, -1.2), (-2.5, -1.2), (-2.5, 1.2)))
    request = replace(ASK, footprint=footprint, start_pose=Pose2D(5.5, 20.5))
    plan = go_on(BEFORE, first, request)
    assert plan.code is ResultCode.NONE
    assert 'changed: the footprint' in plan.message
    again = go_on(BEFORE, plan, request)
    assert 'kept: ' in again.message
    assert again.path.tolist() == plan.path.tolist()


def test_at_the_goal_the_way_is_that_cell():
    way = way_of(BEFORE.plan(ASK), BEFORE.costmap)
    for start, moves in ((ASK.goal, 0), ((54, 21), 1)):
        kept = BEFORE.plan(
            replace(ASK, start=start, last_path=way, any_angle=True, smoothing=True)
        )
        assert 'kept: 0.0 % longer' in kept.message
        assert len(kept.path) == moves + 1


def test_costs_count_not_lengths():
    cells = BLOCK.copy()
    planner = Planner(GridMap(cells), CostmapConfig(robot_radius=1.0, inflation_radius=4.0))
    first = planner.plan(ASK)
    rows = slice(0, 15) if side_of(first) == 'above' else slice(26, 41)
    cells[rows, 25:35] = np.maximum(cells[rows, 25:35], 60)
    after = Planner(GridMap(cells), planner.config)
    plan = go_on(after, first, before=planner)
    assert side_of(plan) != side_of(first)
    assert plan.message.endswith('% cheaper')


def test_ways_are_remembered_for_each_key_and_only_where_it_is_asked_for():
    ways, plan = PathHistory(), BEFORE.plan(ASK)
    ways.remember(plan, ASK, 'one', BEFORE.costmap)
    assert ways.add_to(ASK, 'one').last_path is not None
    assert ways.add_to(ASK, 'two').last_path is None
    off = replace(ASK, switch_margin=0.0)
    assert ways.add_to(off, 'one') is off
    ways.clear()
    assert ways.add_to(ASK, 'one').last_path is None


def random_planner(rng, cells):
    """Return a planner for a random map with some cells changed."""
    after = cells.copy()
    for x, y in rng.integers(0, 36, (2, 2)):
        after[y : y + 4, x : x + 4] = 100 * rng.integers(0, 2)
    after[rng.random(cells.shape) < 0.05] = rng.integers(0, 60)
    return Planner(GridMap(after))


@pytest.mark.parametrize('any_angle', [False, True])
def test_on_random_maps_a_kept_path_is_valid_and_within_the_margin(any_angle):
    rng, outcomes = np.random.default_rng(9), set()
    for _ in range(80):
        cells = np.zeros((40, 40), dtype=np.int8)
        for x, y in rng.integers(0, 36, (12, 2)):
            cells[y : y + 6, x : x + 6] = 100
        before, after = random_planner(rng, cells), random_planner(rng, cells)
        free = np.argwhere(~(before.costmap.blocked | after.costmap.blocked))[:, ::-1]
        start, via, goal = (tuple(free[n].tolist()) for n in rng.integers(0, len(free), 3))
        request = replace(ASK, start=start, goal=goal, any_angle=any_angle, switch_margin=0.2)
        request = replace(request, via=(via,) if rng.random() < 0.3 else ())
        first = before.plan(request)
        if first.code:
            continue
        way = way_of(first, before.costmap)
        passed = [n for n, cell in enumerate(way.cells.tolist()) if tuple(cell) in request.via]
        step = int(rng.integers(0, min([len(way.cells), *passed[:1]]) // 2 + 1))
        here = way.cells[step] + rng.integers(-1, 2, 2)
        here = way.cells[step] if after.costmap.blocked[tuple(here.clip(0, 39)[::-1])] else here
        request = replace(request, start=tuple(here.clip(0, 39).tolist()))
        best, plan = after.plan(request), after.plan(replace(request, last_path=way))
        assert plan.code is best.code
        if best.code:
            continue
        outcomes.add(plan.message.split('; ')[-1].split(' ')[0])
        assert after.checker.path_problem(plan.path, request.start, goal) is None
        assert via_problem(plan.path, plan.via) is None
        cost, least = plan.cost, best.cost
        if plan.any_angle is not None:
            assert after.checker.segments_problem(plan.any_angle.points) is None
            assert set(plan.via) <= {tuple(point) for point in plan.any_angle.points.tolist()}
            cost, least = plan.any_angle.cost, best.any_angle.cost
        assert cost <= 1.2 * least + 1e-6
        assert plan.cost <= plan.suboptimality_bound * best.cost + 1e-6
    assert outcomes == {'kept:', 'changed:'}


def test_cells_along_straight_lines_are_legal_moves_where_the_lines_are():
    rng = np.random.default_rng(5)
    seen = 0
    for _ in range(300):
        blocked = rng.random((16, 21)) < 0.1
        planner = Planner(GridMap((100 * blocked).astype(np.int8)))
        free = np.argwhere(~blocked)[:, ::-1]
        ends = [tuple(free[n].tolist()) for n in rng.integers(0, len(free), 2)]
        if not can_see(planner.costmap.grid_graph, *ends):
            continue
        seen += 1
        cells = cells_along(np.array(ends), planner.costmap.blocked)
        assert planner.checker.path_problem(cells, *ends) is None
        assert max(np.abs(b - a).max() for a, b in pairwise([*cells, cells[-1]])) <= 1
    assert seen > 60


def test_cells_along_a_line_in_the_open_are_as_few_as_can_be():
    rng = np.random.default_rng(6)
    blocked = np.zeros((60, 60), dtype=bool)
    checker = CollisionChecker(GridMap(np.zeros((60, 60), dtype=np.int8)), CostmapConfig())
    for begin, end in rng.integers(0, 60, (200, 2, 2)):
        cells = cells_along(np.array([begin, end]), blocked)
        assert len(cells) == np.abs(end - begin).max() + 1
        assert checker.path_problem(cells, tuple(begin), tuple(end)) is None


@pytest.mark.parametrize('any_angle', [False, True])
def test_a_path_with_more_room_on_the_same_way_is_taken_however_little_it_gains(any_angle):
    config = CostmapConfig(inflation_radius=0.6, cost_scaling_factor=3.0)
    cells = np.zeros((60, 200), dtype=np.int8)
    request = replace(ASK, start=(2, 30), goal=(197, 30), any_angle=any_angle)
    before = Planner(GridMap(cells, resolution=0.05), config)
    first = before.plan(request)
    cells[32:36, 98:102] = 100
    after = Planner(GridMap(cells, resolution=0.05), config)
    plan = go_on(after, first, request, before)
    assert plan.message.endswith('% cheaper on the same way')
    room = after.checker.measure(plan.path).clearance, after.checker.measure(first.path).clearance
    assert room[0] > room[1]
