"""A run on a Dask cluster gives the same rows as a run on one machine."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from llm_astar_planner.benchmark.datasets.generate import generate
from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample
from llm_astar_planner.benchmark.runner.cluster import connect
from llm_astar_planner.benchmark.runner.engine import (
    SearchSettings,
    list_variants,
    make_tasks,
    run_tasks,
)
from llm_astar_planner.benchmark.runner.sources import SourceSpec
from llm_astar_planner.waypoints.baselines import baseline_sources

CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == '__main__':
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def cluster(tmp_path):
    """Start a cluster of two worker processes and return its address."""
    pytest.importorskip('distributed', reason='the extra cluster is not installed')
    script = tmp_path / 'cluster.py'
    script.write_text(CLUSTER)
    with subprocess.Popen(
        [sys.executable, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process.stdout.readline().strip()
        process.communicate('')


@pytest.mark.filterwarnings('default')
def test_rows_are_the_same_row_for_row(cluster):
    sources = [SourceSpec(), SourceSpec(baseline_sources()['oracle'], 'oracle')]
    (barrier_map,) = generate(2, 1)
    bare = replace(barrier_map, samples=())
    samples = [(BenchmarkSample(bare, i, s), 1) for i, s in enumerate(barrier_map.samples)]
    tasks = make_tasks(samples, list_variants(['llm_astar'], sources), sources, SearchSettings())
    spread, local = [], []
    with connect(cluster, sources) as (executor, at_once):
        run_tasks(tasks, executor, at_once, lambda _, outcomes: spread.extend(outcomes))
    with ThreadPoolExecutor(1) as threads:
        run_tasks(tasks, threads, 1, lambda _, outcomes: local.extend(outcomes))

    def untimed(outcomes):
        rows = sorted((outcome.row for outcome in outcomes), key=lambda row: row.key)
        return [str(replace(row, seconds_source=0.0, seconds_search=0.0)) for row in rows]

    assert untimed(spread) == untimed(local)
    assert len(spread) == 30


@pytest.mark.filterwarnings('default')
def test_an_unreachable_cluster_is_named(monkeypatch):
    pytest.importorskip('distributed', reason='the extra cluster is not installed')
    monkeypatch.setattr('llm_astar_planner.benchmark.runner.cluster.CONNECT_TIMEOUT_S', 0.3)
    with pytest.raises(ValueError, match=r'--dask tcp://127\.0\.0\.1:1: '):
        connect('tcp://127.0.0.1:1', [SourceSpec()]).__enter__()


def test_a_source_that_cannot_be_pickled_is_refused_before_anything_runs():
    class Live:
        name = 'live'
        lock = threading.Lock()

    with pytest.raises(ValueError, match='sources live cannot be sent to another machine; rec'):
        connect('tcp://127.0.0.1:1', [SourceSpec(Live(), 'live')]).__enter__()
