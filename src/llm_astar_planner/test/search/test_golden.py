"""The paper's methods count exactly what its published code does, on every sample compared.

published_figures.csv has what the published code (github.com/SilinMeng0510/llm-astar, commit
c1d045c) counts on 200 of our samples, those of every fifth map, in the columns of results.csv.
Its `waypoints` are those it was given: of our baseline sources with seed 0, and `hostile` ones,
off the map, on barriers, at its edge and between cells. Dynamic weighted A*, which the paper
describes and its code does not have, is the published A* with the weight of the paper.
"""

import csv
import gzip
import json
import os
from collections import Counter
from pathlib import Path

import pytest
from llm_astar_lab.results.row import parse_points
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.replay import FixedReply
from llm_astar_planner.waypoints.source import WaypointReply

FIGURES = Path(__file__).with_name('published_figures.csv')
SOURCES = ('none', 'oracle', 'noisy', 'reversed', 'random', 'hostile')
REFERENCE = os.environ.get('LLM_ASTAR_REFERENCE')
REPLY_SETS = ('none', 'oracle', 'noisy', 'reversed', 'offmap')
of_the_paper = pytest.mark.skipif(not REFERENCE, reason='LLM_ASTAR_REFERENCE is not set')


class Filtered:
    """Returns waypoints that the published parser has filtered; its quirks show in `offmap`."""

    name = 'filtered'

    def __init__(self, waypoints):
        self.reply = WaypointReply(tuple(map(tuple, waypoints)), label=self.name)

    def waypoints(self, query):
        return self.reply


def load_planners(path):
    compile_kernels()  # else a slow compilation counts as planning time
    maps = load_barrier_maps(path)
    return {barrier_map.id: (Planner.for_barrier_map(barrier_map), barrier_map.samples)
            for barrier_map in maps}  # fmt: skip


@pytest.fixture(scope='module')
def published():
    with FIGURES.open() as file:
        rows = list(csv.DictReader(file))
    return load_planners(find_file('samples_1000.json', 'maps')), rows


@pytest.fixture(scope='module')
def reference():
    folder = Path(REFERENCE)
    with gzip.open(folder / 'golden_maps_00_49.json.gz', 'rt') as file:
        records = json.load(file)['records']
    assert len(records) == 500
    return load_planners(folder / 'barrier_maps_00_49.json'), records


def plan(planners, record, method, source=None):
    planner, samples = planners[int(record['map'])]
    sample = samples[int(record['pair'])]
    return planner.plan(PlanRequest(sample.start, sample.goal, method, source))


def assert_equal(plan, figures, record):
    where = f'map {record["map"]} pair {record["pair"]}'
    assert plan.code is ResultCode.NONE, where
    assert plan.expansions == int(figures['operation']), where
    assert plan.storage == int(figures['storage']), where
    assert plan.length == pytest.approx(float(figures['length']), abs=1e-8), where


def test_the_figures_are_of_200_samples():
    with FIGURES.open() as file:
        kinds = Counter((row['method'], row['source']) for row in csv.DictReader(file))
    assert set(kinds.values()) == {200}
    assert {source for method, source in kinds if method == 'llm_astar'} == set(SOURCES)


@pytest.mark.parametrize('method', ['astar', 'dynamic_weighted_astar'])
def test_methods_without_waypoints_equal_the_published_code_on_our_samples(published, method):
    planners, rows = published
    for row in rows:
        if row['method'] == method:
            assert_equal(plan(planners, row, method), row, row)


@pytest.mark.parametrize('source', SOURCES)
def test_llm_astar_equals_the_published_code_on_our_samples(published, source):
    planners, rows = published
    for row in rows:
        if (row['method'], row['source']) == ('llm_astar', source):
            points = [list(point) for point in parse_points(row['waypoints'])]
            reply = FixedReply(f'Generated Path: {json.dumps(points)}')
            assert_equal(plan(planners, row, 'llm_astar', reply), row, row)


@of_the_paper
@pytest.mark.parametrize('method', ['astar', 'dynamic_weighted_astar'])
def test_methods_without_waypoints_equal_the_published_code(reference, method):
    planners, records = reference
    for record in records:
        assert_equal(plan(planners, record, method), record[method], record)


@of_the_paper
@pytest.mark.parametrize('name', REPLY_SETS)
def test_llm_astar_equals_the_published_code(reference, name):
    planners, records = reference
    crashed = 0
    for record in records:
        figures = record['sets'][name]
        if 'error' in figures:
            crashed += 1
            came = plan(planners, record, 'llm_astar', FixedReply(figures['text']))
            assert came.code is ResultCode.NONE
            continue
        offmap = name == 'offmap'
        source = (
            Filtered(figures['waypoints_after_filter']) if offmap else FixedReply(figures['text'])
        )
        assert_equal(plan(planners, record, 'llm_astar', source), figures, record)
    assert (crashed > 0) == (name == 'offmap')
