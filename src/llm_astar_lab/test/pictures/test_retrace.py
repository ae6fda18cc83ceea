"""The order of expansion of a plan's searches: true, complete, unknown where it hangs on time."""

from dataclasses import replace

import numpy as np
import pytest
from llm_astar_lab.pictures.retrace import retrace
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.regions import Disc
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.segment import target_list
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.methods import METHODS
from llm_astar_planner.waypoints.replay import FixedReply
from reference_trace import trace

REPLY = FixedReply('[[20, 60], [50, 20], [70, 60]]')
START, GOAL = (3, 3), (86, 84)


def random_planner(density, **config):
    rng = np.random.default_rng(3)
    cells = np.where(rng.random((90, 90)) < density, 100, 0).astype(np.int8)
    for x, y in (START, GOAL, (20, 60), (50, 20), (70, 60), (40, 40)):
        cells[y - 1 : y + 2, x - 1 : x + 2] = 0
    return Planner(GridMap(cells, 0.05), CostmapConfig(**config)).prepare()


PLANNERS = {
    'paper': random_planner(0.25, corner_cutting=True),
    'jump points': random_planner(0.05),
    'dense': random_planner(0.25),
}


@pytest.mark.parametrize('name', PLANNERS)
@pytest.mark.parametrize('method', METHODS)
def test_the_order_has_every_expanded_cell_once(name, method):
    planner = PLANNERS[name]
    for bound, via in ((None, ()), (1.0, ()), (None, ((40, 40),))):
        request = PlanRequest(
            START, GOAL, method, None if via else REPLY, max_suboptimality=bound, via=via
        )
        plan = planner.plan(request)
        assert plan.code == 0
        order = retrace(planner, request, plan)
        assert order.expansions == plan.expansions
        cells = order.order
        assert len(np.unique(cells)) == len(cells) == order.cells_after(plan.expansions)
        assert cells[0] == START[1] * 90 + START[0]
        assert np.array_equal(np.sort(cells), np.flatnonzero(plan.expanded))


@pytest.mark.parametrize('method', ['astar', 'llm_astar'])
def test_the_order_is_that_of_an_independent_implementation(method):
    planner = PLANNERS['paper']
    request = PlanRequest(START, GOAL, method, REPLY)
    plan = planner.plan(request)
    targets = target_list(plan.checked_waypoints, START, GOAL)[1:] if 'llm' in method else ()
    traced = trace(planner.costmap.blocked, START, GOAL, targets)
    expected = list(dict.fromkeys(y * 90 + x for x, y in traced.order))
    order = retrace(planner, request, plan)
    assert order.order.tolist() == expected
    count = len(traced.order) // 2
    assert order.cells_after(count) == len(set(traced.order[:count]))


def test_recording_in_larger_steps_changes_nothing(monkeypatch):
    planner = PLANNERS['dense']
    for method in ('guided', 'exact_astar', 'astar'):
        request = PlanRequest(START, GOAL, method, REPLY, max_suboptimality=1.0)
        plan = planner.plan(request)
        one_by_one = retrace(planner, request, plan)
        with monkeypatch.context() as patch:
            patch.setattr('llm_astar_planner.search.expansion_order.MAX_LOOKS', 0)
            coarse = retrace(planner, request, plan)
        assert 50 <= len(coarse.steps) < len(one_by_one.steps)
        for expansions, count in coarse.steps.tolist():
            assert one_by_one.cells_after(expansions) == count
            assert set(one_by_one.order[:count]) == set(coarse.order[:count])


def test_an_order_that_is_not_the_plans_is_not_returned():
    planner = PLANNERS['dense']
    request = PlanRequest(START, GOAL, 'guided', REPLY)
    plan = planner.plan(request)
    other = replace(plan, expansions=plan.expansions + 1)
    assert retrace(planner, request, other) is None
    assert retrace(planner, request, replace(plan, expansions=0)) is None


@pytest.mark.parametrize(
    ('name', 'method'),
    [*(('dense', name) for name in METHODS), ('paper', 'llm_astar'), ('jump points', 'guided')],
)
def test_the_order_of_a_search_that_avoids_an_area_is_known(name, method):
    planner, area = PLANNERS[name], Disc(2.2, 2.2, 0.6)
    request = PlanRequest(START, GOAL, method, REPLY, instruction=by(Avoid(region=area)))
    plan = planner.plan(request)
    assert plan.instruction.satisfied
    order = retrace(planner, request, plan)
    assert order.expansions == plan.expansions
    assert np.array_equal(np.sort(order.order), np.flatnonzero(plan.expanded))
    rows, columns = np.divmod(order.order, 90)
    points = planner.grid_map.grid_to_world(np.stack((columns, rows), axis=1))
    assert np.hypot(*(points - (area.x, area.y)).T).min() > area.radius


def test_the_order_of_a_search_that_visits_regions_is_not_known():
    planner = PLANNERS['dense']
    for clause in (Visit(regions=(Disc(1.0, 3.0, 0.3),)), Avoid(region=Disc(0.2, 0.2, 0.3))):
        request = PlanRequest(START, GOAL, 'guided', REPLY, instruction=by(clause))
        plan = planner.plan(request)
        assert plan.code == 0
        assert retrace(planner, request, plan) is None


def by(clause):
    understood = Interpretation('', Specification((clause,)), status=Understanding.WHOLE)
    return RouteInstruction(understood)
