"""Instructions and their plans: followed through via points, and never at the cost of a plan."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning.instruction import plan_with_instruction
from llm_astar_planner.planning.plan_reuse import CachedWaypointSource
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.stop import no_stop
from llm_astar_planner.waypoints.config import SOURCE_NAMES, SourceSettings
from llm_astar_planner.waypoints.factory import make_source
from llm_astar_planner.waypoints.fixed import FixedReply
from llm_astar_planner.waypoints.source import FOLLOWED, SourceStatus, WaypointReply

CELLS = np.zeros((21, 31), dtype=np.int8)
CELLS[10, 5:26] = 100
PLANNER = Planner(GridMap(CELLS, 0.5))
START, GOAL = (15, 8), (15, 12)
INSTRUCTION = 'go round by the east'
LIMIT = 60.0  # no plan takes long, but what compiles its search may
EAST = ((28.0, 8.0), (28.0, 12.0))


class Follower:
    """A source that reads instructions, and answers them as a test tells it to."""

    name = 'follower'

    def __init__(self, waypoints, delay=0.0, said=FOLLOWED):
        self.answer, self.delay, self.said = tuple(waypoints), delay, said
        self.queries = []

    def waypoints(self, query):
        self.queries.append(query)
        time.sleep(min(self.delay, query.time_limit))
        if self.delay > query.time_limit:
            return WaypointReply(label='follower:x', status=SourceStatus.TIMEOUT)
        return WaypointReply(self.answer, label='follower:x', instruction=self.said)


def request(source, **changes):
    asked = PlanRequest(START, GOAL, source=source, instruction=INSTRUCTION, time_limit=LIMIT)
    return replace(asked, **changes)


def passes(plan, cells):
    """Whether a path passes cells in their order."""
    path = iter([tuple(cell) for cell in plan.path.tolist()])
    return all(cell in path for cell in cells)


@pytest.mark.parametrize('method', ['guided', 'llm_astar'])
@pytest.mark.parametrize('ends', [(), (START, GOAL)])
def test_an_instruction_is_followed_through_its_waypoints_in_order(method, ends):
    way = (*ends[:1], *EAST, *ends[1:])
    source = Follower(way)
    plan = PLANNER.plan(request(source, method=method))
    assert plan.code is ResultCode.NONE
    assert plan.instruction == 'followed through 2 via points'
    assert plan.instruction in plan.message
    assert plan.via == ((28, 8), (28, 12))
    assert passes(plan, [START, *plan.via, GOAL])
    assert (plan.guided_by, plan.source) == ('follower:x', 'follower')
    assert [point.status.value for point in plan.checked_waypoints] == ['accepted'] * len(way)
    assert [query.instruction for query in source.queries] == [INSTRUCTION]
    # The source gets its part, and a tenth is left for the way of the instruction.
    assert source.queries[0].time_limit < 0.8 * 0.9 * LIMIT
    direct = PLANNER.plan(request(source, method=method, instruction=''))
    assert direct.expansions < plan.first_expansions <= plan.expansions
    assert PLANNER.path_problem(plan.path, START, GOAL) is None


def test_waypoints_that_cannot_be_passed_are_left_out_and_counted():
    points = [EAST[0], (20.0, 10.0), (float('inf'), 8.0), (99.0, 1.0), EAST[1]]
    plan = PLANNER.plan(request(Follower(points)))
    assert plan.via == ((28, 8), (28, 12))
    left_out = '1 occupied, 1 out of bounds'
    assert plan.instruction == f'followed through 2 via points; left out: {left_out}'


def test_an_instruction_to_go_there_and_back_is_followed_in_order():
    plan = PLANNER.plan(request(Follower([(28.0, 8.0), (20.0, 8.0), (28.0, 12.0)])))
    assert plan.via == ((28, 8), (20, 8), (28, 12))
    assert [point.status.value for point in plan.checked_waypoints] == ['accepted'] * 3


@pytest.mark.parametrize(
    ('way', 'outcome'),
    [
        ([(20.0, 10.0), (20.4, 10.2)], 'not honoured: no waypoint can be passed (2 occupied)'),
        ([START, GOAL], 'followed by the direct path: no waypoint lies in between'),
    ],
)
def test_without_a_point_to_pass_the_direct_path_is_taken(way, outcome):
    direct = PLANNER.plan(PlanRequest(START, GOAL))
    plan = PLANNER.plan(request(Follower(way)))
    assert plan.instruction == outcome
    assert (plan.length, plan.via) == (direct.length, ())


def test_an_instruction_that_leads_far_round_is_followed_with_a_warning():
    direct = PLANNER.plan(PlanRequest(START, (17, 8)))
    assert direct.length == 2.0
    plan = PLANNER.plan(request(Follower([(1.0, 8.0)]), goal=(17, 8)))
    assert plan.instruction == 'followed through 1 via point'
    assert plan.warnings == (
        'the path of the instruction is 15.0 times as long as the direct one',
    )
    assert PLANNER.plan(request(Follower(EAST))).warnings == ()


def test_if_the_path_of_the_instruction_fails_the_direct_one_is_taken_and_the_reason_given():
    def make(asked):
        plan = PLANNER.direct_plan(asked, no_stop())
        if asked.via:
            assert asked.time_limit < LIMIT  # what the direct way left
            return replace(
                plan, code=ResultCode.TIMEOUT, message='out of time', path=plan.path[:0]
            )
        return plan

    plan = plan_with_instruction(request(Follower(EAST)), make, PLANNER.costmap, no_stop())
    assert plan.code is ResultCode.NONE
    assert plan.instruction == 'not honoured: no path through its 2 via points: out of time'
    assert PLANNER.path_problem(plan.path, START, GOAL) is None


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'source': None}, 'no source was asked'),
        ({'source': Follower(EAST, said='no' * 500)}, 'no' * 100),
        ({'source': FixedReply('[[28, 8]]')}, 'source reply cannot read instructions'),
        ({'instruction': 'x' * 501}, 'instruction: 501 characters are more than 500'),
        ({'method': 'exact_astar'}, 'method exact_astar asks for no waypoints'),
        ({'via': ((3, 3),)}, 'the request has via points of its own'),
        ({'goal': START}, 'start and goal are the same'),
    ],
)
def test_an_instruction_that_is_not_read_is_ignored_with_the_reason(changes, reason):
    asked = request(**{'source': Follower(EAST), **changes})
    plan = PLANNER.plan(asked)
    plain = PLANNER.plan(replace(asked, instruction=''))
    assert plan.instruction == f'ignored: {reason}'
    assert (plan.code, plan.length) == (plain.code, plain.length)
    assert plain.instruction == ''


@pytest.mark.parametrize('name', sorted(set(SOURCE_NAMES) - {'endpoint', 'replay'}))
def test_no_source_ignores_an_instruction_silently(name):
    plan = PLANNER.plan(request(make_source(SourceSettings(source=name))))
    assert plan.code is ResultCode.NONE
    assert plan.instruction.startswith('ignored: ')
    assert name in plan.instruction


def test_an_instruction_that_is_blank_is_none():
    assert PLANNER.plan(request(Follower(EAST), instruction=' \n\t ')).instruction == ''


@pytest.mark.parametrize('at_once', [True, False])
def test_the_answer_to_an_instruction_is_waited_for(at_once):
    asked = request(Follower(EAST, delay=0.2), search_while_waiting=at_once)
    assert PLANNER.plan(asked).instruction == 'followed through 2 via points'


@pytest.mark.parametrize('at_once', [True, False])
def test_a_silent_source_costs_no_plan(at_once):
    """Searched while it was waited for, too: the source then came too late to guide anything."""
    asked = request(Follower(EAST, delay=60.0), time_limit=1.0, search_while_waiting=at_once)
    plan = PLANNER.plan(asked)
    assert plan.code is ResultCode.NONE
    assert plan.source_status is (SourceStatus.LATE if at_once else SourceStatus.TIMEOUT)
    assert plan.instruction == 'ignored: source follower gave no answer: TIMEOUT'


def test_a_cancel_ends_the_wait_for_an_answer():
    stop = no_stop()
    threading.Timer(0.1, lambda: stop.fill(1)).start()
    plan = PLANNER.plan(
        request(Follower(EAST, delay=20.0), time_limit=60.0, search_while_waiting=True), stop
    )
    assert plan.instruction == 'ignored: source follower did not answer in time'


def test_an_instruction_does_not_hide_that_there_is_no_plan():
    cells = CELLS.copy()
    cells[10] = 100
    plan = Planner(GridMap(cells)).plan(request(Follower(EAST)))
    assert plan.code is ResultCode.NO_VALID_PATH
    assert plan.instruction == 'not honoured: there is no plan at all'


def test_a_robot_on_its_way_keeps_to_the_instruction_without_asking_again():
    source = Follower(EAST)
    cache = CachedWaypointSource(source)
    asked = request(cache)

    def plan_with_cache(planner, asked):
        started = time.monotonic()
        plan = planner.plan(asked)
        cache.remember(asked, plan, planner.grid_map, started)
        return plan

    first = plan_with_cache(PLANNER, asked)
    cells = CELLS.copy()
    cells[0, 0] = 100
    changed = Planner(GridMap(cells, 0.5))
    start = tuple(first.path[3].tolist())
    later = plan_with_cache(changed, replace(asked, start=start))
    assert len(source.queries) == 1
    assert later.instruction == 'followed through 2 via points'
    other = plan_with_cache(changed, replace(asked, instruction='hurry'))
    assert len(source.queries) == 2
    assert other.instruction == 'followed through 2 via points'


@settings(max_examples=40)
@given(
    st.lists(
        st.tuples(*[st.floats() | st.floats(-5.0, 40.0) | st.integers(-5, 40).map(float)] * 2),
        max_size=12,
    ),
    st.text(max_size=600),
    st.sampled_from(['guided', 'llm_astar', 'astar']),
)
def test_whatever_is_instructed_and_answered_there_is_a_valid_plan(way, instruction, method):
    asked = PlanRequest(START, GOAL, method, Follower(way), instruction=instruction)
    plan = PLANNER.plan(asked)
    assert plan.code is ResultCode.NONE
    assert PLANNER.path_problem(plan.path, START, GOAL) is None
    assert plan.source_status in (SourceStatus.OK, SourceStatus.NONE)
    assert bool(plan.instruction) == bool(
        ''.join(c for c in instruction if c.isprintable()).strip()
    )
    assert passes(plan, plan.via)
