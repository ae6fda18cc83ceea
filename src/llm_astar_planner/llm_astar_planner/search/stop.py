"""Stop flags: how another thread stops a running search, and how a deadline does."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

# A uint8 array of one element, which the compiled loops poll: 0 to go on, anything else to stop.
StopFlag = NDArray[np.uint8]
# Seconds between two looks at a caller's stop flag, so a cancel takes effect within this time.
POLL_PERIOD_S = 0.01


def no_stop() -> StopFlag:
    """Return a stop flag that is not raised; set its one element to 1 to stop a search."""
    return np.zeros(1, dtype=np.uint8)


@contextmanager
def deadline_guard(stop: StopFlag, deadline: float) -> Iterator[StopFlag]:
    """Yield a stop flag that is raised at the deadline or when the caller raises `stop`.

    `deadline` is in monotonic seconds. The caller's flag is only read, so it may serve for several
    searches.
    """
    flag, done = no_stop(), threading.Event()

    def update() -> None:
        flag[0] = stop[0] or time.monotonic() >= deadline

    def poll() -> None:
        while not flag[0]:
            if done.wait(min(POLL_PERIOD_S, max(deadline - time.monotonic(), 0.0))):
                return
            update()

    update()
    threading.Thread(target=poll, name='deadline_guard', daemon=True).start()
    try:
        yield flag
    finally:
        done.set()
