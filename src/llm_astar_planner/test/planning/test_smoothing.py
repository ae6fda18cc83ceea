"""Kinks of a path are rounded by arcs that stay on free cells and cost hardly more."""

import math
from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_planner import MOST_SMOOTHED, curve_measures
from llm_astar_planner.planning.path_validator import curve_cells, footprint_problem
from llm_astar_planner.planning.plan_reuse import way_of
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.smoothing import smoothed
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.any_angle import interpolate

BEND = [(0, 0), (20, 0), (20, 20)]
WALL = np.zeros((40, 60), dtype=np.int8)
WALL[:25, 30:33] = 100
ASK = PlanRequest((10, 10), (50, 10), any_angle=True, smoothing=True, max_suboptimality=1.0)


def turns(points):
    """Return by how many degrees a path turns at each point."""
    steps = np.diff(points, axis=0)
    yaws = np.arctan2(steps[:, 1], steps[:, 0])
    return np.degrees(np.abs((np.diff(yaws) + np.pi) % (2.0 * np.pi) - np.pi))


def everywhere(_):
    return True


def test_an_arc_touches_both_lines_and_stays_within_the_bend():
    curve = smoothed(BEND, everywhere, 10.0)
    assert curve[0].tolist() == [0.0, 0.0]
    assert curve[-1].tolist() == [20.0, 20.0]
    assert turns(curve).max() < 9.0
    assert np.hypot(*np.diff(curve, axis=0).T).max() <= 1.0 + 1e-9
    # Its centre is where both lines are 10 cells away.
    on_arc = curve[(curve[:, 0] > 10.5) & (curve[:, 1] < 9.5)]
    assert np.hypot(*(on_arc - (10.0, 10.0)).T) == pytest.approx(10.0)


@pytest.mark.parametrize('turn', [5.0, 60.0, 120.0, 170.0, -5.0, -60.0, -170.0])
def test_a_bend_to_either_side_is_rounded_however_sharp(turn):
    angle = math.radians(30.0 + turn)
    corner = 30.0 * np.array([math.cos(math.pi / 6.0), 0.5])
    points = [(0.0, 0.0), corner, corner + 30.0 * np.array([math.cos(angle), math.sin(angle)])]
    curve = smoothed(points, everywhere, 12.0)
    assert turns(curve).max() < 9.0
    assert turns(curve).sum() == pytest.approx(abs(turn), abs=0.1)


def test_an_arc_gets_smaller_until_it_is_free_and_is_left_out_where_none_is():
    def is_free(points):
        return bool((np.hypot(*(points - (20.0, 0.0)).T) < 3.0).all())

    curve = smoothed(BEND, is_free, 10.0)
    assert turns(curve).max() < 45.0
    # 10 cells before the bend, then 5, then 2.5.
    assert np.abs(curve[curve[:, 0] <= 17.5, 1]).max() < 1e-9
    assert curve[curve[:, 0] > 17.6, 1].min() > 0.0
    assert smoothed(BEND, lambda _: False, 10.0).tolist() == interpolate(BEND).tolist()


def test_a_path_there_and_back_turns_on_the_spot():
    there_and_back = [(0, 0), (20, 0), (0, 0)]
    assert (
        smoothed(there_and_back, everywhere, 10.0).tolist() == interpolate(there_and_back).tolist()
    )


def test_a_via_point_is_still_passed():
    plan = Planner(GridMap(WALL)).plan(
        replace(ASK, via=((10, 35), (50, 35)), max_suboptimality=None)
    )
    cells = curve_cells(plan.smoothed).tolist()
    assert [10, 35] in cells
    assert [50, 35] in cells
    assert turns(plan.smoothed).max() < 9.0


def test_no_kink_is_left_and_the_path_is_valid_and_no_longer_on_random_maps():
    rng = np.random.default_rng(3)
    config = CostmapConfig(robot_radius=1.0, inflation_radius=4.0, cost_scaling_factor=0.8)
    checked = 0
    for number in range(24):
        cells = np.zeros((60, 80), dtype=np.int8)
        for x, y in rng.integers(0, 60, (14, 2)):
            cells[y : y + 7, x : x + 9] = 100
        planner = Planner(GridMap(cells), config if number % 2 else None)
        free = np.argwhere(~planner.costmap.blocked)[:, ::-1]
        start, goal = (tuple(free[n].tolist()) for n in rng.integers(0, len(free), 2))
        plan = planner.plan(replace(ASK, start=start, goal=goal))
        if plan.code or len(plan.any_angle.points) < 3:
            continue
        checked += 1
        assert turns(plan.smoothed).max() < 30.0
        assert planner.checker.path_problem(curve_cells(plan.smoothed), start, goal) is None
        now = curve_measures(planner.costmap, plan.smoothed)
        then = curve_measures(planner.costmap, interpolate(plan.any_angle.points))
        assert now[0] <= then[0] + 1e-9
        assert now[1] <= MOST_SMOOTHED * then[1]
    assert checked > 8


def test_the_footprint_passes_the_smoothed_path_too():
    planner = Planner(GridMap(WALL))
    footprint = Footprint(((3.0, 1.5), (3.0, -1.5), (-3.0, -1.5), (-3.0, 1.5)))
    request = replace(ASK, footprint=footprint)
    plan = planner.plan(request)
    assert plan.code is ResultCode.NONE
    if plan.smoothed is not None:
        assert footprint_problem(plan.smoothed, planner.costmap, request) is None


def test_a_kept_way_is_smoothed_as_well():
    planner = Planner(GridMap(WALL))
    first = planner.plan(ASK)
    way = way_of(first, planner.costmap)
    start = tuple(way.cells[4].tolist())
    kept = planner.plan(replace(ASK, start=start, last_path=way, switch_margin=0.05))
    assert 'kept: ' in kept.message
    assert kept.any_angle.points[1:].tolist() == first.any_angle.points[1:].tolist()
    assert tuple(kept.smoothed[0].tolist()) == start
    assert turns(kept.smoothed).max() < 9.0


def test_without_smoothing_there_is_no_such_path():
    assert Planner(GridMap(WALL)).plan(replace(ASK, smoothing=False)).smoothed is None


def test_the_cells_that_a_curve_crosses_are_found_between_its_points():
    rng = np.random.default_rng(8)
    for begin, end in rng.uniform(0.0, 12.0, (200, 2, 2)):
        found = {tuple(cell) for cell in curve_cells(interpolate([begin, end])).tolist()}
        fine = begin + np.linspace(0.0, 1.0, 4001)[:, None] * (end - begin)
        assert found >= {tuple(cell) for cell in np.floor(fine + 0.5).astype(int).tolist()}
