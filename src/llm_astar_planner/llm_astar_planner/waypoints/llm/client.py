"""Ask an OpenAI-compatible endpoint for one completion, with everything that can go wrong."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from llm_astar_planner.waypoints.llm.breaker import CircuitBreaker
from llm_astar_planner.waypoints.llm.completion import Completion, read_completion
from llm_astar_planner.waypoints.llm.credentials import Endpoint
from llm_astar_planner.waypoints.llm.failure import EndpointFailure
from llm_astar_planner.waypoints.llm.http import post_json
from llm_astar_planner.waypoints.llm.limits import CallBudget
from llm_astar_planner.waypoints.llm.protocol import Dialect, is_context_too_long
from llm_astar_planner.waypoints.llm.redaction import redact, redact_bytes
from llm_astar_planner.waypoints.llm.resilience import RetryPolicy
from llm_astar_planner.waypoints.prompts.message import Message
from llm_astar_planner.waypoints.source import SourceStatus

# Where a server counts no tokens, about how many characters one is.
CHARS_PER_TOKEN = 4


@dataclass
class ChatClient:
    """One endpoint and model: retries, breaker, limits and what was learnt of its dialect.

    At most `max_concurrent` requests are under way at a time. Thread-safe.
    """

    endpoint: Endpoint
    model: str = ''
    dialect: Dialect = field(default_factory=Dialect)
    retry: RetryPolicy = field(default_factory=RetryPolicy)
    budget: CallBudget = field(default_factory=CallBudget)
    breaker: CircuitBreaker = field(default_factory=CircuitBreaker)
    max_concurrent: int = 2

    def __post_init__(self) -> None:
        """Make the slots that requests take turns in."""
        self._slots = threading.BoundedSemaphore(self.max_concurrent)

    def complete(
        self,
        messages: Sequence[Message],
        deadline: float,
        schema: dict[str, Any] | None = None,
        late_s: float = 0.0,
    ) -> Completion:
        """Return the model's answer before `deadline` (of time.monotonic).

        `schema` is the JSON schema of the answer, for endpoints that take one. A request under
        way at the deadline may go on for `late_s` seconds; none is made anew.
        Raises EndpointFailure; its text holds no key.
        """
        self.breaker.check()
        if time.monotonic() >= deadline:
            raise EndpointFailure(SourceStatus.TIMEOUT, 'no time is left', is_ours=True)
        try:
            completion = self._with_retries(messages, deadline, schema, late_s)
        except EndpointFailure as failure:
            self.breaker.fail(failure)
            raise
        self.breaker.succeed()
        return completion

    def state(self) -> str:
        """Return why the endpoint is not asked at present, '' where it is."""
        try:
            self.breaker.check()
        except EndpointFailure as failure:
            return f'{failure.status.value}: {failure}'
        return ''

    def _with_retries(
        self,
        messages: Sequence[Message],
        deadline: float,
        schema: dict[str, Any] | None,
        late_s: float,
    ) -> Completion:
        attempt = 0
        dialect = self.dialect
        while True:
            result = self._try(dialect.body(self.model, messages, schema), deadline + late_s)
            if isinstance(result, Completion):
                self.dialect = dialect
                return result
            adapted = _adapted(dialect, result)
            if adapted is not None and time.monotonic() < deadline:
                dialect = adapted
                continue
            attempt += 1
            delay = self.retry.delay(result, attempt)
            if delay is None or time.monotonic() + delay >= deadline:
                raise result
            time.sleep(delay)

    def _try(self, body: dict[str, Any], deadline: float) -> Completion | EndpointFailure:
        try:
            return self._once(body, deadline)
        except EndpointFailure as failure:
            return failure

    def _once(self, body: dict[str, Any], deadline: float) -> Completion:
        """Make one request, when it is its turn and the limits allow it."""
        key = self.endpoint.key()
        if not self._slots.acquire(timeout=max(0.0, deadline - time.monotonic())):
            busy = f'{self.max_concurrent} requests are under way already'
            raise EndpointFailure(SourceStatus.TIMEOUT, busy, is_ours=True)
        try:
            refused = self.budget.admit()
            if refused:
                raise EndpointFailure(SourceStatus.REFUSED, refused, is_ours=True)
            completion = self._post(body, key, deadline - time.monotonic())
        finally:
            self._slots.release()
        self.budget.spend(_tokens(completion, body))
        return completion

    def _post(self, body: dict[str, Any], key: str, limit: float) -> Completion:
        headers = {'Authorization': f'Bearer {key}'} if key else {}
        use_proxies = not self.endpoint.is_loopback
        reply = post_json(self.endpoint.url, body, headers, limit, use_proxies=use_proxies)
        # A server may echo the request: the key goes no further than this line.
        completion = read_completion(reply._replace(body=redact_bytes(reply.body, key)))
        return completion._replace(
            text=redact(completion.text, key), refusal=redact(completion.refusal, key)
        )


def _adapted(dialect: Dialect, failure: EndpointFailure) -> Dialect | None:
    if failure.http not in (400, 422) or is_context_too_long(failure.body):
        return None
    return dialect.adapted(failure.body)


def _tokens(completion: Completion, body: dict[str, Any]) -> int:
    """Return what the server counted, or an estimate where it counts nothing."""
    counted = completion.prompt_tokens + completion.completion_tokens
    asked = sum(len(message['content']) for message in body['messages'])
    return counted or (asked + len(completion.text)) // CHARS_PER_TOKEN
