"""When maps and updates have arrived, and when the next one is due."""

from __future__ import annotations

import math
import statistics
import time
from collections import deque
from collections.abc import Callable

# How many of the last intervals are remembered, and the fewest that make a publisher periodic.
KEPT, LEAST = 8, 2
# A map is overdue after so many of the usual intervals, and not before so many seconds.
OVERDUE_PERIODS, OVERDUE_SECONDS = 3.0, 2.0


class MapArrivals:
    """Notes when messages with a map or an update arrived, equal ones included.

    All times are monotonic seconds. `last` is when the last one was made, `period` the usual
    interval (infinite until one is known), and after `overdue_at` the next one is overdue.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without any; `clock` tells the time."""
        self.last = -math.inf
        self.period = math.inf
        self.overdue_at = math.inf
        self._soonest = math.inf
        self._clock = clock
        self._intervals: deque[float] = deque(maxlen=KEPT)

    def note(self, transit: float = 0.0) -> None:
        """Note a message that has just arrived, `transit` seconds after it was made."""
        before, self.last = self.last, max(self.last, self._clock() - transit)
        if math.isfinite(before):
            self._intervals.append(self.last - before)
        if len(self._intervals) >= LEAST:
            self.period = statistics.median(self._intervals)
            self._soonest = self.last + min(self._intervals)
            self.overdue_at = self.last + max(OVERDUE_PERIODS * self.period, OVERDUE_SECONDS)

    def is_due(self, seconds: float) -> bool:
        """Tell whether another one can be expected within so many seconds.

        False for a map that is published once, and for a publisher that has stopped.
        """
        now = self._clock()
        return self._soonest <= now + seconds and now <= self.overdue_at

    def warnings(self) -> tuple[str, ...]:
        """Say that the next map is overdue; empty if it is not."""
        now = self._clock()
        if now <= self.overdue_at:
            return ()
        return (
            f'no map or update has come for {now - self.last:.1f} s; '
            f'before, one came every {self.period:.2f} s',
        )
