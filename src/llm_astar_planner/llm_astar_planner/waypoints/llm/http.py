"""One HTTP request under a deadline that holds whatever the server does.

Timeouts of HTTP libraries count from byte to byte, and name look-ups have none; so the request
runs as a task that is cancelled when its time is up.
"""

from __future__ import annotations

import asyncio
import functools
import ssl
from collections.abc import Mapping
from typing import Any, NamedTuple

import httpx

from llm_astar_planner.waypoints.llm.failure import EndpointFailure
from llm_astar_planner.waypoints.source import SourceStatus

MAX_BODY = 4 * 2**20
CONNECT_S = 5.0
# How long a cancelled request may take to close its connection.
CLOSE_S = 0.2


class HttpReply(NamedTuple):
    """What a server answered, its body decoded and bounded by MAX_BODY bytes."""

    status: int
    headers: Mapping[str, str]
    body: bytes


def post_json(
    url: str, body: object, headers: Mapping[str, str], limit: float, *, use_proxies: bool
) -> HttpReply:
    """Post `body` as JSON; return or raise within `limit` seconds.

    Redirects are not followed: a key stays with the host it was meant for.
    Raises EndpointFailure TIMEOUT, UNREACHABLE (retryable), MALFORMED or ERROR.
    """
    # A loop of its own, closed without waiting for a name look-up that hangs.
    loop = asyncio.new_event_loop()
    try:
        return loop.run_until_complete(
            _in_time(_post(url, body, headers, limit, use_proxies=use_proxies), limit)
        )
    finally:
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()


async def _in_time(request: Any, limit: float) -> HttpReply:  # noqa: ANN401 - a coroutine
    task = asyncio.ensure_future(request)
    done, _ = await asyncio.wait({task}, timeout=max(0.0, limit))
    if not done:
        task.cancel()
        await asyncio.wait({task}, timeout=CLOSE_S)
        raise _timeout(limit)
    reply: HttpReply = task.result()
    return reply


async def _post(
    url: str, body: object, headers: Mapping[str, str], limit: float, *, use_proxies: bool
) -> HttpReply:
    timeout = httpx.Timeout(limit, connect=min(limit, CONNECT_S))
    try:
        async with (
            httpx.AsyncClient(
                trust_env=use_proxies,
                verify=_tls(),
                timeout=timeout,
            ) as client,
            client.stream('POST', url, json=body, headers=dict(headers)) as response,
        ):
            if ',' in response.headers.get('content-encoding', ''):
                # Packed twice, a small body may grow without end in one step.
                raise httpx.DecodingError('several encodings')
            data = bytearray()
            async for chunk in response.aiter_bytes():
                data += chunk
                if len(data) > MAX_BODY:
                    raise EndpointFailure(
                        SourceStatus.MALFORMED, f'the reply is longer than {MAX_BODY} bytes'
                    )
            return HttpReply(response.status_code, dict(response.headers), bytes(data))
    except httpx.DecodingError:
        raise EndpointFailure(SourceStatus.MALFORMED, 'the reply cannot be decoded') from None
    except (httpx.ReadTimeout, httpx.WriteTimeout, httpx.PoolTimeout):
        raise _timeout(limit) from None
    except (httpx.UnsupportedProtocol, httpx.LocalProtocolError, httpx.InvalidURL) as error:
        raise EndpointFailure(SourceStatus.ERROR, type(error).__name__) from None
    except (ImportError, ValueError) as error:
        # Raised for a proxy variable that is malformed, or of a kind that needs another package.
        detail = f'the proxy settings of the environment do not work: {type(error).__name__}'
        raise EndpointFailure(SourceStatus.ERROR, detail) from None
    except httpx.RemoteProtocolError as error:
        # Its text quotes what came, which may be the request with its key.
        raise _unreachable(url, error, str(error).partition(':')[0]) from None
    except (httpx.TransportError, OSError) as error:
        raise _unreachable(url, error, str(error)) from None


@functools.lru_cache(maxsize=1)
def _tls() -> ssl.SSLContext:
    """Return one context for all requests: loading the certificates takes tens of ms."""
    return httpx.create_ssl_context()


def _unreachable(url: str, error: Exception, words: str) -> EndpointFailure:
    detail = f'{httpx.URL(url).host} is unreachable: {type(error).__name__}: {words}'
    return EndpointFailure(SourceStatus.UNREACHABLE, detail, retryable=True)


def _timeout(limit: float) -> EndpointFailure:
    return EndpointFailure(SourceStatus.TIMEOUT, f'no complete answer within {limit:.1f} s')
