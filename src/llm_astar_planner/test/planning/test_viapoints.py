"""Via points that guide a search: the waypoints of a request that brings its own."""

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.interpretation import Interpretation, RouteInstruction
from llm_astar_planner.instructions.regions import Box
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.planning.endpoints import ViapointSource
from llm_astar_planner.planning.plan_reuse import WaypointCache
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode, WaypointStatus
from llm_astar_planner.waypoints.source import WaypointQuery, WaypointReply

# A maze of graded cells, which the search takes so long for that the via points guide it.
CELLS = np.full((120, 120), 1, dtype=np.int8)
for number, x in enumerate(range(10, 110, 10)):
    CELLS[:, x] = 100
    CELLS[slice(1, 6) if number % 2 else slice(-6, -1), x] = 1
CELLS[50:60, 52:58] = 100
CELLS[54:56, 54:56] = 1  # free, and cut off
MAZE = Planner(GridMap(CELLS, 0.05))
START, GOAL = (3, 3), (116, 116)
GAPS = tuple((x, 117 if n % 2 == 0 else 3) for n, x in enumerate(range(10, 110, 10)))


class Forbidden:
    """A source that must not be asked."""

    name = 'llm'

    def waypoints(self, query):
        raise AssertionError('asked')


def statuses(plan):
    return [point.status.value for point in plan.checked_waypoints]


def test_viapoints_guide_the_search_and_no_source_is_asked():
    plan = MAZE.plan(PlanRequest(START, GOAL, source=Forbidden(), viapoints=GAPS))
    assert plan.code is ResultCode.NONE, plan.message
    assert (plan.source, plan.guided_by) == ('viapoints', 'viapoints')
    assert statuses(plan) == ['accepted'] * len(GAPS)
    assert '10 of 10 waypoints accepted' in plan.message
    assert '10 of 10 via points can be reached' in plan.to_dict()['source_detail']


def test_the_papers_methods_take_them_for_their_waypoints():
    plan = MAZE.plan(PlanRequest(START, GOAL, 'llm_astar', Forbidden(), viapoints=GAPS))
    assert plan.source == 'viapoints'
    assert len(plan.checked_waypoints) == len(GAPS)


def test_they_are_hints_and_break_no_bound():
    exact = MAZE.plan(PlanRequest(START, GOAL, 'exact_astar'))
    wrong = MAZE.plan(PlanRequest(START, GOAL, viapoints=GAPS[::-1], max_suboptimality=1.1))
    assert wrong.code is ResultCode.NONE
    assert wrong.cost <= 1.1 * exact.cost + 1e-6


def test_a_blocked_or_cut_off_one_is_moved_within_the_tolerance_or_dropped():
    viapoints = ((10, 100), (-2, 117), (54, 54), (15, 60))
    request = PlanRequest(START, GOAL, viapoints=viapoints)
    dropped = MAZE.plan(request)
    assert dropped.code is ResultCode.NONE
    assert statuses(dropped) == ['occupied', 'out_of_bounds', 'unreachable', 'accepted']
    assert '1 of 4 via points can be reached; not within 0 m: number 1, 2, 3' in dropped.message
    near = Planner(GridMap(CELLS, 0.05)).plan(
        PlanRequest(START, GOAL, viapoints=viapoints, tolerance=0.1)
    )
    assert statuses(near) == ['accepted', 'accepted', 'unreachable', 'accepted']
    places = [(point.x, point.y) for point in near.checked_waypoints]
    assert places == [(9, 100), (0, 117), (54, 54), (15, 60)]
    assert '3 of 4 via points can be reached, 2 of them moved' in near.message


def test_those_that_nobody_can_reach_leave_the_search_without_waypoints():
    plan = MAZE.plan(PlanRequest(START, GOAL, viapoints=((10, 60), (20, 60))))
    assert (plan.code, plan.guided_by) == (ResultCode.NONE, 'none')


def test_no_cell_is_looked_for_after_the_time_for_a_source():
    source = ViapointSource(((10, 100), (5, 60)), 10.0)
    query = WaypointQuery(Costmap(GridMap(CELLS, 0.05), CostmapConfig()), START, GOAL, -1.0)
    reply = source.waypoints(query)
    assert reply.waypoints == ((10, 100), (5, 60))
    assert reply.detail.startswith('1 of 2')


def test_an_instruction_is_kept_with_viapoints_too():
    avoid = Avoid(region=Box(0.2, 2.0, 0.4, 3.0))
    instruction = RouteInstruction(Interpretation('', Specification((avoid,))))
    plan = MAZE.plan(PlanRequest(START, GOAL, viapoints=GAPS, instruction=instruction))
    assert plan.code is ResultCode.NONE
    assert plan.source == 'viapoints'


def test_cells_to_pass_exactly_come_before_cells_that_guide():
    plan = MAZE.plan(PlanRequest(START, GOAL, via=((5, 60),), viapoints=GAPS))
    assert [5, 60] in plan.path.tolist()
    assert plan.checked_waypoints == ()


def test_they_are_not_kept_for_requests_without():
    cache = WaypointCache(Forbidden.name)
    plan = MAZE.plan(PlanRequest(START, GOAL, source=Forbidden(), viapoints=GAPS))
    assert all(point.status is WaypointStatus.ACCEPTED for point in plan.checked_waypoints)
    cache.remember(plan, MAZE.grid_map, 0.0)
    query = WaypointQuery(MAZE.costmap, (4, 4), GOAL)
    assert cache.find(query) is None


def test_too_many_and_what_is_no_cell_are_refused():
    plan = MAZE.plan(PlanRequest(START, GOAL, viapoints=((5, 60),) * 1025))
    assert plan.code is ResultCode.INVALID_PLANNER
    assert 'viapoints: 1025, over the 1024 allowed' in plan.message
    with pytest.raises(ValueError, match='viapoints'):
        PlanRequest(START, GOAL, viapoints=((1.5, 2),))
    assert PlanRequest(START, GOAL, viapoints=tuple(np.array(GAPS))).viapoints == GAPS


def test_the_answer_to_a_query_is_a_reply_like_any_other():
    reply = ViapointSource(GAPS).waypoints(WaypointQuery(MAZE.costmap, START, GOAL))
    assert isinstance(reply, WaypointReply)
    assert (reply.label, reply.waypoints) == ('viapoints', GAPS)
