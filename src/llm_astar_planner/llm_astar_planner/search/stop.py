"""Stop a search in time: at its deadline, or when its caller cancels."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.paper import no_stop
from llm_astar_planner.search.result import STOP_CANCELLED

# Seconds between two looks at the caller's flag: what a cancel may take to be seen.
POLL_PERIOD_S = 0.01


@contextmanager
def deadline_guard(stop: NDArray[np.uint8], deadline: float) -> Iterator[NDArray[np.uint8]]:
    """Yield a stop flag that is raised at the deadline or when the caller raises `stop`.

    It becomes 1 at `deadline` (monotonic seconds) and STOP_CANCELLED once the caller's flag is
    raised. The caller's flag is only read, so it may serve for several searches.
    """
    flag, done = no_stop(), threading.Event()

    def look() -> None:
        flag[0] = STOP_CANCELLED if stop[0] else time.monotonic() >= deadline

    def watch() -> None:
        while not (
            flag[0] or done.wait(min(POLL_PERIOD_S, max(deadline - time.monotonic(), 0.0)))
        ):
            look()

    look()
    watcher = threading.Thread(target=watch, name='deadline_guard', daemon=True)
    watcher.start()
    try:
        yield flag
    finally:
        done.set()
