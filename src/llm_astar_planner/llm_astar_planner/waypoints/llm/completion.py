"""Read a chat completion, and an endpoint's errors, from the bytes of a response."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from llm_astar_planner.waypoints.llm.failure import EndpointFailure
from llm_astar_planner.waypoints.llm.http import HttpReply
from llm_astar_planner.waypoints.llm.resilience import is_retryable, retry_after
from llm_astar_planner.waypoints.prompts.reply_parser import MAX_REPLY_CHARS
from llm_astar_planner.waypoints.source import SourceStatus

MAX_ERROR_CHARS = 2000
_STATUS_OF = {401: SourceStatus.AUTH, 403: SourceStatus.AUTH, 429: SourceStatus.REFUSED}


class Completion(NamedTuple):
    """What a model answered: its text, how it ended, and what it cost."""

    text: str
    finish_reason: str = ''
    refusal: str = ''
    prompt_tokens: int = 0
    completion_tokens: int = 0


def read_completion(reply: HttpReply) -> Completion:
    """Return the completion in a response.

    Raises EndpointFailure: AUTH, REFUSED, ERROR for an error, MALFORMED for anything else.
    """
    if not 200 <= reply.status < 300:
        raise _error(reply)
    try:
        data = json.loads(reply.body)
        choice = data['choices'][0]
        message = choice['message']
        text = _text(message.get('content'))
        refusal = str(message.get('refusal') or '')
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
        shown = reply.body[:MAX_ERROR_CHARS].decode(errors='replace')
        if '"error"' in shown:
            raise EndpointFailure(SourceStatus.ERROR, f'the endpoint says: {shown}') from None
        raise EndpointFailure(
            SourceStatus.MALFORMED, f'the reply is no chat completion: {shown[:80]}'
        ) from None
    usage = data.get('usage')
    reason = str(choice.get('finish_reason') or '')
    if reason == 'content_filter' and not refusal:
        refusal = 'stopped by a content filter'
    return Completion(
        text=text[-MAX_REPLY_CHARS:],
        finish_reason=reason,
        refusal=refusal,
        prompt_tokens=_count(usage, 'prompt_tokens'),
        completion_tokens=_count(usage, 'completion_tokens'),
    )


def _error(reply: HttpReply) -> EndpointFailure:
    body = reply.body[:MAX_ERROR_CHARS].decode(errors='replace')
    status = _STATUS_OF.get(reply.status, SourceStatus.ERROR)
    if 'insufficient_quota' in body:
        status = SourceStatus.REFUSED
    return EndpointFailure(
        status,
        f'HTTP {reply.status}: {body}',
        http=reply.status,
        body=body,
        retryable=is_retryable(reply.status, body),
        retry_after=retry_after(reply.headers),
    )


def _text(content: Any) -> str:  # noqa: ANN401 - any JSON value
    """Return the text of a message, which some endpoints give in parts."""
    if isinstance(content, list):
        parts = [part.get('text') for part in content if isinstance(part, dict)]
        content = ''.join(part for part in parts if isinstance(part, str))
    # JSON may hold half a character, which could be sent on nowhere.
    return content.encode(errors='replace').decode() if isinstance(content, str) else ''


def _count(usage: Any, name: str) -> int:  # noqa: ANN401 - any JSON value
    value = usage.get(name) if isinstance(usage, dict) else None
    return value if isinstance(value, int) and 0 <= value < 2**40 else 0
