"""When maps and updates have arrived, and when the next one is due."""

from __future__ import annotations

import math
import statistics
import time
from collections import deque
from collections.abc import Callable

# How many of the last intervals are kept; from how many on another message is expected, and from
# how many on one that does not come is worth a warning.
KEPT, FEWEST, REGULAR = 8, 2, 4
# Another message is expected for so many of the usual intervals, and for this many seconds: a
# costmap that is cleared may take longer than usual. Regular are intervals up to as many times
# the usual one.
LATE_PERIODS, LATE_SECONDS = 3.0, 2.0


class MapArrivals:
    """Notes when messages with a map or an update arrived, equal ones included.

    All times are monotonic seconds. `last` is when the last one was made, `period` the usual
    interval. The next one is expected until `latest`; it is overdue after `overdue_at`, if they
    came at regular times. Each is infinite where it is not known.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without any; `clock` tells the time."""
        self.last = -math.inf
        self.period = math.inf
        self.overdue_at = math.inf
        self._soonest = self.latest = math.inf
        self._clock = clock
        self._intervals: deque[float] = deque(maxlen=KEPT)

    def note(self, transit: float = 0.0) -> None:
        """Note a message that has just arrived, `transit` seconds after it was made."""
        before, self.last = self.last, max(self.last, self._clock() - transit)
        if math.isfinite(before):
            self._intervals.append(self.last - before)
        count = len(self._intervals)
        if count < FEWEST:
            return
        self.period = statistics.median(self._intervals)
        self._soonest = self.last + min(self._intervals)
        self.latest = self.last + max(LATE_PERIODS * self.period, LATE_SECONDS)
        is_regular = count >= REGULAR and max(self._intervals) <= LATE_PERIODS * self.period
        self.overdue_at = self.latest if is_regular else math.inf

    def is_due(self, seconds: float) -> bool:
        """Tell whether another message can be expected within so many seconds.

        False for a map that is published once, and for a publisher that has stopped.
        """
        now = self._clock()
        return self._soonest <= now + seconds and now <= self.latest < math.inf

    def warnings(self) -> tuple[str, ...]:
        """Say that the next message is overdue; empty if it is not."""
        now = self._clock()
        if now <= self.overdue_at:
            return ()
        return (
            f'no map or update has come for {now - self.last:.1f} s; '
            f'before, one came every {self.period:.2f} s',
        )
