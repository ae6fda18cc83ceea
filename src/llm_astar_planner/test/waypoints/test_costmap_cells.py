"""Every source may use exactly the cells that the search may use, whatever the costmap's rules."""

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.waypoints.baselines import (
    shortest_route,
    visibility_graph,
)
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.learned import EmbeddedSource
from llm_astar_planner.waypoints.prompts.map_description import Lattice, describe
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery

START, GOAL, GAP = (10, 10), (50, 32), (30, 20)


def wall_with_gap(cost, width=1):
    """Return a map of 61 x 41 cells whose only way across is a gap of this cost and width."""
    cells = np.zeros((41, 61), dtype=np.int8)
    cells[:, GAP[0]] = 100
    cells[GAP[1] - width // 2 : GAP[1] + width // 2 + 1, GAP[0]] = cost
    return GridMap(cells, resolution=0.1)


GRADED = wall_with_gap(80)
NARROW = wall_with_gap(0, width=5)
CASES = pytest.mark.parametrize(
    ('grid_map', 'config', 'is_open'),
    [
        (GRADED, CostmapConfig(occupied_threshold=99), True),
        (GRADED, CostmapConfig(occupied_threshold=65), False),
        (NARROW, CostmapConfig(robot_radius=0.2), True),
        (NARROW, CostmapConfig(robot_radius=0.4), False),
        (wall_with_gap(-1), CostmapConfig(allow_unknown=True), True),
        (wall_with_gap(-1), CostmapConfig(allow_unknown=False), False),
    ],
    ids=['cost 80 at 99', 'cost 80 at 65', 'wide enough', 'too narrow', 'unknown', 'not unknown'],
)


@CASES
def test_the_planner_and_the_line_of_sight_agree_on_the_gap(grid_map, config, is_open):
    costmap = Costmap(grid_map, config)
    plan = Planner(grid_map, config).plan(PlanRequest(START, GOAL, time_limit=20.0))
    assert plan.code is (ResultCode.NONE if is_open else ResultCode.NO_VALID_PATH)
    assert costmap.line_of_sight.clear_along([START, GAP, GOAL]) == is_open


@CASES
def test_the_oracle_goes_through_the_gap_where_the_search_may(grid_map, config, is_open):
    costmap = Costmap(grid_map, config)
    for name in ('oracle', 'reversed', 'noisy'):
        reply = make_source(SourceSettings(source=name)).waypoints(
            WaypointQuery(costmap, START, GOAL)
        )
        assert reply.status is (SourceStatus.OK if is_open else SourceStatus.NO_WAYPOINTS)
    points = [START, *shortest_route(costmap, START, GOAL)[0], GOAL]
    assert costmap.line_of_sight.clear_along(points) == is_open
    assert np.isfinite(shortest_route(costmap, START, GOAL)[1]) == is_open


@CASES
def test_random_points_are_free_for_the_search(grid_map, config, is_open):
    costmap = Costmap(grid_map, config)
    source = make_source(SourceSettings(source='random'))
    for y in range(GRADED.height):
        reply = source.waypoints(WaypointQuery(costmap, (0, y), GOAL))
        assert all(not costmap.blocked[int(y), int(x)] for x, y in reply.waypoints)


@CASES
@pytest.mark.parametrize('candidates', [1, 8])
def test_the_embedded_model_goes_through_the_gap_where_the_search_may(
    grid_map, config, is_open, candidates
):
    costmap = Costmap(grid_map, config)
    reply = EmbeddedSource(candidates).waypoints(WaypointQuery(costmap, START, GOAL))
    if candidates > 1 or is_open:
        assert reply.status is (SourceStatus.OK if is_open else SourceStatus.NO_WAYPOINTS)
    points = [START, *reply.waypoints, GOAL]
    assert costmap.line_of_sight.clear_along(points) == is_open
    assert all(not costmap.blocked[int(y), int(x)] for x, y in reply.waypoints)


@CASES
def test_a_prompt_shows_the_gap_where_the_search_may_pass_it(grid_map, config, is_open):
    description = describe(WaypointQuery(Costmap(grid_map, config), START, GOAL))
    through = [
        barrier
        for barrier in description.vertical_barriers
        if barrier.line == GAP[0] and barrier.first <= GAP[1] <= barrier.last
    ]
    assert bool(through) != is_open


@CASES
def test_a_point_of_a_coarse_lattice_becomes_a_cell_that_the_search_may_use(
    grid_map, config, is_open
):
    costmap = Costmap(grid_map, config)
    ((x, y),) = Lattice(unit=2).to_cells(
        [(GAP[0] // 2, GAP[1] // 2)], WaypointQuery(costmap, START, GOAL)
    )
    block_is_free = not costmap.blocked[GAP[1] : GAP[1] + 2, GAP[0] : GAP[0] + 2].all()
    assert costmap.blocked[int(y), int(x)] != block_is_free
    assert not is_open or (x, y) == GAP


def test_equal_costmaps_share_one_visibility_graph_and_other_rules_have_their_own():
    config = CostmapConfig(occupied_threshold=99)
    graph = visibility_graph(Costmap(GRADED, config))
    assert visibility_graph(Costmap(wall_with_gap(80), config)) is graph
    assert visibility_graph(Costmap(GRADED)) is not graph
