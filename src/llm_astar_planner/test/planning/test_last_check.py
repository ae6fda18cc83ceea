"""The last check stands apart: whatever is broken before it, no bad path leaves."""

from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap import costmap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning import endpoints as ends
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.segment import SegmentPlanner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search import any_angle
from llm_astar_planner.search.any_angle import AnyAnglePath
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.methods import METHODS

CELLS = np.zeros((30, 40), dtype=np.int8)
CELLS[8:30, 20] = 100
CELLS[5, 5] = -1
RULES = CostmapConfig(robot_radius=0.15, inflation_radius=0.4)
REQUEST = PlanRequest((10, 20), (30, 20))


def planner(rules=RULES):
    return Planner(GridMap(CELLS, 0.05), rules)


def withheld(plan, words):
    assert plan.code is ResultCode.UNKNOWN
    assert plan.message.startswith('the path found was withheld: ')
    assert words in plan.message
    assert len(plan.path) == 0
    return True


@pytest.mark.parametrize('method', METHODS)
def test_an_inflation_that_lets_the_robot_touch_is_caught(monkeypatch, method):
    def too_small(grid_map, rules):
        return grid_map.blocked(rules.occupied_threshold), grid_map.cells

    monkeypatch.setattr(costmap, 'inflate', too_small)
    plan = planner().plan(PlanRequest((10, 20), (30, 20), method))
    assert withheld(plan, 'hits an obstacle')


def test_an_inflation_that_forgets_unknown_cells_is_caught(monkeypatch):
    def forgetful(grid_map, rules):
        return grid_map.blocked(rules.occupied_threshold), grid_map.cells

    monkeypatch.setattr(costmap, 'inflate', forgetful)
    rules = CostmapConfig(allow_unknown=False, unknown_cost=0)
    plan = planner(rules).plan(PlanRequest((2, 5), (9, 5)))
    assert withheld(plan, 'hits an obstacle at (5, 5)')


def test_an_inflation_without_anything_is_caught(monkeypatch):
    def nothing(grid_map, rules):
        return np.zeros(grid_map.cells.shape, dtype=bool), grid_map.cells

    monkeypatch.setattr(costmap, 'inflate', nothing)
    assert withheld(planner(CostmapConfig()).plan(REQUEST), 'hits an obstacle at (20')


@pytest.mark.parametrize('method', METHODS)
def test_a_search_that_goes_through_walls_is_caught(monkeypatch, method):
    def blind(segment):
        request, free = segment.request, np.zeros_like(segment.costmap.blocked)
        segment.result = exact_astar(free, request.start, request.goal)
        return []

    monkeypatch.setattr(SegmentPlanner, 'search', blind)
    assert withheld(planner().plan(PlanRequest((10, 20), (30, 20), method)), 'hits an obstacle')


def test_a_search_that_skips_a_via_cell_is_caught(monkeypatch):
    real = SegmentPlanner.search

    def skipping(segment):
        yield from real(segment)
        inside = [cell != [10, 4] for cell in segment.result.path.tolist()]
        segment.result.path[~np.array(inside)] += 1

    monkeypatch.setattr(SegmentPlanner, 'search', skipping)
    plan = planner(CostmapConfig()).plan(PlanRequest((2, 2), (18, 2), via=((10, 4),)))
    assert withheld(plan, '')
    monkeypatch.undo()

    def elsewhere(segment):
        """Go by another cell than the one asked for, but without a break."""
        request, grid = segment.request, segment.costmap.blocked
        ends = [
            (cell[0], 6) if cell == (10, 4) else cell for cell in (request.start, request.goal)
        ]
        segment.result = exact_astar(grid, *ends)
        return []

    monkeypatch.setattr(SegmentPlanner, 'search', elsewhere)
    plan = planner(CostmapConfig()).plan(PlanRequest((2, 2), (18, 2), via=((10, 4),)))
    assert withheld(plan, 'does not pass via 1 (10, 4)')


def test_a_shortcut_through_the_robots_body_is_caught(monkeypatch):
    def straight(grid, path, deadline):
        return AnyAnglePath(path[[0, -1]], 20.0, 20.0)

    request = replace(REQUEST, any_angle=True)
    assert planner().plan(request).any_angle is not None
    monkeypatch.setattr(any_angle, 'string_pull', straight)
    plan = planner().plan(request)
    assert plan.code is ResultCode.NONE
    assert plan.any_angle is None


@pytest.mark.parametrize('end', ['start', 'goal', 'via point'])
def test_a_shift_beyond_its_tolerance_is_caught(monkeypatch, end):
    """0.2 m are asked for; a search for the nearest cell that forgets this finds one 0.5 m off."""
    real = ends.squared_cells
    monkeypatch.setattr(ends, 'squared_cells', lambda radius, resolution: real(2.5, resolution))
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[10:29, 10:29] = 100
    occupied, free = (13, 19), (2, 2)
    request = {
        'start': PlanRequest(occupied, free, start_tolerance=0.1),
        'goal': PlanRequest(free, occupied, tolerance=0.1),
        'via point': PlanRequest(free, (35, 2), tolerance=0.1, via=(occupied,)),
    }[end]
    plan = Planner(GridMap(cells, 0.05)).plan(request)
    assert withheld(plan, f'its {end} ')
    assert '2.00 allowed' in plan.message


def test_a_path_can_be_checked_again_on_another_map():
    """What a node does when the map changes under a path it gave out."""
    plan = planner().plan(REQUEST)
    assert planner().checker.path_problem(plan.path, plan.start, plan.goal) is None
    changed = CELLS.copy()
    x, y = (int(value) for value in plan.path[len(plan.path) // 2])
    changed[y + 3, x] = 100  # beside the path: within the body's reach only
    later = Planner(GridMap(changed, 0.05), RULES)
    assert 'hits an obstacle' in later.checker.path_problem(plan.path, plan.start, plan.goal)
    assert planner().checker.path_problem(plan.path, plan.start, (1, 1)).startswith('it runs from')
