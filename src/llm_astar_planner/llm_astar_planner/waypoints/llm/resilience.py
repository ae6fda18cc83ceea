# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What limits and protects requests to an endpoint: failures, retries, breaker, call budget."""

import math
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field

from llm_astar_msgs_adapter.errors import LlmAstarError, printable

from llm_astar_planner.waypoints.source import SourceStatus

MAX_DETAIL = 300
RETRYABLE_HTTP = frozenset({408, 409, 429})
FIRST_DELAY_S = 0.5
MAX_DELAY_S = 8.0
# The breaker opens after THRESHOLD failures in a row.
THRESHOLD = 3
COOLDOWN_S = 30.0
MAX_COOLDOWN_S = 3600.0
_COUNTED = (SourceStatus.UNREACHABLE, SourceStatus.TIMEOUT, SourceStatus.ERROR)
HOUR_S = 3600.0
DAY_S = 86400.0


@dataclass(eq=False, repr=False)
class EndpointFailure(LlmAstarError, RuntimeError):  # noqa: N818 - a failure outside, no bug
    """A request to an endpoint, or all its retries, brought no completion.

    `status` and `detail` go into the reply. `http` is the HTTP status, 0 where there was none;
    `body` the error text, bounded. `retryable` says that the same request may succeed later, and
    `retry_after` in how many seconds, if the server said so. `is_ours` marks failures that the
    endpoint did not cause, such as a limit of ours.
    """

    status: SourceStatus
    detail: str
    _: KW_ONLY
    http: int = 0
    body: str = ''
    retryable: bool = False
    retry_after: float | None = None
    is_ours: bool = False

    def __post_init__(self) -> None:
        """Make `detail` one line of at most MAX_DETAIL printable characters."""
        self.detail = printable(self.detail[: 4 * MAX_DETAIL])[:MAX_DETAIL]
        super().__init__(self.detail)


def retry_delay(failure: EndpointFailure, attempt: int, max_retries: int) -> float | None:
    """Return the seconds to wait after `attempt` failed tries, None to give up.

    The delays are 0.5 * 2^n seconds, with jitter and a cap, or what the server said.
    """
    if not failure.retryable or attempt > max_retries:
        return None
    if failure.retry_after is not None:
        return failure.retry_after
    backoff = min(MAX_DELAY_S, FIRST_DELAY_S * 2.0 ** (attempt - 1))
    # Jitter keeps a fleet of robots from retrying at the same moments; it protects no secret.
    return backoff * random.uniform(0.75, 1.25)  # noqa: S311


def is_retryable(http: int, body: str) -> bool:
    """Return whether an HTTP error may pass by itself; an account without quota does not."""
    if 'insufficient_quota' in body:
        return False
    return http in RETRYABLE_HTTP or http >= 500


def retry_after(headers: Mapping[str, str]) -> float | None:
    """Return the seconds that a Retry-After header asks to wait; None for none, or a date."""
    value = {name.lower(): text for name, text in headers.items()}.get('retry-after', '')
    try:
        seconds = float(value)
    except ValueError:
        return None
    return max(0.0, seconds) if math.isfinite(seconds) else None


@dataclass(eq=False)
class CircuitBreaker:
    """Stops requests to an endpoint that keeps failing.

    It opens for COOLDOWN_S after THRESHOLD failures in a row, for as long as Retry-After says
    after a REFUSED, and for good after an AUTH failure: new parameters make a new source with a
    new breaker. `clock` returns seconds. Thread-safe.
    """

    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        """Start closed."""
        self._lock = threading.Lock()
        self._failures, self._open_until = 0, -math.inf
        self._last = EndpointFailure(SourceStatus.ERROR, '')

    def check(self) -> None:
        """Raise the failure that opened the breaker, while it is open."""
        with self._lock:
            left = self._open_until - self.clock()
            last = self._last
        if left <= 0:
            return
        wait = 'until the parameters change' if math.isinf(left) else f'for another {left:.0f} s'
        raise EndpointFailure(last.status, f'not asked {wait}, after: {last.detail}')

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Let a request through, or raise as `check` does, and count how it ends."""
        self.check()
        try:
            yield
        except EndpointFailure as failure:
            self.record_failure(failure)
            raise
        with self._lock:
            self._failures = 0

    def record_failure(self, failure: EndpointFailure) -> None:
        """Count a failure, and open the breaker if its kind or the count calls for it."""
        if failure.is_ours:
            return
        with self._lock:
            self._last = failure
            if failure.status is SourceStatus.AUTH:
                self._open_until = math.inf
            elif failure.status is SourceStatus.REFUSED:
                wait = COOLDOWN_S if failure.retry_after is None else failure.retry_after
                self._open_until = self.clock() + min(MAX_COOLDOWN_S, wait)
            elif failure.status in _COUNTED:
                self._failures += 1
                if self._failures >= THRESHOLD:
                    self._open_until = self.clock() + COOLDOWN_S


@dataclass(eq=False)
class Usage:
    """What was used in the last `seconds`, of at most `limit`; 0 means no limit."""

    limit: int
    seconds: float
    clock: Callable[[], float]
    total: int = 0
    # The amounts that still count, each with the time when it no longer does.
    counted: deque[tuple[float, int]] = field(default_factory=deque)

    def add(self, amount: int) -> None:
        """Count what is used now."""
        self.total += amount
        if self.limit:
            self.counted.append((self.clock() + self.seconds, amount))

    def left(self) -> int | None:
        """Return how much may still be used, None without a limit."""
        while self.counted and self.wait() <= 0:
            self.counted.popleft()
        used = sum(amount for _, amount in self.counted)
        return max(0, self.limit - used) if self.limit else None

    def wait(self) -> float:
        """Return the seconds until the oldest entry no longer counts."""
        return self.counted[0][0] - self.clock()


class CallBudget:
    """Limits requests over the last hour and tokens over the last day; 0 means no limit.

    The counts live as long as the process. Thread-safe.
    """

    def __init__(
        self, calls: int = 0, tokens: int = 0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Start with nothing used; `clock` returns seconds."""
        self._lock = threading.Lock()
        self.calls, self.tokens = (
            Usage(calls, HOUR_S, clock),
            Usage(tokens, DAY_S, clock),
        )

    def admit(self) -> None:
        """Count one request. Raises EndpointFailure REFUSED where a limit does not allow it."""
        with self._lock:
            made = 'max_calls_per_hour', self.calls, 'made'
            for name, window, verb in (made, ('max_tokens_per_day', self.tokens, 'used')):
                if window.left() == 0:
                    refusal = f'{name}: {window.limit} are {verb}; next in {window.wait():.0f} s'
                    raise EndpointFailure(SourceStatus.REFUSED, refusal, is_ours=True)
            self.calls.add(1)

    def spend(self, tokens: int) -> None:
        """Count the tokens of an answer."""
        with self._lock:
            self.tokens.add(tokens)

    def values(self) -> dict[str, int | None]:
        """Return what was used since the start, and what is left now (None: no limit)."""
        with self._lock:
            calls, tokens = self.calls, self.tokens
            used = {'calls_made': calls.total, 'tokens_used': tokens.total}
            return used | {'calls_left': calls.left(), 'tokens_left': tokens.left()}
