"""Runs tasks on a Dask cluster through the standard executor interface (extra `cluster`)."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager

from llm_astar_lab.runner.sources import SourceSpec

CONNECT_TIMEOUT_S = 10


@contextmanager
def connect(address: str, sources: Sequence[SourceSpec]) -> Iterator[tuple[Executor, int]]:
    """Yield an executor on the Dask scheduler at `address`, and how many tasks to submit at once.

    Workers need this package in the same version. Sources are sent with the tasks, so it must be
    possible to pickle them: baselines and replays can be, live endpoints cannot. Raises
    ValueError.
    """
    try:
        pickle.dumps(sources)
    except (TypeError, AttributeError, pickle.PicklingError):
        names = ', '.join(spec.name for spec in sources)
        message = (
            f'--dask: some of the sources {names} cannot be sent to another machine; '
            'record a transcript and replay it'
        )
        raise ValueError(message) from None
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError:
        message = "--dask needs Dask: pip install 'dask[distributed]'"
        raise ValueError(message) from None
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise ValueError(f'--dask {address}: {error}') from None
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise ValueError(f'--dask {address}: the cluster has no workers')
        with client.get_executor(pure=False) as executor:
            yield executor, 4 * threads
