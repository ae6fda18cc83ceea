"""Stop a search in time: at its deadline, or when its caller cancels."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.methods import no_stop

# Seconds between two looks at the caller's flag: what a cancel may take to be seen.
LOOK = 0.01


@contextmanager
def halting(stop: NDArray[np.uint8], deadline: float) -> Iterator[NDArray[np.uint8]]:
    """Yield a stop flag that is raised with the caller's `stop` or at `deadline` (monotonic).

    The caller's own flag is only read, so it may serve for several searches.
    """
    flag, done = no_stop(), threading.Event()

    def is_over() -> bool:
        return bool(stop[0]) or time.monotonic() >= deadline

    def watch() -> None:
        while not done.wait(min(LOOK, max(deadline - time.monotonic(), 0.0))):
            if is_over():
                flag[0] = 1
                return

    flag[0] = is_over()
    watcher = threading.Thread(target=watch, name='halting', daemon=True)
    watcher.start()
    try:
        yield flag
    finally:
        done.set()
