"""Limits on what a run may cost: calls an hour and tokens a day."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

HOUR_S = 3600.0
DAY_S = 86400.0


class CallBudget:
    """Count requests over the last hour and tokens over the last day; 0 means no limit.

    The counts live as long as the process. Thread-safe.
    """

    def __init__(
        self,
        max_calls_per_hour: int = 0,
        max_tokens_per_day: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin with nothing spent; `clock` returns seconds."""
        self._max_calls = max_calls_per_hour
        self._max_tokens = max_tokens_per_day
        self._clock = clock
        self._lock = threading.Lock()
        self._calls: deque[float] = deque()
        self._tokens: deque[tuple[float, int]] = deque()
        self.total_calls = 0
        self.total_tokens = 0

    def admit(self) -> str:
        """Count one request and return '', or return a sentence on why it may not be made."""
        with self._lock:
            now = self._clock()
            self._forget_old(now)
            if 0 < self._max_calls <= len(self._calls):
                wait = HOUR_S - (now - self._calls[0])
                return f'max_calls_per_hour: {self._max_calls} are made; next in {wait:.0f} s'
            if 0 < self._max_tokens <= self._used:
                wait = DAY_S - (now - self._tokens[0][0])
                return f'max_tokens_per_day: {self._max_tokens} are used; next in {wait:.0f} s'
            if self._max_calls:
                self._calls.append(now)
            self.total_calls += 1
            return ''

    def spend(self, tokens: int) -> None:
        """Count the tokens of an answer."""
        with self._lock:
            self.total_tokens += tokens
            if self._max_tokens:
                self._tokens.append((self._clock(), tokens))

    def values(self) -> dict[str, int | None]:
        """Return what was spent since the start, and what is left now; None: no limit."""
        with self._lock:
            self._forget_old(self._clock())
            calls_left = max(0, self._max_calls - len(self._calls))
            tokens_left = max(0, self._max_tokens - self._used)
            return {
                'calls_made': self.total_calls,
                'calls_left': calls_left if self._max_calls else None,
                'tokens_used': self.total_tokens,
                'tokens_left': tokens_left if self._max_tokens else None,
            }

    @property
    def _used(self) -> int:
        return sum(tokens for _, tokens in self._tokens)

    def _forget_old(self, now: float) -> None:
        while self._calls and now - self._calls[0] >= HOUR_S:
            self._calls.popleft()
        while self._tokens and now - self._tokens[0][0] >= DAY_S:
            self._tokens.popleft()
