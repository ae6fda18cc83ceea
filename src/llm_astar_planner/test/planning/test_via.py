"""Paths through via cells: segments, planned one after the other on one deadline."""

import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.path_validator import via_problem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.segment import SegmentPlanner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.methods import METHODS
from llm_astar_planner.waypoints.replay import FixedReply

CELLS = np.zeros((40, 60), dtype=np.int8)
CELLS[5:35, 30] = 100
PLANNER = Planner(GridMap(CELLS, 0.05), CostmapConfig(robot_radius=0.1))
START, GOAL, VIA = (5, 20), (55, 20), ((40, 36), (20, 2))


@pytest.mark.parametrize('method', METHODS)
def test_a_path_passes_its_via_cells_in_order_and_adds_up(method):
    plan = PLANNER.plan(PlanRequest(START, GOAL, method, via=VIA))
    assert plan.code is ResultCode.NONE, plan.message
    assert PLANNER.checker.path_problem(plan.path, START, GOAL) is None
    assert via_problem(plan.path, VIA) is None
    assert via_problem(plan.path, VIA[::-1]) is not None
    places = [START, *VIA, GOAL]
    segments = [PLANNER.plan(PlanRequest(start, goal, method)) for start, goal in pairwise(places)]
    assert plan.length == pytest.approx(sum(segment.length for segment in segments))
    assert plan.cost == pytest.approx(sum(segment.cost for segment in segments))
    assert plan.expansions == sum(segment.expansions for segment in segments)
    assert plan.storage == sum(segment.storage for segment in segments)
    assert len(plan.path) == sum(len(segment.path) for segment in segments) - len(VIA)
    if method == 'exact_astar':
        assert plan.suboptimality_bound == 1.0
    if not np.isnan(plan.suboptimality_bound):
        assert (
            plan.suboptimality_bound
            <= max(segment.suboptimality_bound for segment in segments) + 1e-9
        )


def test_a_bound_holds_for_the_whole_path():
    exact = PLANNER.plan(PlanRequest(START, GOAL, 'exact_astar', via=VIA))
    plan = PLANNER.plan(PlanRequest(START, GOAL, via=VIA, max_suboptimality=1.05))
    assert plan.suboptimality_bound <= 1.05
    assert plan.cost <= plan.suboptimality_bound * exact.cost + 1e-6


def test_an_unreachable_via_cell_is_moved_within_the_tolerance():
    """As in planner_server, which plans to each pose as to a goal."""
    blocked, free = (30, 20), (10, 30)
    assert PLANNER.plan(PlanRequest(START, GOAL, via=(blocked,))).code is ResultCode.GOAL_OCCUPIED
    plan = PLANNER.plan(PlanRequest(START, GOAL, tolerance=0.5, via=(free, blocked, blocked)))
    assert plan.code is ResultCode.NONE
    assert plan.via == (free, (27, 20), (27, 20))
    assert via_problem(plan.path, plan.via) is None
    (warning,) = plan.warnings
    assert warning.startswith('the via 2 cell (30, 20) at (1.525, 1.025) m is not free')
    assert 'moved to cell (27, 20) at (1.375, 1.025) m, 0.15 m off; so are 1 more' in warning
    near = PLANNER.plan(PlanRequest(START, GOAL, tolerance=0.1, via=(free, blocked)))
    assert near.code is ResultCode.GOAL_OCCUPIED
    assert 'via 2' in near.message


def test_a_thousand_via_cells_are_passed():
    cells = np.random.default_rng(5).permutation(np.argwhere(~PLANNER.costmap.blocked))[:1000]
    via = tuple((int(x), int(y)) for y, x in cells)
    plan = PLANNER.plan(PlanRequest(START, GOAL, via=via, time_limit=60.0))
    assert plan.code is ResultCode.NONE, plan.message
    assert via_problem(plan.path, via) is None


@pytest.mark.parametrize('method', METHODS)
def test_a_via_cell_may_be_an_end_or_the_one_before(method):
    plan = PLANNER.plan(PlanRequest(START, GOAL, method, via=(START, (40, 36), (40, 36), GOAL)))
    assert plan.code is ResultCode.NONE
    assert via_problem(plan.path, (START, (40, 36), GOAL)) is None


def test_the_via_cells_stand_in_for_a_source():
    plan = PLANNER.plan(PlanRequest(START, GOAL, source=FixedReply('[[20, 20]]'), via=VIA))
    assert (plan.guided_by, plan.checked_waypoints) == ('none', ())


def test_an_any_angle_path_still_turns_at_its_via_cells():
    plan = PLANNER.plan(PlanRequest(START, GOAL, via=VIA, any_angle=True))
    points = [tuple(point) for point in plan.any_angle.points.tolist()]
    assert [points.index(cell) for cell in VIA] == sorted(points.index(cell) for cell in VIA)
    assert plan.any_angle.length <= plan.length


def test_each_segment_has_its_share_of_one_deadline(monkeypatch):
    """The first segment, however much it could prove, leaves the others their time."""
    deadlines = []
    search = SegmentPlanner.search

    def noted(segment):
        deadlines.append(segment.deadline)
        return search(segment)

    monkeypatch.setattr(SegmentPlanner, 'search', noted)
    begin = time.monotonic()
    PLANNER.plan(PlanRequest(START, GOAL, via=VIA, time_limit=1000.0))
    shares = np.array(deadlines) - begin
    assert 200.0 < shares[0] < 500.0
    assert shares[0] < shares[1] < shares[2]
    assert shares[2] == pytest.approx(1000.0, abs=60.0)


def test_a_cancel_ends_every_segment():
    planner = Planner(GridMap(np.zeros((2500, 2500), dtype=np.int8)))
    _ = planner.costmap.components
    stop, plans = no_stop(), []
    via = ((2400, 1200), (10, 1300))
    request = PlanRequest((1, 1), (2400, 900), 'dynamic_weighted_astar', time_limit=300, via=via)
    thread = threading.Thread(target=lambda: plans.append(planner.plan(request, stop)))
    thread.start()
    time.sleep(0.1)
    stop[0] = 1
    thread.join(60.0)
    assert plans[0].code is ResultCode.TIMEOUT
    assert plans[0].message.startswith('cancelled')
    assert 'from the start cell (1, 1) to via 1 cell (2400, 1200)' in plans[0].message
