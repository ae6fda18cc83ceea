"""The request body, and how it gives way where an endpoint does not know a field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from llm_astar_planner.waypoints.prompts.message import Message

RESPONSE_FORMATS = ('text', 'json_object', 'json_schema')
# What servers say when the prompt does not fit: OpenAI, vLLM, llama.cpp, Ollama, Anthropic.
_TOO_LONG = (
    'context_length',
    'context length',
    'context size',
    'context window',
    'exceed_context',
    'prompt is too long',
    'prompt too long',
    'too many tokens',
    'maximum context',
)


@dataclass(frozen=True)
class Dialect:
    """Which fields the endpoint takes, as far as it is known."""

    max_output_tokens: int = 1000
    temperature: float | None = 0.0
    response_format: str = 'text'
    tokens_field: str = 'max_tokens'

    def body(
        self, model: str, messages: Sequence[Message], schema: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """Return the JSON body of a request that is answered in one piece."""
        body: dict[str, Any] = {
            'messages': [message._asdict() for message in messages],
            'stream': False,
        }
        if model:
            body['model'] = model
        if self.tokens_field:
            body[self.tokens_field] = self.max_output_tokens
        if self.temperature is not None:
            body['temperature'] = self.temperature
        if schema is not None and self.response_format == 'json_schema':
            named = {'name': 'reply', 'strict': True, 'schema': schema}
            body['response_format'] = {'type': 'json_schema', 'json_schema': named}
        elif schema is not None and self.response_format == 'json_object':
            body['response_format'] = {'type': 'json_object'}
        return body

    def adapted(self, error: str) -> Dialect | None:
        """Return the dialect to try after a 400 with this text, or None where nothing is left."""
        error = error.lower()
        names_format = any(
            word in error for word in ('response_format', 'json_schema', 'json_object', 'grammar')
        )
        if names_format and self.response_format != 'text':
            weaker = RESPONSE_FORMATS[RESPONSE_FORMATS.index(self.response_format) - 1]
            return replace(self, response_format=weaker)
        if self.tokens_field and ('max_tokens' in error or 'max_completion_tokens' in error):
            other = 'max_completion_tokens' if self.tokens_field == 'max_tokens' else ''
            return replace(self, tokens_field=other)
        if self.temperature is not None and 'temperature' in error:
            return replace(self, temperature=None)
        return None


def is_context_too_long(error: str) -> bool:
    """Tell whether an error says that the prompt does not fit the model's context."""
    error = error.lower()
    return any(words in error for words in _TOO_LONG)
