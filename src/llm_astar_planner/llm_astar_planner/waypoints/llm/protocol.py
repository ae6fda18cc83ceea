# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Completions, of a chat or a text: the request, how it adapts to an endpoint, the response."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import printable

from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure, is_retryable, retry_after
from llm_astar_planner.waypoints.prompts.reply_parser import MAX_REPLY_CHARS
from llm_astar_planner.waypoints.source import RESPONSE_FORMATS, Message, SourceStatus

# Removes the key from a text.
Clean = Callable[[str], str]
_NAMES_FORMAT = re.compile('response_format|json_schema|json_object|grammar', re.IGNORECASE)
MAX_ERROR_CHARS, MAX_CODE_CHARS = 2000, 60
# Control characters in the text of a model become blanks, but for the ends of lines and tabs.
_CONTROLS = {code: ' ' for code in (*range(32), *range(127, 160)) if chr(code) not in '\t\n'}
_STATUS_OF = {401: SourceStatus.AUTH, 403: SourceStatus.AUTH, 429: SourceStatus.REFUSED}


@dataclass(frozen=True)
class Dialect:
    """The request fields that an endpoint is known to accept.

    With `is_completion` a model without chat continues a text, until it writes `stop`.
    """

    max_output_tokens: int = 1000
    temperature: float | None = 0.0
    response_format: str = 'text'
    tokens_field: str = 'max_tokens'
    is_completion: bool = False
    stop: str = ''
    seed: int | None = None

    @property
    def path(self) -> str:
        """Where below the base URL requests are posted to."""
        return 'completions' if self.is_completion else 'chat/completions'

    def body(
        self, model: str, messages: Sequence[Message], schema: dict[str, Any]
    ) -> dict[str, Any]:
        """Return the JSON body of a request that is not streamed."""
        body: dict[str, Any] = {'messages': [message._asdict() for message in messages]}
        if self.is_completion:
            body = {'prompt': text_to_complete(messages), 'stop': self.stop and [self.stop]}
        body |= {'model': model, 'temperature': self.temperature, 'seed': self.seed}
        if self.response_format != 'text':
            body['response_format'] = {'type': self.response_format}
        if self.response_format == 'json_schema':
            named = {'name': 'reply', 'strict': True, 'schema': schema}
            body['response_format']['json_schema'] = named
        if self.tokens_field:
            body[self.tokens_field] = self.max_output_tokens
        # What is empty is left to the server.
        given = {name: value for name, value in body.items() if value not in (None, '')}
        return {'stream': False, **given}

    def ended(self, completion: Completion) -> Completion:
        """Return a completion that ends at `stop`, which some servers ignore."""
        if not (self.is_completion and self.stop):
            return completion
        # A text may begin with the next question at once: there is no line end before it then.
        text = f'\n{completion.text}'.partition(self.stop)[0]
        return completion._replace(text=text[1:])

    def adapted_to(self, failure: EndpointFailure) -> Dialect | None:
        """Return the dialect to try after a failure, None where another would not help."""
        if failure.http not in (400, 422):
            return None
        error = failure.body.lower()
        if self.response_format != 'text' and _NAMES_FORMAT.search(failure.body):
            weaker = RESPONSE_FORMATS[RESPONSE_FORMATS.index(self.response_format) - 1]
            return replace(self, response_format=weaker)
        if self.tokens_field and ('max_tokens' in error or 'max_completion_tokens' in error):
            other = 'max_completion_tokens' if self.tokens_field == 'max_tokens' else ''
            return replace(self, tokens_field=other)
        if self.temperature is not None and 'temperature' in error:
            return replace(self, temperature=None)
        if self.seed is not None and 'seed' in error:
            return replace(self, seed=None)
        return None


def text_to_complete(messages: Sequence[Message]) -> str:
    """Return a conversation as one text for a completion model: it ends where the answer begins.

    The first message holds the prompt. After it come answers, and questions about them that ask
    for a path.
    """
    first, *others = messages
    text = first.content
    for role, content in others:
        answer, question = f' {content.strip()}', f'\n\n{content}\nGenerated Path:'
        text += answer if role == 'assistant' else question
    return text


class Completion(NamedTuple):
    """A model's answer: its text, why it ended, and the tokens it took.

    `fingerprint` is how the server identifies the exact model, '' where it does not.
    """

    text: str
    finish_reason: str = ''
    refusal: str = ''
    prompt_tokens: int = 0
    completion_tokens: int = 0
    fingerprint: str = ''


class HttpReply(NamedTuple):
    """A server's response; the body is decoded and bounded."""

    status: int
    headers: Mapping[str, str]
    body: bytes


def read_completion(reply: HttpReply, clean: Clean) -> Completion:
    """Return the completion in an HTTP response; `clean` removes the key from its texts.

    Raises EndpointFailure: AUTH, REFUSED or ERROR for an error, MALFORMED for anything else.
    """
    data = read_json(reply.body)
    if not 200 <= reply.status < 300:
        raise http_failure(reply, data, clean)
    try:
        choice = data['choices'][0]
        # The choice of a chat is a message, that of a text completion a text.
        message = choice['message'] if 'message' in choice else {'content': choice['text']}
        text = message_text(message.get('content'))[-MAX_REPLY_CHARS:]
        refusal = message_text(message.get('refusal'))[:MAX_ERROR_CHARS]
        reason = message_text(choice.get('finish_reason'))[:MAX_ERROR_CHARS]
    except (TypeError, KeyError, IndexError, AttributeError):
        status, problem = SourceStatus.MALFORMED, 'the reply is no completion'
        if error_in(data) is not None:
            status, problem = SourceStatus.ERROR, 'the endpoint says'
        words = error_words(reply.body, data, clean)
        raise EndpointFailure(status, f'{problem}{words}') from None
    usage = data.get('usage')
    if reason == 'content_filter' and not refusal:
        refusal = 'stopped by a content filter'
    others = reason, refusal, message_text(data.get('system_fingerprint'))
    reason, refusal, fingerprint = (printable(clean(word)) for word in others)
    asked, answered = (token_count(usage, f'{kind}_tokens') for kind in ('prompt', 'completion'))
    text = clean(text).translate(_CONTROLS)
    return Completion(text, reason, refusal, asked, answered, fingerprint[: sources.MAX_NAME])


def read_json(body: bytes) -> Any:  # noqa: ANN401 - any JSON value
    """Return the value of a JSON text in UTF-8, UTF-16 or UTF-32; None where it is none."""
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        return None


def error_in(data: Any) -> Any | None:  # noqa: ANN401 - any JSON value
    """Return the description of an error, an object or a text, None where there is none."""
    if isinstance(data, list) and data:
        data = data[0]
    return data.get('error') if isinstance(data, dict) else None


def error_words(body: bytes, data: Any, clean: Clean) -> str:  # noqa: ANN401 - any JSON value
    """Return ` (code): message` as a server words an error, without the key and bounded.

    A body without a message is the message itself.
    """
    error = error_in(data)
    if error is None:
        error = data
    if not isinstance(error, dict):
        error = {'message': error}
    message = first_text(error, 'message', 'detail', 'error')
    if not message:
        message = body[:MAX_ERROR_CHARS].decode(json.detect_encoding(body), errors='replace')
    code = printable(clean(first_text(error, 'code', 'type', 'status')))[:MAX_CODE_CHARS]
    message = printable(clean(message[:MAX_ERROR_CHARS]))
    return (f' ({code})' if code else '') + (f': {message}' if message else '')


def first_text(values: Mapping[str, Any], *names: str) -> str:
    """Return the first of some values that is a text or a number, '' where none is."""
    for value in map(values.get, names):
        if isinstance(value, str) or (isinstance(value, int) and abs(value) < 2**63):
            return str(value)
    return ''


def http_failure(reply: HttpReply, data: Any, clean: Clean) -> EndpointFailure:  # noqa: ANN401
    """Return the failure that an HTTP error status and its body stand for."""
    body = reply.body[:MAX_ERROR_CHARS].decode(errors='replace')
    status = _STATUS_OF.get(reply.status, SourceStatus.ERROR)
    if 'insufficient_quota' in body:
        status = SourceStatus.REFUSED
    detail = f'HTTP {reply.status}{error_words(reply.body, data, clean)}'
    return EndpointFailure(
        status, detail, http=reply.status, body=clean(body),
        retryable=is_retryable(reply.status, body), retry_after=retry_after(reply.headers),
    )  # fmt: skip


def message_text(content: Any) -> str:  # noqa: ANN401 - any JSON value
    """Return the text of a message; some endpoints send it as a list of parts."""
    if isinstance(content, list):
        parts = [part.get('text') for part in content if isinstance(part, dict)]
        content = ''.join(part for part in parts if isinstance(part, str))
    # JSON may hold a lone surrogate, which cannot be encoded again: replace it.
    return content.encode(errors='replace').decode() if isinstance(content, str) else ''


def token_count(usage: Any, name: str) -> int:  # noqa: ANN401 - any JSON value
    """Return a count from the `usage` object, 0 where it is missing or absurd."""
    value = usage.get(name) if isinstance(usage, dict) else None
    return value if isinstance(value, int) and 0 <= value < 2**40 else 0
