"""A small dataset with its sources and tasks, shared by the tests of the benchmark."""

import math
import threading
import time
from dataclasses import replace

import numpy as np
from llm_astar_lab.datasets.named import load_samples
from llm_astar_lab.results.row import Row, Variant, parse_points
from llm_astar_lab.runner.config import BenchmarkConfig
from llm_astar_lab.runner.engine import (
    ALL_METHODS,
    AnsweredSource,
    SearchSettings,
    list_variants,
    make_request,
    make_tasks,
    planner_of,
)
from llm_astar_lab.runner.sources import SourceSpec
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Sample
from llm_astar_planner.waypoints.baselines import baseline_sources
from llm_astar_planner.waypoints.source import WaypointReply

HALL = BarrierMap(
    3, (0, 51), (0, 31), (Barrier(10, 0, 25),), (), (Sample((5, 5), (5, 15), 'go round'),)
)
WITH_ORACLE = [SourceSpec(), SourceSpec(baseline_sources()['oracle'], 'oracle')]


def tasks_of(samples, sources=WITH_ORACLE, methods=ALL_METHODS, scale=1):
    variants = list_variants(methods, sources)
    return make_tasks([(sample, scale) for sample in samples], variants, sources, SearchSettings())


def config_of(dataset, sources=WITH_ORACLE, methods=('llm_astar',), **values):
    return BenchmarkConfig(load_samples(dataset), methods, sources, SearchSettings(), **values)


def planned_again(sample, row):
    """Plan a row of scale 1 again, with its waypoints; return the planner and the plan."""
    problem = sample.barrier_map
    planner = planner_of(problem, SearchSettings())
    ends = problem.to_cell(sample.sample.start), problem.to_cell(sample.sample.goal)
    reply = WaypointReply(parse_points(row.waypoints), label=row.source)
    source = AnsweredSource(row.source, reply) if row.waypoints else None
    return planner, planner.plan(make_request(ends, row.method, source, SearchSettings()))


def untimed(row):
    """Return a row's text without its times and beyond the digits that are stored."""
    length = round(row.length, 6)
    return str(replace(row, seconds_source=0.0, seconds_search=0.0, length=length))


class FakeSource:
    """Counts queries; returns a reply, or raises without one."""

    name = 'broken'

    def __init__(self, reply=None):
        self.reply, self.asked, self.busy, self.most = reply, 0, 0, 0
        self.lock = threading.Lock()

    def waypoints(self, _):
        with self.lock:
            self.asked += 1
            self.busy += 1
            self.most = max(self.most, self.busy)
        time.sleep(0.01)
        with self.lock:
            self.busy -= 1
        if self.reply is None:
            message = 'no such host'
            raise OSError(message)
        return self.reply


def row(variant, operation=100.0, length=30.0, map_id=0, pair=0, scale=1, **values):
    found = {'code': 'NONE', 'operation': operation, 'storage': operation, 'length': length}
    return Row(map_id, pair, scale, *variant, **{**found, **values})


A_STAR, NONE, ORACLE = Variant('astar'), Variant('llm_astar'), Variant('llm_astar', 'oracle')
MODEL = Variant('llm_astar', 'replay', 'few_shot', 'parrot-1')


def rows_with(factor, spread=0.0, variant=ORACLE):
    """Return rows of 20 maps on which waypoints multiply the work by about `factor`."""
    random = np.random.default_rng(0)
    rows = []
    for index in range(40):
        here = {'map_id': index // 2, 'pair': index % 2}
        work = 50.0 * factor * math.exp(spread * random.normal())
        rows += [row(A_STAR, **here), row(NONE, 50.0, **here), row(variant, work, 31.0, **here)]
    return rows
