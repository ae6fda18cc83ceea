# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Ask an OpenAI-compatible endpoint for a completion, with retries, breaker and limits.

Each HTTP request ends by its deadline in every case. The timeouts of HTTP libraries start again at
every byte, and name look-ups have none, so the request runs as a task that is cancelled when its
time is up.
"""

import asyncio
import functools
import logging
import threading
import time
from collections.abc import Coroutine, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import replace
from typing import Any

import httpx

from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.llm import protocol, resilience
from llm_astar_planner.waypoints.llm.credentials import Endpoint, redact
from llm_astar_planner.waypoints.llm.protocol import Completion, HttpReply
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.source import COMPLETION, Message, SourceStatus

# Average characters of a token, for servers that do not count them.
CHARS_PER_TOKEN = 4
MAX_BODY = 4 * 2**20
CONNECT_S = 5.0
# How long a cancelled request may take to close its connection.
CLOSE_S = 0.2
ENCODING = {'Accept-Encoding': 'identity'}
# The TLS context is made once: loading the certificates takes tens of ms.
tls_context = functools.cache(httpx.create_ssl_context)


# Whether the present request is one of ours.
_IS_OURS: ContextVar[bool] = ContextVar('_IS_OURS', default=False)


# Keeps the loggers of httpx and httpcore from reporting our requests: they quote headers.
for _part in ('x', 'core.connection', 'core.http11', 'core.http2', 'core.proxy', 'core.socks'):
    logging.getLogger(f'http{_part}').addFilter(lambda _: not _IS_OURS.get())


class ChatClient:
    """One endpoint and model, with retries, breaker, limits and the dialect learnt so far.

    At most `max_concurrent` requests of the settings run at a time. Thread-safe.
    """

    def __init__(self, settings: SourceSettings, stop: str = '') -> None:
        """Take the endpoint that settings name. Raises EndpointError.

        A text completion ends where the model writes `stop`.
        """
        self.endpoint = Endpoint(settings.base_url, settings.api_key_env, settings.api_key_names)
        self.model, self._settings = settings.model, settings
        self.dialect = protocol.Dialect(
            settings.max_output_tokens, settings.temperature, settings.response_format,
            is_completion=settings.prompt_form == COMPLETION, stop=stop,
            seed=settings.sampling_seed if settings.sampling_seed >= 0 else None,
        )  # fmt: skip
        self.budget = resilience.CallBudget(
            settings.max_calls_per_hour, settings.max_tokens_per_day
        )
        self.breaker = resilience.CircuitBreaker()
        self._slots = threading.BoundedSemaphore(settings.max_concurrent)

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
            completion = self._ask_again(messages, deadline, schema, late_s)
        return self.dialect.ended(completion)

    def _ask_again(
        self, messages: Sequence[Message], deadline: float, schema: dict[str, Any], late_s: float
    ) -> Completion:
        """Ask, and again in another dialect or after a pause where that may help."""
        dialect, attempt = self.dialect, 0
        while True:
            body = dialect.body(self.model, messages, schema)
            try:
                completion = self._request(body, deadline + late_s)
            except EndpointFailure as failure:
                adapted = dialect.adapted_to(failure)
                if adapted is not None and time.monotonic() < deadline:
                    dialect = adapted
                    continue
                attempt += 1
                delay = resilience.retry_delay(failure, attempt, self._settings.max_retries)
                if delay is None or time.monotonic() + delay >= deadline:
                    raise
            else:
                self.dialect = dialect
                return completion
            time.sleep(delay)

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
            busy = f'{self._settings.max_concurrent} requests are running already'
            raise EndpointFailure(SourceStatus.TIMEOUT, busy, is_ours=True)
        try:
            self.budget.admit()
            reply = post_json(
                self.endpoint.url(self.dialect.path), body,
                {'Authorization': f'Bearer {key}'} if key else {}, deadline - time.monotonic(),
                use_proxies=not self.endpoint.is_loopback,
            )  # fmt: skip
            # A server may echo the request: remove the key before anything else sees the reply.
            completion = protocol.read_completion(reply, functools.partial(redact, secret=key))
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


def post_json(
    url: str, body: object, headers: Mapping[str, str], limit: float, *, use_proxies: bool
) -> HttpReply:
    """Post `body` as JSON; return or raise within `limit` seconds.

    Redirects are not followed, so that a key is never sent to another host.
    Raises EndpointFailure TIMEOUT, UNREACHABLE (retryable), MALFORMED or ERROR.
    """
    # Its own event loop, closed without waiting for a name look-up that hangs.
    loop = asyncio.new_event_loop()
    ours = _IS_OURS.set(True)
    try:
        request = post(url, body, headers, limit, use_proxies=use_proxies)
        return loop.run_until_complete(wait_at_most(limit, request))
    finally:
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()
        _IS_OURS.reset(ours)


async def wait_at_most(limit: float, request: Coroutine[Any, Any, HttpReply]) -> HttpReply:
    """Return the request's reply, or cancel it after `limit` seconds and raise TIMEOUT."""
    task = asyncio.ensure_future(request)
    done, _ = await asyncio.wait({task}, timeout=max(0.0, limit))
    if not done:
        task.cancel()
        # Or asyncio logs an error that comes too late, which may quote the server.
        task.add_done_callback(lambda late: late.cancelled() or late.exception())
        await asyncio.wait({task}, timeout=CLOSE_S)
        raise timed_out(limit)
    return task.result()


async def post(
    url: str, body: object, headers: Mapping[str, str], limit: float, *, use_proxies: bool
) -> HttpReply:
    """Post `body` as JSON and translate httpx's exceptions to EndpointFailure."""
    timeout = httpx.Timeout(limit, connect=min(limit, CONNECT_S))
    try:
        async with (
            httpx.AsyncClient(
                trust_env=use_proxies, verify=tls_context(), timeout=timeout
            ) as client,
            client.stream('POST', url, json=body, headers=ENCODING | dict(headers)) as response,
        ):
            data = await read_body(response)
            return HttpReply(response.status_code, dict(response.headers), data)
    except (httpx.ReadTimeout, httpx.WriteTimeout, httpx.PoolTimeout):
        raise timed_out(limit) from None
    except (httpx.UnsupportedProtocol, httpx.LocalProtocolError, httpx.InvalidURL) as error:
        raise EndpointFailure(SourceStatus.ERROR, type(error).__name__) from None
    except (ImportError, ValueError) as error:
        # Raised for a proxy variable that is malformed, or that needs another package.
        detail = f'the proxy settings of the environment do not work: {type(error).__name__}'
        raise EndpointFailure(SourceStatus.ERROR, detail) from None
    except (httpx.TransportError, OSError) as error:
        words = str(error)
        if isinstance(error, httpx.RemoteProtocolError):
            # Its text quotes the response, which may echo the request with its key.
            words = words.partition(':')[0]
        detail = f'{httpx.URL(url).host} is unreachable: {type(error).__name__}: {words}'
        raise EndpointFailure(SourceStatus.UNREACHABLE, detail, retryable=True) from None


async def read_body(response: httpx.Response) -> bytes:
    """Return the body. Raises EndpointFailure MALFORMED if it is compressed or over MAX_BODY.

    No compression is asked for: a few bytes may become gigabytes.
    """
    name = response.headers.get('content-encoding', 'identity').strip().lower()
    if name != 'identity':
        problem = f'the reply cannot be decoded: {name[:40]!r} was not asked for'
        raise EndpointFailure(SourceStatus.MALFORMED, problem)
    data = bytearray()
    async for chunk in response.aiter_raw():
        data += chunk
        if len(data) > MAX_BODY:
            problem = f'the reply is longer than {MAX_BODY} bytes'
            raise EndpointFailure(SourceStatus.MALFORMED, problem)
    return bytes(data)


def timed_out(limit: float) -> EndpointFailure:
    """Return the failure of a request that took longer than `limit` seconds."""
    return EndpointFailure(SourceStatus.TIMEOUT, f'no complete answer within {limit:.1f} s')
