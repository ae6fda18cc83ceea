"""A run on a Dask cluster gives the same rows as a run on one machine."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from benchmark_samples import config_of, untimed
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.runner.config import connect
from llm_astar_lab.runner.engine import run_task
from llm_astar_lab.runner.sources import SourceSpec

EXAMPLE = Path(__file__).parents[4] / 'examples' / 'dask_cluster.py'


def test_the_example_with_two_workers_writes_the_rows_of_one_machine(dataset, tmp_path):
    pytest.importorskip('distributed', reason='the extra cluster is not installed')
    words = ['--map', dataset, '--methods', 'llm_astar', '--source', 'oracle', '--json']
    ended = subprocess.run(
        [sys.executable, EXAMPLE, *words, '--out', tmp_path / 'out'],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    folder = ResultsFolder(tmp_path / 'out')
    local = [outcome.row for task in config_of(dataset).tasks() for outcome in run_task(task)]
    assert [untimed(row) for row in folder.read()] == [untimed(row) for row in local]
    assert len(local) == 3 * 31
    assert str(folder.read_metadata()['parameters']['jobs']).startswith('tcp://127.0.0.1:')


@pytest.mark.filterwarnings('default')
def test_an_unreachable_cluster_is_named(monkeypatch):
    pytest.importorskip('distributed', reason='the extra cluster is not installed')
    monkeypatch.setattr('llm_astar_lab.runner.config.CONNECT_TIMEOUT_S', 0.3)
    with pytest.raises(ValueError, match=r'--dask tcp://127\.0\.0\.1:1: '):
        connect('tcp://127.0.0.1:1', [SourceSpec()]).__enter__()


def test_a_source_that_cannot_be_pickled_is_refused_before_anything_runs():
    class Live:
        name = 'live'
        lock = threading.Lock()

    with pytest.raises(ValueError, match='sources live cannot be sent to another machine; rec'):
        connect('tcp://127.0.0.1:1', [SourceSpec(Live(), 'live')]).__enter__()
