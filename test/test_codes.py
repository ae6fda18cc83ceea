"""Every cause of failure has its code and message, the same in plans, reports and JSON."""

import json
import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.report import PlanReport, report_from_message
from llm_astar_msgs_adapter.messages.writing import report_to_message
from llm_astar_planner.cli.map_files import Coordinates
from llm_astar_planner.cli.plan import plan_to_json, plan_to_text
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.segment import SegmentPlanner
from llm_astar_planner.planning.types import MAX_VIA, PlanRequest, ResultCode
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.astar import PathTooLongError

# A wall with a box behind it: (25, 5) is free and cut off; unknown cells on the right.
CELLS = np.zeros((20, 40), dtype=np.int8)
CELLS[:, 30] = 100
CELLS[3:8, 23:28] = 100
CELLS[5, 25] = 0
CELLS[15, 5] = -1
GRID = GridMap(CELLS, 0.1)
OPEN, BODY = CostmapConfig(), CostmapConfig(robot_radius=0.25, allow_unknown=False)
METRES = Coordinates(GRID, (0, 0), metres=True)
START, GOAL = (3, 3), (15, 15)
CODE = ResultCode

CAUSES = [
    (OPEN, {'method': 'theta'}, CODE.INVALID_PLANNER, "method: 'theta'"),
    (OPEN, {'heuristic': 'l7'}, CODE.INVALID_PLANNER, "heuristic: 'l7'"),
    (OPEN, {'max_suboptimality': 0.5}, CODE.INVALID_PLANNER, 'max_suboptimality: 0.5'),
    (OPEN, {'max_suboptimality': math.nan}, CODE.INVALID_PLANNER, 'max_suboptimality: nan'),
    (OPEN, {'weight': math.nan}, CODE.INVALID_PLANNER, 'weight: nan'),
    (OPEN, {'weight': 1e4}, CODE.INVALID_PLANNER, 'weight: 10000.0'),
    (OPEN, {'tolerance': math.nan}, CODE.INVALID_PLANNER, 'tolerance: nan'),
    (OPEN, {'tolerance': -0.1}, CODE.INVALID_PLANNER, 'tolerance: -0.1'),
    (OPEN, {'start_tolerance': math.inf}, CODE.INVALID_PLANNER, 'start_tolerance: inf'),
    (OPEN, {'time_limit': math.nan}, CODE.INVALID_PLANNER, 'time_limit'),
    (OPEN, {'via': ((5, 5),) * (MAX_VIA + 1)}, CODE.INVALID_PLANNER, f'over the {MAX_VIA}'),
    (
        OPEN,
        {'start': (-1, 3)},
        CODE.START_OUTSIDE_MAP,
        'start cell (-1, 3) at (-0.05, 0.35) m is outside',
    ),
    (OPEN, {'start': (40, 3)}, CODE.START_OUTSIDE_MAP, '40 x 20'),
    (OPEN, {'start': (40, 3), 'start_tolerance': 1.0}, CODE.START_OUTSIDE_MAP, '40 x 20'),
    (
        OPEN,
        {'goal': (3, 20)},
        CODE.GOAL_OUTSIDE_MAP,
        'goal cell (3, 20) at (0.35, 2.05) m is outside',
    ),
    (OPEN, {'goal': (3, 30), 'tolerance': 0.5}, CODE.GOAL_OUTSIDE_MAP, 'is outside the map'),
    (OPEN, {'start': (30, 3)}, CODE.START_OCCUPIED, 'occupancy 100'),
    (BODY, {'start': (29, 3)}, CODE.START_OCCUPIED, "robot's radius, 0.25 m"),
    (BODY, {'start': (5, 15)}, CODE.START_OCCUPIED, 'unknown'),
    (OPEN, {'goal': (30, 3)}, CODE.GOAL_OCCUPIED, 'goal cell (30, 3)'),
    (BODY, {'goal': (28, 15)}, CODE.GOAL_OCCUPIED, "robot's radius"),
    (BODY, {'goal': (5, 15)}, CODE.GOAL_OCCUPIED, 'unknown'),
    (OPEN, {'goal': (24, 5), 'tolerance': 0.1}, CODE.GOAL_OCCUPIED, 'within 0.1 m'),
    (OPEN, {'goal': (35, 3)}, CODE.NO_VALID_PATH, 'off from the start cell (3, 3)'),
    (OPEN, {'goal': (35, 3), 'tolerance': 0.2}, CODE.NO_VALID_PATH, 'within 0.2 m'),
    (OPEN, {'via': ((5, 5), (50, 5))}, CODE.GOAL_OUTSIDE_MAP, 'via 2 cell (50, 5)'),
    (OPEN, {'via': ((24, 5),)}, CODE.GOAL_OCCUPIED, 'via 1 cell (24, 5)'),
    (OPEN, {'via': ((5, 5), (25, 5))}, CODE.NO_VALID_PATH, 'cut the via 2 cell (25, 5)'),
    (OPEN, {'time_limit': 0.0}, CODE.TIMEOUT, 'out of time'),
    (OPEN, {'time_limit': -1.0, 'method': 'astar'}, CODE.TIMEOUT, 'out of time'),
    (OPEN, {'time_limit': 0.0, 'via': ((5, 5),)}, CODE.TIMEOUT, 'm to via 1 cell (5, 5)'),
]


def names(case):
    return '-'.join(f'{name}' for name in case) if isinstance(case, dict) else None


def request_of(fields):
    return PlanRequest(**{'start': START, 'goal': GOAL, **fields})


def assert_reported(plan, code, words):
    """The same code and sentence in the plan, its report over the wire, JSON and text."""
    assert plan.code is code
    assert words in plan.message
    assert len(plan.path) == 0
    report = plan_report(plan, GRID)
    back = report_from_message(report_to_message(report, 'planner', Time()), PlanReport)
    assert back == report
    assert (back.code, back.code_name, back.message) == (int(code), code.name, plan.message)
    shown = json.loads(json.dumps(plan_to_json(plan, (0, 0))))
    assert (shown['code'], shown['code_name'], shown['path']) == (int(code), code.name, [])
    assert words in shown['message']
    first = plan_to_text(plan, METRES).split('\n')[0]
    assert first == f'no path: {plan.message} [{code.name} {int(code)}]' == back.summary


@pytest.mark.parametrize(('rules', 'fields', 'code', 'words'), CAUSES, ids=names)
def test_every_cause_has_its_code_and_its_message(rules, fields, code, words):
    assert_reported(Planner(GRID, rules).plan(request_of(fields)), code, words)


def test_a_cancel_is_a_timeout_that_says_so():
    stop = no_stop()
    stop[0] = 1
    assert_reported(Planner(GRID).plan(request_of({}), stop), CODE.TIMEOUT, 'cancelled')
    assert stop[0] == 1


def test_the_callers_stop_flag_is_never_written():
    stop = no_stop()
    plan = Planner(GRID).plan(request_of({'time_limit': 0.0}), stop)
    assert plan.code is CODE.TIMEOUT
    assert stop[0] == 0


def test_a_path_whose_cost_cannot_be_stored_is_unknown(monkeypatch):
    def too_long(segment):
        raise PathTooLongError('the cost of a path does not fit')

    monkeypatch.setattr(SegmentPlanner, 'search', too_long)
    assert_reported(Planner(GRID).plan(request_of({})), CODE.UNKNOWN, 'does not fit')


def test_a_report_is_read_back_from_its_message_unchanged():
    request = PlanRequest(START, (24, 5), tolerance=0.5, via=((5, 15),))
    plan = Planner(GRID).plan(request)
    assert plan.code is CODE.NONE
    report = plan_report(plan, GRID)
    back = report_from_message(report_to_message(report, 'planner', Time()), PlanReport)
    assert back == report
    assert back.goal_shift == pytest.approx(0.2)
    assert back.unknown_length == pytest.approx(plan.unknown_length) != 0.0
    assert back.clearance == pytest.approx(0.1)
    assert back.turns == plan.turns > 0
    assert back.warnings == plan.warnings
    assert len(back.warnings) == 1
    shown = plan_to_json(plan, (10, 20))
    assert shown['goal'] == [plan.goal[0] + 10, plan.goal[1] + 20]
    for name in ('start_shift', 'goal_shift', 'unknown_length', 'clearance', 'turns'):
        assert shown[name] == getattr(plan, name)
    assert plan.warnings[0] in plan_to_text(plan, METRES)


def test_a_plan_on_a_map_without_obstacles_has_no_clearance():
    grid_map = GridMap(np.zeros((5, 5), dtype=np.int8))
    plan = Planner(grid_map).plan(PlanRequest((0, 0), (4, 4)))
    assert math.isinf(plan.clearance)
    assert plan_report(plan, grid_map).clearance is None
    assert plan_to_json(plan, (0, 0))['clearance'] is None
