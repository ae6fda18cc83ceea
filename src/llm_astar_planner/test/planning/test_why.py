"""Why there is no path, in numbers and places; and the path as near as possible."""

import math

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zone_layer import FilterInfo, FilterKind, FilterMask, ZoneLayer
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.regions import Box
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.arrays import no_stop

START, GOAL = (5, 20), (35, 20)
# A wall with a door of 7 cells, 0.1 m each, and beside it one of 3.
CELLS = np.zeros((40, 40), dtype=np.int8)
CELLS[:, 20], CELLS[17:24, 20], CELLS[5:8, 20] = 100, 0, 0
ZONE = Zone('z1', shapely.box(1.8, 1.6, 2.3, 2.5), name='wet floor')


def plan(cells=CELLS, config=None, zones=(), masks=(), **fields):
    config = config or CostmapConfig()
    base = GridMap(cells, 0.1)
    grid_map = ZoneLayer(base, zones, masks, config).compose(base)
    request = PlanRequest(**{'start': START, 'goal': GOAL, **fields})
    return Planner(grid_map, config).plan(request)


def kinds(found):
    return [cause['kind'] for cause in found.why.causes]


def test_the_radius_is_named_with_the_most_that_passes_and_where():
    found = plan(config=CostmapConfig(robot_radius=0.45))
    assert kinds(found) == ['radius']
    cause = found.why.causes[0]
    # The door is 7 cells wide: its middle is 4 cells from the wall on both sides.
    assert (cause['radius'], cause['passes']) == (0.45, 0.399)
    assert cause['at'] == pytest.approx([2.05, 2.05])
    assert "the robot's radius of 0.45 m closes the way, of 3.00 m without it" in found.message
    assert 'a radius of 0.399 m passes, at (2.05, 2.05) m' in found.message
    assert plan(config=CostmapConfig(robot_radius=0.399)).code is ResultCode.NONE
    assert plan(config=CostmapConfig(robot_radius=0.4)).code is ResultCode.NO_VALID_PATH


def test_a_costmap_that_was_inflated_before_says_what_would_pass():
    cells = CELLS.copy()
    lethal = np.argwhere(cells == 100)
    y, x = np.mgrid[:40, :40]
    near = (np.hypot(y[..., None] - lethal[:, 0], x[..., None] - lethal[:, 1]) <= 4.5).any(axis=2)
    cells[near & (cells < 100)] = 99
    found = plan(cells, CostmapConfig(occupied_threshold=99))
    assert kinds(found) == ['radius']
    assert found.why.causes[0]['passes'] == 0.399
    assert 'the inflation of the costmap closes the way' in found.message


def test_a_zone_is_named_with_the_length_of_the_way_without_it():
    zones = [ZONE, Zone('z2', shapely.box(0.1, 3.0, 0.5, 3.5))]
    cells = CELLS.copy()
    cells[5:8, 20] = 100
    found = plan(cells, zones=zones, config=CostmapConfig(robot_radius=0.15))
    assert (kinds(found), found.why.causes[0]['name']) == (['zone'], 'z1 (wet floor)')
    assert found.why.length == 3.0
    assert 'zone z1 (wet floor) closes the way, of 3.00 m without it' in found.message


def test_the_nearest_point_is_that_of_all_cells_that_are_reached():
    found = plan(config=CostmapConfig(robot_radius=0.45))
    planner = Planner(GridMap(CELLS, 0.1), CostmapConfig(robot_radius=0.45))
    components = planner.costmap.components[:, :]
    cells = np.argwhere(components == components[START[1], START[0]])[:, ::-1]
    least = 0.1 * np.hypot(*(cells - GOAL).T).min()
    assert found.why.short_of == pytest.approx(least, abs=1e-3)
    assert f'{found.why.short_of:.2f} m off' in found.why.sentence


def test_the_fewest_causes_are_named_and_all_of_them():
    cells = CELLS.copy()
    cells[5:8, 20] = 100
    cells[17:24, 28] = -1
    cells[:17, 28] = cells[24:, 28] = 100
    config = CostmapConfig(robot_radius=0.15, allow_unknown=False)
    found = plan(cells, config, [ZONE])
    assert kinds(found) == ['zone', 'unknown']
    assert 'zone z1 (wet floor) and unknown cells between' in found.message
    assert found.why.causes[1]['from'] == found.why.causes[1]['to'] == [2.85, 2.05]


def test_a_filter_mask_is_named_by_its_topic():
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[:, 20] = 100
    mask = FilterMask(FilterInfo(FilterKind.KEEPOUT, '/keepout'), GridMap(cells, 0.1))
    found = plan(masks=[mask])
    assert (kinds(found), found.why.causes[0]['name']) == (['mask'], '/keepout')


def test_walls_say_how_large_the_room_is_and_who_is_in_it():
    cells = CELLS.copy()
    cells[17:24, 20] = cells[5:8, 20] = 100
    cells[15, 30:], cells[25, 30:], cells[15:26, 30] = 100, 100, 100
    found = plan(cells, CostmapConfig(robot_radius=0.1))
    assert found.why.causes == [{'kind': 'walls', 'room': 'goal', 'area': 0.81}]
    assert 'walls close the room of 0.81 m2 that the goal is in' in found.message


def test_an_end_in_an_obstacle_is_said_so():
    assert plan(goal=(20, 30)).why.causes == [{'kind': 'walls', 'holds': 'goal'}]
    assert plan(start=(20, 30)).why.causes == [{'kind': 'walls', 'holds': 'start'}]


def test_a_required_clause_is_named():
    clause = Avoid(region=Box(1.8, -math.inf, 2.2, math.inf))
    reading = Interpretation('a', Specification((clause,)), 'test', Understanding.WHOLE)
    found = plan(instruction=RouteInstruction(reading, policy=REQUIRE), time_limit=60.0)
    assert kinds(found) == ['clause']
    assert f'the instruction "{clause.sentence()}" closes the way' in found.message


def test_of_via_points_the_first_that_is_cut_off_is_explained():
    cells = CELLS.copy()
    cells[17:24, 20] = cells[5:8, 20] = 100
    found = plan(cells, via=((8, 8), (30, 8), (31, 9)))
    assert found.why.causes[0]['room'] == 'via 2'
    assert found.why.reached == 1


def test_a_goal_within_the_tolerance_is_enough():
    cells = CELLS.copy()
    cells[5:8, 20] = cells[20, 35] = 100
    assert kinds(plan(cells, zones=[ZONE])) == ['walls']
    found = plan(cells, zones=[ZONE], tolerance=0.3)
    assert kinds(found) == ['zone']
    assert found.why.length == pytest.approx(2.7)


def test_the_report_the_json_and_the_plan_say_the_same():
    found = plan(config=CostmapConfig(robot_radius=0.45))
    grid_map = GridMap(CELLS, 0.1)
    assert found.to_dict()['why'] == plan_report(found, grid_map).why == found.why.to_json()
    assert found.why.sentence in found.message


def test_a_partial_path_leads_to_the_nearest_point_and_is_marked():
    found = plan(config=CostmapConfig(robot_radius=0.45), allow_partial_planning=True)
    assert (found.code, found.partial, found.to_dict()['partial']) == (ResultCode.NONE, True, True)
    assert found.message.startswith('partial: ')
    x, y = found.path[-1]
    assert found.why.cell == (x, y)
    assert found.goal_shift == pytest.approx(0.1 * math.dist((x, y), GOAL), abs=1e-3)
    assert any('the path is partial' in warning for warning in found.warnings)
    reached = found.path[:, 0].max()
    assert reached < 20


def test_a_partial_path_passes_the_via_points_before():
    cells = CELLS.copy()
    cells[17:24, 20] = cells[5:8, 20] = 100
    found = plan(cells, via=((8, 30), (30, 8)), allow_partial_planning=True)
    assert found.partial
    assert [8, 30] in found.path.tolist()
    assert found.path[-1].tolist() == [19, 8]


def test_where_the_goal_can_be_reached_nothing_is_partial_or_explained():
    found = plan(allow_partial_planning=True)
    assert (found.code, found.partial, found.why) == (ResultCode.NONE, False, None)


def test_a_robot_that_stands_nearest_already_gets_no_path():
    cells = np.full((9, 9), 100, dtype=np.int8)
    cells[4, 2] = cells[4, 6] = 0
    found = plan(cells, start=(2, 4), goal=(6, 4), allow_partial_planning=True)
    assert found.code is ResultCode.NO_VALID_PATH


def test_what_was_cancelled_is_not_explained():
    stop = no_stop()
    stop[0] = 1
    request = PlanRequest(START, GOAL)
    assert Planner(GridMap(CELLS, 0.1)).plan(request, stop).why is None


def test_many_zones_are_explained_in_few_floods():
    cells = np.zeros((40, 40), dtype=np.int8)
    zones = [
        Zone(f'z{n}', shapely.box(0.2 * n, 0.0, 0.2 * n + 0.1, 4.0)) for n in range(3, 16)
    ] + [Zone(f'a{n}', shapely.box(0.05 * n, 0.1, 0.05 * n + 0.02, 0.3)) for n in range(12)]
    found = plan(cells, zones=zones)
    assert {cause['name'] for cause in found.why.causes} == {f'z{n}' for n in range(3, 16)}


@pytest.mark.parametrize('corner_cutting', [False, True])
def test_corners_count_as_they_do_for_paths(corner_cutting):
    cells = np.zeros((5, 5), dtype=np.int8)
    cells[2, :2] = cells[1, 2:] = 100
    config = CostmapConfig(corner_cutting=corner_cutting)
    found = plan(cells, config, start=(0, 0), goal=(4, 4))
    assert (found.why is None) is corner_cutting


def test_a_plan_with_a_path_searches_the_same_whatever_may_be_asked_after_it():
    plain = plan()
    asked = plan(allow_partial_planning=True)
    assert (plain.expansions, plain.path.tolist()) == (asked.expansions, asked.path.tolist())
