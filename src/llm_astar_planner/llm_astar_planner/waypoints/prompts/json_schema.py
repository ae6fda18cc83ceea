"""Structured output: the JSON a reply may have to be, as a schema and in words."""

from __future__ import annotations

from typing import Any

from llm_astar_planner.waypoints.prompts.message import Message

_POINT: dict[str, Any] = {
    'type': 'object',
    'properties': {'x': {'type': 'number'}, 'y': {'type': 'number'}},
    'required': ['x', 'y'],
    'additionalProperties': False,
}
_WORDS = (
    'Write the whole reply as one JSON object: {thought}"path": [{{"x": 5, "y": 5}}, ...]}}, '
    'with the points of the generated path in order, and nothing around it.'
)


def path_schema(*, thinks: bool) -> dict[str, Any]:
    """Return the JSON schema of a path, after a `thought` where the prompt asks for one."""
    properties: dict[str, Any] = {'thought': {'type': 'string'}} if thinks else {}
    properties['path'] = {'type': 'array', 'items': _POINT}
    return {
        'type': 'object',
        'properties': properties,
        'required': list(properties),
        'additionalProperties': False,
    }


def ask_for_json(messages: tuple[Message, ...], *, thinks: bool) -> tuple[Message, ...]:
    """Return the messages with the last one saying which JSON is expected."""
    *before, last = messages
    words = _WORDS.format(thought='{"thought": "...", ' if thinks else '{')
    return (*before, Message(last.role, f'{last.content}\n\n{words}'))
