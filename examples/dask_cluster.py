"""Run `llm-astar bench` on a Dask cluster of two worker processes on this machine.

    pip install 'dask[distributed]'
    python examples/dask_cluster.py --limit 100 --out out/cluster

All options are those of `llm-astar bench`. On several machines start the cluster yourself, as
docs/large-runs.md shows, and name its scheduler with `llm-astar bench --dask ADDRESS`.
"""

import sys
from collections.abc import Sequence

from distributed import LocalCluster
from llm_astar_planner.cli.main import main


def run(options: Sequence[str]) -> int:
    """Start two workers, run the benchmark on them, and return its exit code."""
    # One thread each: a search holds Python's lock for a part of its time.
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        return main(['bench', '--dask', cluster.scheduler_address, *options])


# The workers import this file as well.
if __name__ == '__main__':
    raise SystemExit(run(sys.argv[1:]))
