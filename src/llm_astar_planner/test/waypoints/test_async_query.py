"""No source can delay or break a plan: not one that hangs, raises, is wrong, or is late."""

import json
import threading
import time

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

LONG = 60.0
CELLS = np.zeros((40, 60), dtype=np.int8)
CELLS[:35, 30] = 100
PLANNER = Planner(GridMap(CELLS)).prepare()


class Source:
    """Answers by the given function; a function that hangs is released at the end of the test."""

    name = 'fake'

    def __init__(self, answer):
        self.answer = answer
        self.end = threading.Event()

    def waypoints(self, query):
        return self.answer(self, query)


def hang(source, query):
    source.end.wait(LONG)
    return WaypointReply(((1.0, 1.0),))


def die(source, query):
    raise ConnectionError('gone')


def lie(source, query):
    wrong = ((30.0, 3.0), (-5.0, 1e300), (float('nan'), 2.0), (59.0, 39.0), (0.0, 0.0))
    return WaypointReply(wrong, 'liar', SourceStatus.OK)


def be_late(source, query):
    source.end.wait(0.05)
    return lie(source, query)


def babble(source, query):
    return WaypointReply(((50.0, 30.0), (3.0, 30.0)) * 50_000, detail='chatty')


@pytest.fixture
def source(request):
    source = Source(request.param)
    yield source
    source.end.set()


@pytest.mark.parametrize('source', [hang, die, lie, be_late, babble], indirect=True)
@pytest.mark.parametrize('method', ['guided', 'llm_astar'])
@pytest.mark.parametrize('waiting', [True, False])
def test_whatever_a_source_does_there_is_a_path_in_time(source, method, waiting):
    began = time.monotonic()
    plan = PLANNER.plan(
        PlanRequest(
            (2, 2),
            (55, 3),
            method=method,
            source=source,
            time_limit=LONG / 6,
            source_time_limit=0.2,
            max_suboptimality=1.1,
            search_while_waiting=waiting,
        )
    )
    assert plan.code == 0, plan.message
    assert PLANNER.checker.path_problem(plan.path, (2, 2), (55, 3)) is None
    assert time.monotonic() - began < LONG / 4


@pytest.mark.parametrize('source', [hang], indirect=True)
def test_a_source_that_hangs_is_a_timeout_at_its_time_limit(source):
    reply, seconds = query_source(source, WaypointQuery(PLANNER.costmap, (1, 1), (2, 2), 0.05))
    assert reply.status is SourceStatus.TIMEOUT
    assert 'fake' in reply.detail
    assert seconds < LONG / 2


@pytest.mark.parametrize('source', [hang], indirect=True)
@pytest.mark.parametrize('method', ['guided', 'llm_astar'])
def test_a_cancelled_plan_stops_waiting_for_waypoints(source, method):
    stop, plans = no_stop(), []
    request = PlanRequest((2, 2), (55, 3), method=method, source=source, time_limit=LONG)
    began = time.monotonic()
    thread = threading.Thread(target=lambda: plans.append(PLANNER.plan(request, stop)))
    thread.start()
    stop[0] = 1
    thread.join(LONG)
    assert time.monotonic() - began < LONG / 4
    assert plans[0].code.name in ('TIMEOUT', 'NONE')
    assert plans[0].guided_by == 'none'


def test_only_the_first_thousand_waypoints_are_taken():
    query = WaypointQuery(Costmap(GridMap(CELLS)), (2, 2), (55, 3), LONG)
    reply, _ = query_source(Source(babble), query)
    assert reply.waypoints == babble(None, query).waypoints[:1000]
    assert reply.detail == 'chatty; only its first 1000 waypoints'


def test_whole_numbers_of_a_source_stay_what_they_are():
    source = Source(lambda *_: WaypointReply(((3, 4), (5.5, 6))))
    query = WaypointQuery(PLANNER.costmap, (1, 1), (2, 2), LONG)
    assert repr(query_source(source, query)[0].waypoints) == '((3, 4), (5.5, 6))'


HUGE = 10**3999
NONSENSE = {
    'nothing': (lambda: None, 'returned NoneType, not a WaypointReply'),
    'a list': (lambda: [(1.0, 1.0)], 'returned list, not a WaypointReply'),
    'waypoints of nothing': (lambda: WaypointReply(None), 'waypoints: is a NoneType'),
    'a text of waypoints': (lambda: WaypointReply('abc'), 'waypoints: is a str'),
    'waypoints without end': (lambda: WaypointReply(iter(int, 1)), 'waypoints: is a '),
    'texts': (lambda: WaypointReply((('a', 'b'),)), 'is not two finite numbers'),
    'three numbers': (lambda: WaypointReply(((1.0, 2.0, 3.0),)), 'is not two finite numbers'),
    'no pairs': (lambda: WaypointReply((1.0, 2.0)), 'is not two finite numbers'),
    'a list too deep': (lambda: WaypointReply((((1, 2), (3, 4)),)), 'is not two finite numbers'),
    'no number': (lambda: WaypointReply(((np.nan, 1.0),)), 'is not two finite numbers'),
    'infinity': (lambda: WaypointReply(((np.inf, 1.0),)), 'is not two finite numbers'),
    'a huge number': (lambda: WaypointReply(((HUGE, 1),)), 'is not two finite numbers'),
    'a complex number': (lambda: WaypointReply(((1j, 1.0),)), 'is not two finite numbers'),
    'objects': (lambda: WaypointReply(np.array([object()])), 'is not two finite numbers'),
    'no status': (lambda: WaypointReply(status=None), 'status: is a NoneType'),
    'a text as status': (lambda: WaypointReply(status='OK'), 'status: is a str'),
    'no label': (lambda: WaypointReply(label=None), 'label: is a NoneType'),
    'bytes as detail': (lambda: WaypointReply(detail=b'x'), 'detail: is a bytes'),
    'a text as tokens': (lambda: WaypointReply(prompt_tokens='x'), 'prompt_tokens: '),
    'no time': (lambda: WaypointReply(seconds=np.nan), 'seconds: '),
    'no provenance': (lambda: WaypointReply(provenance=None), 'provenance: is a NoneType'),
    'an exception': (lambda: 1 / 0, 'ZeroDivisionError in source fake'),
}


@pytest.mark.parametrize('waiting', [False, True])
@pytest.mark.parametrize('what', NONSENSE)
def test_nonsense_of_a_source_is_a_plan_without_waypoints_that_says_so(what, waiting):
    answer, said = NONSENSE[what]
    source = Source(lambda *_: answer())
    request = PlanRequest((2, 2), (50, 3), source=source, search_while_waiting=waiting)
    plan = PLANNER.plan(request)
    assert (plan.code.name, plan.guided_by, plan.reply.status) == ('NONE', 'none', 'ERROR')
    assert said in plan.reply.detail
    json.dumps(plan.to_dict(), allow_nan=False)


class Nameless:
    """A source whose name cannot be asked for."""

    @property
    def name(self):
        raise RuntimeError('no name')

    def waypoints(self, query):
        raise ValueError('no waypoints')


@pytest.mark.parametrize('what', [Nameless(), Nameless, 3, 'straight', object()])
def test_what_is_no_source_at_all_is_a_plan_without_waypoints_that_says_so(what):
    plan = PLANNER.plan(PlanRequest((2, 2), (50, 3), source=what))
    assert (plan.code.name, plan.guided_by, plan.reply.status) == ('NONE', 'none', 'ERROR')
    assert 'in source ' in plan.reply.detail
    assert plan.source in plan.reply.detail
