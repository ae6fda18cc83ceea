"""The robot's body on a map, against the definition taken cell by cell."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.map_server import load_map
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import inflate
from llm_astar_planner.planning.path_validator import CollisionChecker
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.resources import find_file
from scipy import ndimage


def post(size=21, value=100, resolution=0.05):
    """A map with one lethal cell in its middle."""
    cells = np.zeros((size, size), dtype=np.int8)
    cells[size // 2, size // 2] = value
    return GridMap(cells, resolution)


def by_definition(grid_map, rules):
    """Blocked and cost of every cell, from its distances to all lethal ones."""
    cells = grid_map.cells
    lethal = np.argwhere(cells >= rules.occupied_threshold)
    blocked = np.zeros(cells.shape, dtype=bool)
    cost = cells.astype(int)
    for place in np.ndindex(cells.shape):
        squared = min(((lethal - place) ** 2).sum(axis=1), default=math.inf)
        metres = math.sqrt(squared) * grid_map.resolution
        unknown = cells[place] < 0 and not rules.allow_unknown
        blocked[place] = metres <= rules.robot_radius + 1e-9 or unknown
        if metres <= rules.inflation_radius + 1e-9:
            beyond = max(metres - rules.robot_radius, 0.0)
            graded = 98 * math.exp(-rules.cost_scaling_factor * beyond)
            least = cells[place] if cells[place] >= 0 else rules.unknown_cost
            if round(graded) > least:
                cost[place] = round(graded)
    return blocked, cost


@st.composite
def bodies(draw):
    shape = draw(st.integers(1, 14)), draw(st.integers(1, 14))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    cells = random.choice(
        [-1, 0, 30, 64, 65, 99, 100], shape, p=[0.1, 0.6, 0.1, 0.05, 0.05, 0.05, 0.05]
    )
    rules = CostmapConfig(
        occupied_threshold=draw(st.sampled_from([65, 99, 100])),
        allow_unknown=draw(st.booleans()),
        robot_radius=draw(st.sampled_from([0.0, 0.05, 0.1, 0.17, 0.3])),
        inflation_radius=draw(st.sampled_from([0.0, 0.1, 0.25, 0.4])),
        cost_scaling_factor=draw(st.sampled_from([0.0, 3.0, 10.0])),
        unknown_cost=draw(st.sampled_from([0, 40, 98])),
    )
    return GridMap(cells.astype(np.int8), draw(st.sampled_from([0.05, 0.1]))), rules


@settings(max_examples=60)
@given(bodies())
def test_inflation_is_what_its_definition_says(body):
    grid_map, rules = body
    blocked, cost = inflate(grid_map, rules)
    expected_blocked, expected_cost = by_definition(grid_map, rules)
    np.testing.assert_array_equal(blocked, expected_blocked)
    free = ~blocked
    np.testing.assert_array_equal(cost[free], expected_cost[free])


@pytest.mark.parametrize('seed', range(20))
def test_large_maps_are_inflated_as_by_scipys_distance_transform(seed):
    """Over many bands of rows, and with radii up to more than the map."""
    random = np.random.default_rng(seed)
    shape = random.integers(1, 260, 2)
    cells = random.choice([-1, 0, 40, 100], shape, p=[0.1, 0.8, 0.0995, 0.0005]).astype(np.int8)
    robot, inflation = random.choice([0.0, 0.01, 0.2, 1.0, 10.0], 2)
    rules = CostmapConfig(
        robot_radius=robot,
        inflation_radius=inflation,
        cost_scaling_factor=0.5,
        allow_unknown=False,
        unknown_cost=0,
    )
    blocked, cost = inflate(GridMap(cells, 0.05), rules)
    expected_blocked, expected_cost = cells < 0, cells
    if robot or inflation:
        lethal = cells == 100
        distances = ndimage.distance_transform_edt(~lethal) if lethal.any() else np.inf
        metres = 0.05 * np.sqrt(np.rint(np.square(np.broadcast_to(distances, shape))))
        expected_blocked = expected_blocked | (metres <= robot + 1e-9)
        graded = np.rint(98 * np.exp(-0.5 * np.maximum(metres - robot, 0.0)))
        graded = np.where(metres <= inflation + 1e-9, graded, 0)
        expected_cost = np.where(graded > 0, np.maximum(cells, graded), cells)
    np.testing.assert_array_equal(blocked, expected_blocked | (cells == 100))
    np.testing.assert_array_equal(cost, expected_cost)


@settings(max_examples=60)
@given(bodies())
def test_the_collision_checker_blocks_the_cells_that_inflation_blocks(body):
    grid_map, rules = body
    checker, blocked = CollisionChecker(grid_map, rules), inflate(grid_map, rules)[0]
    for y, x in np.ndindex(blocked.shape):
        problem = checker.path_problem(np.array([[x, y]]), (x, y), (x, y))
        assert (problem is not None) == blocked[y, x]


def test_a_cell_at_exactly_the_radius_is_inscribed_as_in_nav2():
    blocked, _ = inflate(post(), CostmapConfig(robot_radius=0.2))
    assert blocked[10, 6]  # 4 cells of 0.05 m off
    assert not blocked[10, 5]
    assert blocked[10].sum() == 9


def test_costs_decay_as_nav2s_do_and_stay_below_inscribed():
    rules = CostmapConfig(robot_radius=0.1, inflation_radius=0.3, cost_scaling_factor=5.0)
    _, cost = inflate(post(), rules)
    row = cost[10, 10:].tolist()
    decay = [round(98 * math.exp(-5.0 * 0.05 * (step - 2))) for step in range(3, 7)]
    assert row == [100, 98, 98, *decay, 0, 0, 0, 0]


def test_the_inflation_of_a_very_fine_map_needs_no_more_memory_than_its_cells():
    rules = CostmapConfig(inflation_radius=0.55, cost_scaling_factor=0.0)
    _, cost = inflate(post(resolution=2e-6), rules)
    assert sorted(set(cost.flat)) == [98, 100]


def test_without_radii_a_map_is_taken_as_it_is():
    grid_map = post(value=70)
    blocked, cost = inflate(grid_map, CostmapConfig())
    assert cost is grid_map.cells
    np.testing.assert_array_equal(blocked, grid_map.cells >= 65)


def test_a_costmaps_bands_block_from_99_and_grade_below():
    """As Nav2 publishes it: 100 lethal, 99 inscribed, 98 to 1 graded, -1 unknown."""
    cells = np.zeros((7, 40), dtype=np.int8)
    cells[1:6, 18:22] = [[40], [98], [99], [98], [40]]
    cells[1, 20] = -1
    rules = CostmapConfig(occupied_threshold=99, cost_travel_multiplier=2.0)
    planner = Planner(GridMap(cells, 0.05), rules)
    np.testing.assert_array_equal(planner.costmap.blocked, cells == 99)
    surcharge = planner.costmap.grid_graph.cell_surcharge.reshape(cells.shape) / 256.0
    assert surcharge[2, 18] == pytest.approx(2.0 * 0.98, abs=0.01)
    assert surcharge[1, 20] == surcharge[2, 18]  # unknown cells cost as much
    plan = planner.plan(PlanRequest((2, 2), (37, 2), 'exact_astar'))
    passed = cells[plan.path[:, 1], plan.path[:, 0]]
    assert passed.max() == 0  # round the graded cells, which it may cross
    # With a map's threshold the dear cells are walls.
    assert Planner(GridMap(cells, 0.05)).costmap.blocked[2, 18]


def test_a_path_keeps_away_from_walls_if_there_is_room():
    """Beside a long wall, with room on the other side."""
    cells = np.zeros((30, 80), dtype=np.int8)
    cells[10, 10:70] = 100
    request = PlanRequest((2, 11), (77, 11), 'exact_astar')
    hugging = Planner(GridMap(cells, 0.1), CostmapConfig(robot_radius=0.2)).plan(request)
    rules = CostmapConfig(robot_radius=0.2, inflation_radius=0.8, cost_scaling_factor=3.0)
    keeping = Planner(GridMap(cells, 0.1), rules).plan(request)
    assert 0.2 < hugging.clearance < 0.31
    assert keeping.clearance > 0.5
    assert hugging.cost == pytest.approx(hugging.length)
    assert keeping.length <= keeping.cost < 3.0 * keeping.length
    assert keeping.length > hugging.length


def test_a_gap_narrower_than_the_robot_is_closed():
    cells = np.zeros((20, 20), dtype=np.int8)
    cells[:, 10] = 100
    cells[8:13, 10] = 0  # five cells: 0.25 m
    request = PlanRequest((2, 10), (17, 10))
    for radius, code in ((0.1, ResultCode.NONE), (0.15, ResultCode.NO_VALID_PATH)):
        plan = Planner(GridMap(cells, 0.05), CostmapConfig(robot_radius=radius)).plan(request)
        assert plan.code is code


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('robot_radius', -0.1),
        ('robot_radius', math.nan),
        ('inflation_radius', math.inf),
        ('cost_scaling_factor', -1.0),
        ('occupied_threshold', 0),
        ('cost_travel_multiplier', math.nan),
    ],
)
def test_impossible_rules_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        CostmapConfig(**{name: value})


def test_a_robot_gets_about_a_warehouse_without_touching_it():
    grid_map = load_map(find_file('instructions/warehouse.yaml', 'maps'))
    rules = CostmapConfig(robot_radius=0.2, inflation_radius=0.55, cost_scaling_factor=3.0)
    planner = Planner(grid_map, rules)
    components = planner.costmap.components[:, :]
    whole = np.bincount(components[components > 0]).argmax()
    places = np.argwhere(components == whole)[:, ::-1]
    random = np.random.default_rng(0)
    for start, goal in random.choice(places, (20, 2)).tolist():
        request = PlanRequest(tuple(start), tuple(goal), max_suboptimality=1.1, time_limit=60.0)
        plan = planner.plan(request)
        assert plan.code is ResultCode.NONE, plan.message
        assert plan.clearance > 0.2
        assert plan.suboptimality_bound <= 1.1
