"""When to ask again after a failure, and when not to."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Mapping
from dataclasses import dataclass
from email.utils import parsedate_to_datetime

from llm_astar_planner.waypoints.llm.failure import EndpointFailure

RETRYABLE_HTTP = frozenset({408, 409, 429})
FIRST_DELAY_S = 0.5
MAX_DELAY_S = 8.0


@dataclass(frozen=True)
class RetryPolicy:
    """Up to `max_retries` more tries, 0.5 * 2^n seconds apart, with jitter and a cap."""

    max_retries: int = 2

    def delay(self, failure: EndpointFailure, attempt: int) -> float | None:
        """Return how long to wait before the next try after `attempt` tries failed, or None."""
        if not failure.retryable or attempt > self.max_retries:
            return None
        if failure.retry_after is not None:
            return failure.retry_after
        backoff = min(MAX_DELAY_S, FIRST_DELAY_S * 2.0 ** (attempt - 1))
        # Jitter keeps many robots from asking in step; it guards nothing.
        return backoff * random.uniform(0.75, 1.25)  # noqa: S311


def is_retryable(http: int, body: str) -> bool:
    """Tell whether an HTTP error may pass: not where the account has no quota left."""
    if 'insufficient_quota' in body:
        return False
    return http in RETRYABLE_HTTP or http >= 500


def retry_after(headers: Mapping[str, str]) -> float | None:
    """Return the seconds a Retry-After header asks for, given as seconds or as a date."""
    value = {name.lower(): text for name, text in headers.items()}.get('retry-after', '')
    try:
        seconds = float(value)
    except ValueError:
        try:
            seconds = parsedate_to_datetime(value).timestamp() - time.time()
        except (ValueError, TypeError, OverflowError):
            return None
    return max(0.0, seconds) if math.isfinite(seconds) else None
