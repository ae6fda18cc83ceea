"""Spread a sweep over machines: a Dask cluster as a standard executor (extra `cluster`)."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager

from llm_astar_planner.benchmark.runner.engine import Asker

CONNECT_S = 10


@contextmanager
def connect(address: str, askers: Sequence[Asker]) -> Iterator[tuple[Executor, int]]:
    """Yield an executor on the Dask scheduler at `address`, and how many tasks to hand it.

    Workers need this package in the same version. Sources travel with the tasks, so they must be
    values: ablations and replays are, live endpoints are not. Raises ValueError.
    """
    try:
        pickle.dumps(askers)
    except (TypeError, AttributeError, pickle.PicklingError):
        names = ', '.join(asker.name for asker in askers)
        message = f'--dask: not all of {names} can travel; record a transcript and replay it'
        raise ValueError(message) from None
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError:
        message = "--dask needs Dask: pip install 'dask[distributed]'"
        raise ValueError(message) from None
    try:
        client = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        message = f'--dask {address}: {error}'
        raise ValueError(message) from None
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            message = f'--dask {address}: the cluster has no workers'
            raise ValueError(message)
        with client.get_executor(pure=False) as executor:
            yield executor, 4 * threads
