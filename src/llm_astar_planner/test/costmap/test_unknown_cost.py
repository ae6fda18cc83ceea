"""What unknown cells cost, against a Dijkstra on the map's own cells."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import Interpretation, RouteInstruction
from llm_astar_planner.instructions.regions import Disc
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.waypoints.baselines import BaselineSource

# Surcharges are stored in 1/256, so a cost may be off by this share.
ROUNDING = 1.0 / 256.0


def least_cost(grid_map, config, start, goal):
    """The least cost in cells from the rules of docs/robot.md, without a radius."""
    cells = grid_map.cells
    height, width = cells.shape

    def occupancy(x, y):
        return float(cells[y, x]) if cells[y, x] >= 0 else float(config.unknown_cost)

    def is_free(x, y):
        return 0 <= x < width and 0 <= y < height and cells[y, x] < config.occupied_threshold

    best, heap = {start: 0.0}, [(0.0, start)]
    while heap:
        cost, (x, y) = heapq.heappop(heap)
        if (x, y) == goal:
            return cost
        if cost > best[x, y]:
            continue
        for dx, dy in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b):
            other = x + dx, y + dy
            if not (is_free(*other) and is_free(x, other[1]) and is_free(other[0], y)):
                continue
            mean = (occupancy(x, y) + occupancy(*other)) / 200.0
            new = cost + math.hypot(dx, dy) * (1.0 + config.cost_travel_multiplier * mean)
            if new < best.get(other, math.inf):
                best[other] = new
                heapq.heappush(heap, (new, other))
    return math.inf


@st.composite
def problems(draw):
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = draw(st.integers(6, 24)), draw(st.integers(6, 24))
    cells = np.where(random.random(shape) < 0.15, 100, 0)
    y, x = random.integers(0, shape[0]), random.integers(0, shape[1])
    cells[y : y + 9, x : x + 9] = -1
    cells[random.random(shape) < draw(st.sampled_from([0.0, 0.1]))] = -1
    dear = random.random(shape) < draw(st.sampled_from([0.0, 0.2]))
    cells = np.where(dear & (cells == 0), 50, cells)
    cells[0, 0] = cells[-1, -1] = 0
    config = CostmapConfig(
        unknown_cost=draw(st.sampled_from([0, 30, 98])),
        cost_travel_multiplier=draw(st.sampled_from([0.0, 2.0, 10.0])),
    )
    return GridMap(cells.astype(np.int8), 0.05), config


@settings(max_examples=80)
@given(problems(), st.sampled_from([1.0, 1.1, None]), st.booleans())
def test_costs_and_bounds_hold_against_an_independent_search(problem, bound, with_source):
    grid_map, config = problem
    start, goal = (0, 0), (grid_map.width - 1, grid_map.height - 1)
    least = least_cost(grid_map, config, start, goal)
    planner = Planner(grid_map, config)
    source = BaselineSource('coarse') if with_source else None
    exact = planner.plan(PlanRequest(start, goal, 'exact_astar'))
    guided = planner.plan(PlanRequest(start, goal, source=source, max_suboptimality=bound))
    if math.isinf(least):
        assert exact.code is guided.code is ResultCode.NO_VALID_PATH
        return
    assert exact.cost == pytest.approx(least, rel=ROUNDING)
    assert guided.cost <= least * guided.suboptimality_bound * (1.0 + 1e-7)
    # Prices are rounded, so that the bound of a cheapest path may be above 1.
    least_bound = planner.costmap.grid_graph.rounding
    assert guided.suboptimality_bound <= max(bound or math.inf, least_bound)
    assert guided.cost >= least * (1.0 - ROUNDING)


def aisles(unknown=-1, shape=(21, 40)):
    """Two ways round a wall: a short one through unknown cells, a longer known one."""
    cells = np.zeros(shape, dtype=np.int8)
    cells[3:18, 10:30] = 100
    cells[:3, 10:30] = unknown
    return GridMap(cells, 0.05)


START, GOAL = (5, 6), (34, 6)


@pytest.mark.parametrize('method', ['guided', 'exact_astar'])
def test_a_path_prefers_a_known_aisle(method):
    """As long as it is no longer than the unknown one is more expensive."""
    request = PlanRequest(START, GOAL, method, max_suboptimality=1.0, any_angle=True)
    known = Planner(aisles()).plan(request)
    free = Planner(aisles(), CostmapConfig(unknown_cost=0)).plan(request)
    assert known.unknown_length == 0.0
    assert free.unknown_length > 0.9
    assert known.length > free.length == pytest.approx(free.cost)
    # As a cell of occupancy 98 does; that is what an unknown one is taken for.
    graded = Planner(aisles(98), CostmapConfig(occupied_threshold=99)).plan(request)
    np.testing.assert_array_equal(graded.path, known.path)
    assert graded.cost == known.cost
    assert graded.any_angle.cost == known.any_angle.cost
    np.testing.assert_array_equal(graded.any_angle.points, known.any_angle.points)


def test_the_papers_methods_count_lengths_alone():
    plans = [
        Planner(aisles(), CostmapConfig(unknown_cost=cost)).plan(PlanRequest(START, GOAL, 'astar'))
        for cost in (0, 98)
    ]
    np.testing.assert_array_equal(plans[0].path, plans[1].path)
    assert plans[0].cost == plans[1].cost == plans[1].length
    assert plans[1].unknown_length > 0.9


def test_an_instruction_keeps_to_known_aisles_too():
    """Both in the search that visits and in that which only closes cells."""
    visit = Visit(regions=(Disc(1.7, 0.8, 0.1),))
    instruction = RouteInstruction(Interpretation('', Specification((visit,))))
    request = PlanRequest(START, GOAL, instruction=instruction)
    assert Planner(aisles()).plan(request).unknown_length == 0.0
    plan = Planner(aisles(), CostmapConfig(unknown_cost=0)).plan(request)
    assert plan.unknown_length > 0.9


def test_inflation_raises_an_unknown_cell_and_never_lowers_it():
    cells = np.full((9, 9), -1, dtype=np.int8)
    cells[4, 4] = 100
    cells[4, :4] = 0
    rules = {'inflation_radius': 0.2, 'cost_scaling_factor': 10.0}
    layers = {}
    for unknown_cost in (0, 40, 98):
        costmap = Costmap(GridMap(cells, 0.05), CostmapConfig(unknown_cost=unknown_cost, **rules))
        layers[unknown_cost] = costmap.grid_graph.cell_surcharge.reshape(cells.shape) / 512.0
    inflation = layers[0]
    assert inflation[4, 3] == layers[98][4, 3] > 0.5
    unknown = cells < 0
    for unknown_cost in (40, 98):
        expected = np.maximum(inflation, unknown_cost / 100.0)[unknown]
        assert layers[unknown_cost][unknown] == pytest.approx(expected, abs=ROUNDING)
        np.testing.assert_array_equal(layers[unknown_cost][~unknown], inflation[~unknown])


def test_maps_without_unknown_cells_have_uniform_costs_as_before():
    grid_map = GridMap(np.zeros((5, 5), dtype=np.int8))
    assert Costmap(grid_map).grid_graph.cell_surcharge.size == 0
    blocked = Costmap(aisles(), CostmapConfig(allow_unknown=False))
    assert blocked.grid_graph.cell_surcharge.size == 0
    assert Costmap(aisles(), CostmapConfig(unknown_cost=0)).grid_graph.cell_surcharge.size == 0
    assert Costmap(aisles()).grid_graph.cell_surcharge.size == 21 * 40


def test_landmarks_and_increments_follow_when_a_sensor_makes_cells_known():
    request = PlanRequest(START, GOAL, max_suboptimality=1.0)
    before = Planner(aisles()).prepare()
    assert before.plan(request).unknown_length == 0.0
    after = Planner(aisles(0), before.config, landmarks=before.landmarks, previous=before)
    plan = after.prepare().plan(request)
    assert plan.cost == Planner(aisles(0)).plan(request).cost < before.plan(request).cost
    again = Planner(aisles(), before.config, landmarks=before.landmarks, previous=after).prepare()
    assert again.plan(request).cost == before.plan(request).cost
    before.landmarks.close()


@pytest.mark.parametrize('cost', [-1, 99, math.nan])
def test_a_cost_out_of_range_is_refused(cost):
    with pytest.raises(ParameterError, match='unknown_cost'):
        CostmapConfig(unknown_cost=cost)
