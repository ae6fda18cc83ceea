# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Prompt templates: text files with placeholders in braces, shipped ones or the user's own.

For structured output, a prompt also says which JSON is expected; the schema is sent along.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_text

from llm_astar_planner.waypoints.prompts.map_description import Description
from llm_astar_planner.waypoints.source import Message

TEMPLATES = ('few_shot', 'zero_shot', 'cot', 'repe')
NEEDED = ('start', 'goal', 'horizontal_barriers', 'vertical_barriers')
NAMES = (*NEEDED, 'x_min', 'x_max', 'y_min', 'y_max')
MAX_TEMPLATE_BYTES = 65536
_PLACEHOLDER = re.compile(r'\{(' + '|'.join(NAMES) + r')\}')
_NEEDED = tuple('{' + name + '}' for name in NEEDED)
_JSON_REQUEST = (
    'Write the whole reply as one JSON object: {thought}"path": [{{"x": 5, "y": 5}}, ...]}}, '
    'with the points of the generated path in order, and nothing around it.'
)
ASK_FOR_A_LIST = (
    'That holds no list of points. Reply with the route alone, '
    'in the form "Generated Path: [[x1, y1], [x2, y2], ...]".'
)
# How questions began by which earlier versions asked a model to correct its route.
_DOES_NOT_WORK = 'This route does not work:'


class TemplateError(LlmAstarError, ValueError):
    """A prompt template cannot be used; the message names it and what is wrong."""


@dataclass(frozen=True)
class Template:
    """The text of a prompt with placeholders, the NAMES in braces; other braces stay."""

    name: str
    text: str

    @property
    def thinks(self) -> bool:
        """Whether the template asks for thoughts before the path."""
        return 'thought' in self.text.lower()

    @property
    def digest(self) -> str:
        """The SHA-256 of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def render(self, description: Description) -> Message:
        """Return the message that asks for a path on a described map."""
        values = description.values()
        text = _PLACEHOLDER.sub(lambda match: values[match.group(1)], self.text)
        return Message('user', text.strip())


def template_path(name: str) -> Path:
    """Return the file of a shipped template, for users to copy. Raises TemplateError."""
    if name not in TEMPLATES:
        known = ', '.join(TEMPLATES)
        raise TemplateError(f'prompt: {name!r} is none of {known}, and no path to a file')
    return Path(__file__).with_name(f'{name}.txt')


def load_template(prompt: str) -> Template:
    """Load a shipped template by name, or a user's by its path; the file's stem is its name.

    Raises TemplateError where there is none, or where a needed placeholder is missing.
    """
    is_path = prompt not in TEMPLATES and ('/' in prompt or prompt.endswith('.txt'))
    path = Path(prompt).expanduser() if is_path else template_path(prompt)
    try:
        text = read_text(path, TemplateError, limit=MAX_TEMPLATE_BYTES)
    except TemplateError as error:
        raise TemplateError(f'prompt: {error}') from None
    missing = [name for name in _NEEDED if name not in text]
    if missing:
        raise TemplateError(f'prompt: {path}: does not use {", ".join(missing)}')
    return Template(path.stem, text)


def path_schema(*, thinks: bool) -> dict[str, Any]:
    """Return the JSON schema of a path, after a `thought` where the prompt asks for one."""
    properties: dict[str, Any] = {'thought': {'type': 'string'}} if thinks else {}
    point = json_object({'x': {'type': 'number'}, 'y': {'type': 'number'}})
    properties['path'] = {'type': 'array', 'items': point}
    return json_object(properties)


def json_object(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return the JSON schema of an object that has all these properties and no others."""
    closed = {'required': list(properties), 'additionalProperties': False}
    return {'type': 'object', 'properties': properties, **closed}


def ask_for_json(message: Message, *, thinks: bool) -> Message:
    """Return a message that also says which JSON is expected."""
    request = _JSON_REQUEST.format(thought='{"thought": "...", ' if thinks else '{')
    return message._replace(content=f'{message.content}\n\n{request}')


def is_follow_up(text: str) -> bool:
    """Tell whether a message asks about an answer of the model, which stands before it."""
    return text == ASK_FOR_A_LIST or text.startswith(_DOES_NOT_WORK)
