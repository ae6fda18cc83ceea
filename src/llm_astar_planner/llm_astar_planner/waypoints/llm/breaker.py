"""A circuit breaker: an endpoint that keeps failing is left alone for a while."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from llm_astar_planner.waypoints.llm.failure import EndpointFailure
from llm_astar_planner.waypoints.source import SourceStatus

THRESHOLD = 3
COOLDOWN_S = 30.0
MAX_COOLDOWN_S = 3600.0
_COUNTED = (SourceStatus.UNREACHABLE, SourceStatus.TIMEOUT, SourceStatus.ERROR)


class CircuitBreaker:
    """Opens after THRESHOLD failures in a row, at once on AUTH, and for as long as told to.

    An AUTH failure keeps it open until a new source is made, which new parameters do.
    Thread-safe.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin closed; `clock` returns seconds."""
        self._clock = clock
        self._lock = threading.Lock()
        self._failures = 0
        self._open_until = -math.inf
        self._last = EndpointFailure(SourceStatus.ERROR, '')

    def check(self) -> None:
        """Raise the failure that opened the breaker, while it is open."""
        with self._lock:
            left = self._open_until - self._clock()
            last = self._last
        if left <= 0:
            return
        wait = 'until the parameters change' if math.isinf(left) else f'for another {left:.0f} s'
        raise EndpointFailure(last.status, f'not asked {wait}, after: {last.detail}')

    def succeed(self) -> None:
        """Note a success: the count starts again."""
        with self._lock:
            self._failures = 0

    def fail(self, failure: EndpointFailure) -> None:
        """Note a failure, and open the breaker where it is one too many."""
        if failure.is_ours:
            return
        with self._lock:
            self._last = failure
            if failure.status is SourceStatus.AUTH:
                self._open_until = math.inf
            elif failure.status is SourceStatus.REFUSED:
                wait = COOLDOWN_S if failure.retry_after is None else failure.retry_after
                self._open_until = self._clock() + min(MAX_COOLDOWN_S, wait)
            elif failure.status in _COUNTED:
                self._failures += 1
                if self._failures >= THRESHOLD:
                    self._open_until = self._clock() + COOLDOWN_S
