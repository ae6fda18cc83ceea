"""Search methods of other packages: the protocol, and what a plan makes of one that fails."""

import re
import threading
import time
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.astar import exact_method
from llm_astar_planner.search.methods import (
    METHODS,
    SEARCH_METHODS,
    WAYPOINT_METHODS,
    make_plugin_method,
    uses_waypoints,
)
from llm_astar_planner.search.paper import PAPER_METHODS
from llm_astar_planner.search.problem import SearchProblem, search_method
from llm_astar_planner.search.result import SearchResult, SearchStatus
from llm_astar_planner.waypoints.replay import FixedReply

from llm_astar_planner import plugins

CELLS = np.zeros((20, 20), dtype=np.int8)
CELLS[4:, 10] = 100
PLANNER = Planner(GridMap(CELLS)).prepare()
START, GOAL = (3, 15), (16, 15)
NONE = np.zeros((0, 0), dtype=np.bool_)
NAME = 'tests:method'


@pytest.fixture
def plan(monkeypatch):
    """Plan with a function as a plug-in's method."""

    def run(function, **fields):
        method = make_plugin_method(NAME, function)
        monkeypatch.setitem(SEARCH_METHODS.loaded, NAME, method)
        return PLANNER.plan(PlanRequest(START, GOAL, NAME, **fields))

    return run


def found(path=(), expansions=1, storage=1, expanded=NONE, status=SearchStatus.FOUND):
    return SearchResult(status, expansions, storage, expanded, path)


def raises(error):
    def search(problem):
        raise error

    return search


def test_a_plug_in_plans_as_the_method_that_it_calls(plan):
    ours = PLANNER.plan(PlanRequest(START, GOAL, 'exact_astar'))
    theirs = plan(exact_method)
    assert theirs.code is ResultCode.NONE
    assert theirs.length == pytest.approx(ours.length)
    assert (theirs.expansions, theirs.storage) == (ours.expansions, ours.storage)
    assert (theirs.expanded == ours.expanded).all()
    assert ours.suboptimality_bound == 1.0
    assert np.isnan(theirs.suboptimality_bound), 'nobody has proven a bound'
    through = plan(exact_method, via=((3, 2), (16, 2)), want_expanded=False)
    assert (through.code, through.expanded.shape) == (ResultCode.NONE, (0, 0))


def test_a_plug_in_gets_waypoints_only_where_it_wants_some(plan):
    seen = []

    def search(problem):
        seen.append(list(problem.waypoints))
        return exact_method(problem)

    # On the free cells, on the wall, off the map.
    source = FixedReply('[[10, 2], [10, 10], [99, 99]]')
    wanted = plan(search_method(uses_waypoints=True)(search), source=source)
    assert wanted.guided_by == 'reply'
    assert [point.status.value for point in wanted.checked_waypoints] == [
        'accepted', 'occupied', 'out_of_bounds'
    ]  # fmt: skip
    del search.uses_waypoints
    unwanted = plan(search, source=source)
    assert seen == [[(10.0, 2.0)], []]
    assert unwanted.reply.detail == f'{NAME} uses no waypoints'


@pytest.mark.parametrize(
    ('search', 'words'),
    [
        (raises(ValueError('no idea')), r'ValueError: no idea \(test_plugins.py, line'),
        (raises(SystemExit(2)), 'SystemExit: 2'),
        (raises(GeneratorExit()), 'GeneratorExit'),
        (raises(TimeoutError('mine')), 'TimeoutError: mine'),
        (lambda problem: [[3, 15], [16, 15]], 'returned list, not a SearchResult'),
        (lambda problem: None, 'returned NoneType, not a SearchResult'),
        (lambda problem: found([[float('nan'), 1.0]]), r'path: float64 \(1, 2\) is not whole'),
        (lambda problem: found([[1, 2, 3]]), 'is not whole numbers'),
        (lambda problem: found('path'), 'is not whole numbers'),
        (lambda problem: found(np.ones((10**6, 2), int)), 'has 1000000 cells, more than the map'),
        (lambda problem: found([[-1, 0]]), 'path: leaves the map'),
        (lambda problem: found([[2**32 + 3, 15]]), 'path: leaves the map'),
        (lambda problem: found([[3, 15]], expansions=-1), 'expansions: -1 is not'),
        (lambda problem: found([[3, 15]], expansions=float('nan')), 'expansions: nan is not'),
        (lambda problem: found([[3, 15]], storage=None), 'storage: None is not'),
        (lambda problem: found(status='FINE'), "'FINE' is not a valid SearchStatus"),
        (lambda problem: found(expanded=np.ones((3, 3))), r'expanded: has shape \(3, 3\)'),
        (lambda problem: iter(()), 'returned tuple_iterator'),
        (lambda problem: (one for one in ()), 'returned generator, not a SearchResult'),
        (lambda problem: problem.blocked.fill(True), 'read-only'),
        (lambda problem: found([[3, 15], [16, 15]]), 'withheld: it jumps after'),
        (lambda problem: found([[x, 15] for x in range(3, 17)]), 'withheld: it hits an obstacle'),
        (lambda problem: found(), 'withheld: it is empty'),
    ],
)
def test_a_plug_in_that_fails_costs_its_plan_only_and_is_named(plan, search, words):
    before = PLANNER.costmap.blocked.copy()
    failed = plan(search)
    assert failed.code is ResultCode.UNKNOWN
    assert len(failed.path) == 0
    assert failed.method == NAME
    with pytest.raises(AssertionError, match=words):
        raise AssertionError(failed.message)
    assert 'withheld' in failed.message or failed.message.startswith(f'search method {NAME}: ')
    assert (PLANNER.costmap.blocked == before).all()
    assert PLANNER.plan(PlanRequest(START, GOAL)).code is ResultCode.NONE


def test_a_length_and_a_bound_are_never_believed(plan):
    honest = PLANNER.plan(PlanRequest(START, GOAL, 'exact_astar'))

    def boast(problem):
        result = exact_method(problem)
        return SearchResult(SearchStatus.FOUND, 1, 1, NONE, result.path, 0.5)

    assert plan(boast).length == pytest.approx(honest.length)


def test_a_late_result_is_dropped_and_said(plan, caplog, monkeypatch):
    monkeypatch.setattr(plugins, 'MAX_LOGGED', 1000)

    def late(problem):
        while time.monotonic() < problem.deadline + 0.2:
            time.sleep(0.01)
        return exact_method(problem)

    assert plan(late, time_limit=0.5).code is ResultCode.TIMEOUT
    for record in caplog.records:
        said = re.search(
            rf'plug-in {NAME}: came back (\S+) s after its time was over', record.getMessage()
        )
        assert float(said[1]) >= 0.2
    assert caplog.records
    assert plan(exact_method).code is ResultCode.NONE


def test_ctrl_c_ends_the_plan_of_a_plug_in_too(plan):
    with pytest.raises(KeyboardInterrupt):
        plan(raises(KeyboardInterrupt()))


def test_what_a_plug_in_claims_is_no_fact_about_the_map(plan):
    given_up = plan(lambda problem: found(status=SearchStatus.EXHAUSTED))
    assert given_up.code is ResultCode.NO_VALID_PATH
    assert f'{NAME} found no path, from' in given_up.message
    stopped = plan(lambda problem: found(status=SearchStatus.STOPPED))
    assert stopped.code is ResultCode.UNKNOWN
    assert f'{NAME} stopped by itself, from' in stopped.message


def test_what_a_plug_in_is_given_is_read_only(plan):
    def search(problem):
        problem.grid.blocked[:] = False

    assert 'read-only' in plan(search).message


def test_names_of_the_benchmark_are_taken(monkeypatch, tmp_path):
    metadata = tmp_path / 'taker-1.0.dist-info'
    metadata.mkdir()
    (metadata / 'METADATA').write_text('Name: taker\nVersion: 1.0\n')
    (metadata / 'entry_points.txt').write_text(
        f'[{SEARCH_METHODS.group}]\nwaypoints_only = os:getcwd\nother = os:getcwd\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    fresh = replace(SEARCH_METHODS, loaded={})
    assert list(fresh.installed) == ['other']


def test_a_method_that_stops_with_a_path_has_found_that(plan):
    best = plan(lambda problem: replace(exact_method(problem), status=SearchStatus.STOPPED))
    assert best.code is ResultCode.NONE
    assert 'stopped before more could be proven' in best.message


def test_a_plug_in_that_is_imported_by_a_plan_has_the_time_of_that_plan(monkeypatch, tmp_path):
    (tmp_path / 'slow_method.py').write_text(
        'import time\n\nfrom llm_astar_planner.search.astar import exact_method as search\n'
        'time.sleep(0.4)\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    entry = EntryPoint('slow', 'slow_method:search', SEARCH_METHODS.group)
    monkeypatch.setitem(SEARCH_METHODS.installed, 'slow', [entry])
    late = PLANNER.plan(PlanRequest(START, GOAL, 'slow', time_limit=0.2))
    assert late.code is ResultCode.TIMEOUT
    assert PLANNER.plan(PlanRequest(START, GOAL, 'slow')).code is ResultCode.NONE
    del SEARCH_METHODS.loaded['slow']


def test_a_plug_in_sees_that_it_is_cancelled(plan):
    stop = np.zeros(1, dtype=np.uint8)

    def search(problem):
        threading.Timer(0.05, stop.fill, (1,)).start()
        while not problem.stop[0]:
            time.sleep(0.001)
        return found([], 5, status=SearchStatus.STOPPED)

    SEARCH_METHODS.loaded[NAME] = make_plugin_method(NAME, search)
    cancelled = PLANNER.plan(PlanRequest(START, GOAL, NAME), stop)
    assert (cancelled.code, cancelled.expansions) == (ResultCode.TIMEOUT, 5)
    assert 'cancelled after 5 expansions' in cancelled.message


def test_a_name_that_was_not_loaded_is_no_method():
    for name in ('os:getcwd', 'dijkstra', 'llm_astar_planner.search.astar:exact_method'):
        plan = PLANNER.plan(PlanRequest(START, GOAL, name, FixedReply('[[1, 1]]')))
        assert plan.code is ResultCode.INVALID_PLANNER
        assert name in plan.message
        assert name not in SEARCH_METHODS.loaded


def test_every_method_of_the_package_comes_from_the_same_table_and_is_called_alike():
    assert tuple(SEARCH_METHODS.own) == METHODS
    grid = PLANNER.costmap.grid_graph
    for name in METHODS:
        method = SEARCH_METHODS.load(name)
        assert method.uses_waypoints == uses_waypoints(name) == (name in WAYPOINT_METHODS)
        answer = method(SearchProblem(grid, START, GOAL, weight=2.0))
        if not isinstance(answer, SearchResult):
            *_, answer = answer
        assert (answer.path[0] == START).all()
        assert (answer.path[-1] == GOAL).all()
    assert SEARCH_METHODS.load('llm_astar') is PAPER_METHODS['llm_astar']
