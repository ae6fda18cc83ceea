"""Ask an OpenAI-compatible endpoint for a completion, with retries, breaker and limits."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.llm.credentials import Endpoint, redact
from llm_astar_planner.waypoints.llm.http import post_json
from llm_astar_planner.waypoints.llm.protocol import Completion, Dialect, read_completion
from llm_astar_planner.waypoints.llm.resilience import (
    CallBudget,
    CircuitBreaker,
    EndpointFailure,
    retry_delay,
)
from llm_astar_planner.waypoints.prompts.template import COMPLETION
from llm_astar_planner.waypoints.source import Message, SourceStatus

# Average characters of a token, for servers that do not count them.
CHARS_PER_TOKEN = 4


@dataclass
class ChatClient:
    """One endpoint and model, with retries, breaker, limits and the dialect learnt so far.

    At most `max_concurrent` requests run at a time. Thread-safe.
    """

    endpoint: Endpoint
    model: str = ''
    dialect: Dialect = field(default_factory=Dialect)
    max_retries: int = 2
    budget: CallBudget = field(default_factory=CallBudget)
    breaker: CircuitBreaker = field(default_factory=CircuitBreaker)
    max_concurrent: int = 2

    def __post_init__(self) -> None:
        """Make the semaphore that bounds concurrent requests."""
        self._slots = threading.BoundedSemaphore(self.max_concurrent)

    def complete(
        self,
        messages: Sequence[Message],
        deadline: float,
        schema: dict[str, Any],
        late_s: float = 0.0,
    ) -> Completion:
        """Return the model's answer before `deadline` (of time.monotonic).

        `schema` is the JSON schema of the answer, for endpoints that take one. A request that is
        running at the deadline may go on for `late_s` seconds; no new one is made.
        Raises EndpointFailure; its text holds no key.
        """
        with self.breaker.watched():
            if time.monotonic() >= deadline:
                raise EndpointFailure(SourceStatus.TIMEOUT, 'no time is left', is_ours=True)
            dialect, attempt = self.dialect, 0
            while True:
                body = dialect.body(self.model, messages, schema)
                try:
                    completion = self._request(body, deadline + late_s)
                    break
                except EndpointFailure as failure:
                    adapted = dialect.adapted_to(failure)
                    if adapted is not None and time.monotonic() < deadline:
                        dialect = adapted
                        continue
                    attempt += 1
                    delay = retry_delay(failure, attempt, self.max_retries)
                    if delay is None or time.monotonic() + delay >= deadline:
                        raise
                time.sleep(delay)
            self.dialect = dialect
        return dialect.ended(completion)

    def problem(self) -> str | None:
        """Return why the endpoint is not asked at present, None where it is."""
        try:
            self.breaker.check()
        except EndpointFailure as failure:
            return f'{failure.status.value}: {failure}'
        return None

    def _request(self, body: dict[str, Any], deadline: float) -> Completion:
        """Make one request, when a slot is free and the limits allow it."""
        key = self.endpoint.key()
        if not self._slots.acquire(timeout=max(0.0, deadline - time.monotonic())):
            busy = f'{self.max_concurrent} requests are running already'
            raise EndpointFailure(SourceStatus.TIMEOUT, busy, is_ours=True)
        try:
            self.budget.admit()
            reply = post_json(
                self.endpoint.url(self.dialect.path),
                body,
                {'Authorization': f'Bearer {key}'} if key else {},
                deadline - time.monotonic(),
                use_proxies=not self.endpoint.is_loopback,
            )
            # A server may echo the request: remove the key before anything else sees the reply.
            completion = read_completion(reply, partial(redact, secret=key))
        except EndpointFailure as failure:
            raise replace(failure, detail=redact(failure.detail, key)) from None
        finally:
            self._slots.release()
        self.budget.spend(count_tokens(completion, body))
        return completion


def count_tokens(completion: Completion, body: dict[str, Any]) -> int:
    """Return the tokens that the server counted, or an estimate where it counts none."""
    counted = completion.prompt_tokens + completion.completion_tokens
    asked = len(body.get('prompt', ''))
    asked += sum(len(message['content']) for message in body.get('messages', ()))
    return counted or (asked + len(completion.text)) // CHARS_PER_TOKEN


def make_client(settings: SourceSettings, stop: str = '') -> ChatClient:
    """Make the client of the endpoint that settings name. Raises EndpointError.

    A text completion ends where the model writes `stop`.
    """
    return ChatClient(
        Endpoint(settings.base_url, settings.api_key_env, settings.api_key_names),
        settings.model,
        Dialect(
            settings.max_output_tokens,
            settings.temperature,
            settings.response_format,
            is_completion=settings.prompt_form == COMPLETION,
            stop=stop,
        ),
        settings.max_retries,
        CallBudget(settings.max_calls_per_hour, settings.max_tokens_per_day),
        max_concurrent=settings.max_concurrent,
    )
