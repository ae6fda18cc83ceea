"""The paper's methods count exactly what its published code does, on every reference sample."""

import gzip
import json
import os
from pathlib import Path

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.paper import compile_kernels
from llm_astar_planner.waypoints.fixed import FixedReply
from llm_astar_planner.waypoints.source import WaypointReply

REFERENCE = os.environ.get('LLM_ASTAR_REFERENCE')
pytestmark = pytest.mark.skipif(not REFERENCE, reason='LLM_ASTAR_REFERENCE is not set')
REPLY_SETS = ('none', 'oracle', 'noisy', 'reversed', 'offmap')


class Filtered:
    """Returns waypoints that the published parser has filtered; its quirks show in `offmap`."""

    name = 'filtered'

    def __init__(self, waypoints):
        self.reply = WaypointReply(tuple(map(tuple, waypoints)), label=self.name)

    def waypoints(self, query):
        return self.reply


@pytest.fixture(scope='module')
def reference():
    compile_kernels()  # else a slow compilation counts as planning time
    folder = Path(REFERENCE)
    maps = load_barrier_maps(folder / 'barrier_maps_00_49.json')
    planners = {barrier_map.id: Planner.for_barrier_map(barrier_map) for barrier_map in maps}
    with gzip.open(folder / 'golden_maps_00_49.json.gz', 'rt') as file:
        records = json.load(file)['records']
    assert len(records) == 500
    return planners, records


def plan(reference, record, method, source=None):
    planners, _ = reference
    start, goal = tuple(record['start']), tuple(record['goal'])
    return planners[record['map']].plan(PlanRequest(start, goal, method, source))


def assert_equal(plan, figures, record):
    where = f'map {record["map"]} pair {record["pair"]}'
    assert plan.code is ResultCode.NONE, where
    assert plan.expansions == figures['operation'], where
    assert plan.storage == figures['storage'], where
    assert plan.length == pytest.approx(figures['length'], abs=1e-9), where


@pytest.mark.parametrize('method', ['astar', 'dynamic_weighted_astar'])
def test_methods_without_waypoints_equal_the_published_code(reference, method):
    for record in reference[1]:
        assert_equal(plan(reference, record, method), record[method], record)


@pytest.mark.parametrize('name', REPLY_SETS)
def test_llm_astar_equals_the_published_code(reference, name):
    crashed = 0
    for record in reference[1]:
        figures = record['sets'][name]
        if 'error' in figures:
            crashed += 1
            came = plan(reference, record, 'llm_astar', FixedReply(figures['text']))
            assert came.code is ResultCode.NONE
            continue
        offmap = name == 'offmap'
        source = (
            Filtered(figures['waypoints_after_filter']) if offmap else FixedReply(figures['text'])
        )
        assert_equal(plan(reference, record, 'llm_astar', source), figures, record)
    assert (crashed > 0) == (name == 'offmap')
