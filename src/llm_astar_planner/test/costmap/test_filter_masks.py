"""What the values of Nav2's filter masks cost, and where they lie on a map."""

import math

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zone_layer import (
    FilterInfo,
    FilterKind,
    FilterMask,
    ZoneLayer,
    filter_info,
    mask_costs,
)
from llm_astar_planner.costmap.zones import ZonesError

COSTMAP = CostmapConfig(occupied_threshold=99, unknown_cost=0)
KEEPOUT = FilterInfo(FilterKind.KEEPOUT, 'mask')
PERCENT = FilterInfo(FilterKind.SPEED_PERCENT, 'mask')


def costs(info, config=COSTMAP, max_speed=0.0):
    return mask_costs(info, config, max_speed).tolist()


def test_only_the_highest_value_of_a_keepout_mask_closes_a_cell():
    table = costs(KEEPOUT)
    assert (table[0], table[1], table[98], table[99], table[100]) == (-1, 1, 98, 98, 100)
    assert max(costs(KEEPOUT, CostmapConfig())[:100]) == 64


def test_a_speed_limit_costs_the_time_that_it_takes():
    table = costs(PERCENT)
    for percent in (60, 70, 80, 99):
        factor = 1 + COSTMAP.cost_travel_multiplier * max(table[percent], 0) / 100
        assert factor == pytest.approx(100 / percent, abs=0.011)
    # At half the speed a way takes twice as long: 1 + 2 * 50 / 100.
    assert (table[50], table[20], table[1]) == (50, 98, 98)
    assert (table[0], table[100]) == (-1, -1), 'no limit'
    assert set(costs(PERCENT, CostmapConfig(cost_travel_multiplier=0.0))) == {-1}


def test_base_and_multiplier_turn_values_into_limits_as_in_nav2():
    table = costs(PERCENT._replace(base=100.0, multiplier=-1.0))
    assert (table[50], table[0], table[100]) == (50, -1, -1)
    absolute = FilterInfo(FilterKind.SPEED_ABSOLUTE, 'mask', 0.0, 0.01)
    assert costs(absolute, max_speed=1.0)[50] == 50
    assert costs(absolute, max_speed=0.5)[25] == 50
    assert costs(absolute, max_speed=0.5)[50:] == [-1] * 51
    with pytest.raises(ZonesError, match='set the parameter max_speed'):
        costs(absolute)


def test_a_wrong_info_is_refused_by_field():
    assert filter_info(0, '/mask', 0.0, 1.0) == FilterInfo(FilterKind.KEEPOUT, '/mask')
    for wrong, problem in (
        ((3, '/mask', 0.0, 1.0), 'type: 3'),
        ((0, '', 0.0, 1.0), 'filter_mask_topic'),
        ((1, '/mask', math.nan, 1.0), 'base'),
        ((1, '/mask', 0.0, math.inf), 'multiplier'),
    ):
        with pytest.raises(ZonesError, match=problem):
            filter_info(*wrong)


@pytest.mark.parametrize('seed', range(12))
def test_the_masks_value_at_the_centre_of_a_cell_counts(seed):
    random = np.random.default_rng(seed)
    values = random.integers(-1, 101, (9, 7), dtype=np.int8)
    turned = float(random.choice([0.0, 0.0, 0.7]))
    mask = GridMap(values, random.uniform(0.3, 2.0), Pose2D(*random.uniform(-2, 4, 2), turned))
    own = random.choice(np.array([-1, 0, 50, 100], dtype=np.int8), (12, 16))
    turned = float(random.choice([0.0, -0.4]))
    grid_map = GridMap(own, 0.5, Pose2D(*random.uniform(-1, 1, 2), turned))
    composed = ZoneLayer(grid_map, masks=[FilterMask(KEEPOUT, mask)], config=COSTMAP).compose(
        grid_map
    )
    table = costs(KEEPOUT)
    for y in range(grid_map.height):
        for x in range(grid_map.width):
            cell = mask.world_to_cell(*grid_map.grid_to_world([[x, y]])[0])
            value = mask.cells[cell[1], cell[0]] if mask.contains(cell) else -1
            cost = table[value] if value >= 0 else -1
            assert composed.cells[y, x] == max(own[y, x], cost), (x, y)


def test_a_value_of_zero_leaves_unknown_cells_unknown():
    grid_map = GridMap(np.full((3, 3), -1, dtype=np.int8))
    mask = FilterMask(KEEPOUT, GridMap(np.zeros((3, 3), dtype=np.int8)))
    assert (ZoneLayer(grid_map, masks=[mask]).compose(grid_map).cells == -1).all()
