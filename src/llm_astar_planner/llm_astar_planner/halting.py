"""Stop a search in time: at its deadline, or when its caller cancels."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search.methods import no_stop
from llm_astar_planner.search.result import GIVEN_UP

# Seconds between two looks at the caller's flag: what a cancel may take to be seen.
LOOK = 0.01


@contextmanager
def halting(stop: NDArray[np.uint8], deadline: float) -> Iterator[NDArray[np.uint8]]:
    """Yield a stop flag: GIVEN_UP once the caller raised `stop`, 1 from `deadline` (monotonic) on.

    The caller's own flag is only read, so it may serve for several searches.
    """
    flag, done = no_stop(), threading.Event()

    def look() -> None:
        flag[0] = GIVEN_UP if stop[0] else time.monotonic() >= deadline

    def watch() -> None:
        while not (flag[0] or done.wait(min(LOOK, max(deadline - time.monotonic(), 0.0)))):
            look()

    look()
    watcher = threading.Thread(target=watch, name='halting', daemon=True)
    watcher.start()
    try:
        yield flag
    finally:
        done.set()
