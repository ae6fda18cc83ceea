"""Retries, circuit breaker and call budget, each on its own."""

import math

import pytest
from llm_astar_planner.waypoints.llm.resilience import (
    COOLDOWN_S,
    MAX_DETAIL,
    THRESHOLD,
    CallBudget,
    CircuitBreaker,
    EndpointFailure,
    is_retryable,
    retry_after,
    retry_delay,
)
from llm_astar_planner.waypoints.source import SourceStatus


class Clock:
    now = 1000.0

    def __call__(self):
        return self.now


def failure(status=SourceStatus.UNREACHABLE, **facts):
    return EndpointFailure(status, 'gone', retryable=True, **facts)


def is_open(breaker):
    try:
        breaker.check()
    except EndpointFailure:
        return True
    return False


def test_backoff_doubles_with_jitter_under_a_cap():
    for attempt in range(1, 9):
        expected = min(8.0, 0.5 * 2 ** (attempt - 1))
        delays = [retry_delay(failure(), attempt, 8) for _ in range(50)]
        assert all(0.75 * expected <= delay <= 1.25 * expected for delay in delays)
        assert len(set(delays)) > 1
    assert retry_delay(failure(), 9, 8) is None
    assert retry_delay(EndpointFailure(SourceStatus.AUTH, ''), 1, 8) is None
    assert retry_delay(failure(retry_after=42.0), 1, 8) == 42.0


def test_only_errors_that_may_pass_by_themselves_are_retried():
    assert all(is_retryable(http, '') for http in (408, 409, 429, 500, 502, 503, 504, 529))
    assert not any(is_retryable(http, '') for http in (301, 400, 401, 403, 404, 422))
    assert not is_retryable(429, '{"code": "insufficient_quota"}')


def test_retry_after_in_seconds():
    assert retry_after({'Retry-After': '3'}) == 3.0
    assert retry_after({'retry-after': '0.5'}) == 0.5
    assert retry_after({'retry-after': '-5'}) == 0.0
    for odd in ('', 'soon', 'nan', 'inf', '1e999', 'Wed, 21 Oct 2015 07:28:00 GMT'):
        assert retry_after({'retry-after': odd}) is None
    assert retry_after({}) is None


def test_the_breaker_opens_after_failures_in_a_row_and_closes_again():
    clock = Clock()
    breaker = CircuitBreaker(clock)
    for _ in range(THRESHOLD - 1):
        breaker.record_failure(failure())
    with breaker.watched():
        pass  # a success
    for _ in range(THRESHOLD - 1):
        breaker.record_failure(failure())
    assert not is_open(breaker)
    breaker.record_failure(failure(SourceStatus.TIMEOUT))
    assert is_open(breaker)
    clock.now += COOLDOWN_S + 1
    assert not is_open(breaker)
    breaker.record_failure(failure())
    assert is_open(breaker)


def test_the_breaker_opens_according_to_the_kind_of_failure():
    for status, facts, seconds in (
        (SourceStatus.AUTH, {}, math.inf),
        (SourceStatus.REFUSED, {}, COOLDOWN_S),
        (SourceStatus.REFUSED, {'retry_after': 100.0}, 100.0),
        (SourceStatus.REFUSED, {'retry_after': 1e9}, 3600.0),
        (SourceStatus.REFUSED, {'is_ours': True}, 0.0),
        (SourceStatus.NOT_CONFIGURED, {}, 0.0),
        (SourceStatus.MALFORMED, {}, 0.0),
    ):
        clock = Clock()
        breaker = CircuitBreaker(clock)
        for _ in range(5):
            breaker.record_failure(failure(status, **facts))
        clock.now += min(seconds, 1e6) - 1
        assert is_open(breaker) == (seconds > 0)
        clock.now += 2
        assert is_open(breaker) == math.isinf(seconds)


def test_a_long_detail_is_cut():
    assert len(str(EndpointFailure(SourceStatus.ERROR, 'x\n' * 1000))) == MAX_DETAIL


def test_the_budget_counts_the_last_hour_and_the_last_day():
    clock = Clock()
    budget = CallBudget(2, 100, clock)
    budget.admit()
    budget.admit()
    with pytest.raises(EndpointFailure, match='max_calls_per_hour: 2 are made; next in 3600 s'):
        budget.admit()
    clock.now += 3600
    budget.admit()
    budget.spend(100)
    clock.now += 3600
    with pytest.raises(EndpointFailure) as refused:
        budget.admit()
    assert str(refused.value) == 'max_tokens_per_day: 100 are used; next in 82800 s'
    assert refused.value.status is SourceStatus.REFUSED
    clock.now += 82800
    budget.admit()
    assert budget.values() == {
        'calls_made': 4,
        'calls_left': 1,
        'tokens_used': 100,
        'tokens_left': 100,
    }
    unlimited = CallBudget()
    unlimited.spend(10**9)
    for _ in range(1000):
        unlimited.admit()
    assert unlimited.calls.total == 1000
    assert (unlimited.values()['calls_left'], unlimited.values()['tokens_left']) == (None, None)
