"""Prompt templates: text files with placeholders in braces, shipped ones or the user's own.

For structured output, a prompt also says which JSON is expected; the schema is sent along.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_text

from llm_astar_planner.waypoints.prompts.map_description import Description
from llm_astar_planner.waypoints.source import Message

TEMPLATES = ('few_shot', 'cot', 'repe')
NEEDED = ('start', 'goal', 'horizontal_barriers', 'vertical_barriers')
NAMES = (*NEEDED, 'x_min', 'x_max', 'y_min', 'y_max')
MAX_TEMPLATE_BYTES = 65536
_PLACEHOLDER = re.compile(r'\{(' + '|'.join(NAMES) + r')\}')
_POINT: dict[str, Any] = {
    'type': 'object',
    'properties': {'x': {'type': 'number'}, 'y': {'type': 'number'}},
    'required': ['x', 'y'],
    'additionalProperties': False,
}
_JSON_REQUEST = (
    'Write the whole reply as one JSON object: {thought}"path": [{{"x": 5, "y": 5}}, ...]}}, '
    'with the points of the generated path in order, and nothing around it.'
)


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

    def render(self, description: Description) -> tuple[Message, ...]:
        """Return the messages that ask for a path on a described map."""
        values = description.values()
        text = _PLACEHOLDER.sub(lambda match: values[match.group(1)], self.text).strip()
        return (Message('user', text),)


def template_path(name: str) -> Path:
    """Return the file of a shipped template, for users to copy. Raises TemplateError."""
    if name not in TEMPLATES:
        raise TemplateError(f'prompt: {name!r} is none of {", ".join(TEMPLATES)}')
    return Path(__file__).with_name(f'{name}.txt')


def load_template(prompt: str) -> Template:
    """Load a shipped template by name, or a user's by its path; the file's stem is its name.

    Raises TemplateError where there is none, or where a needed placeholder is missing.
    """
    if prompt in TEMPLATES:
        path = template_path(prompt)
    elif '/' in prompt or prompt.endswith('.txt'):
        path = Path(prompt).expanduser()
    else:
        raise TemplateError(
            f'prompt: {prompt!r} is none of {", ".join(TEMPLATES)}, and no path to a file'
        )
    try:
        text = read_text(path, TemplateError, limit=MAX_TEMPLATE_BYTES)
    except TemplateError as error:
        raise TemplateError(f'prompt: {error}') from None
    missing = [name for name in NEEDED if '{' + name + '}' not in text]
    if missing:
        names = ', '.join('{' + name + '}' for name in missing)
        raise TemplateError(f'prompt: {path}: does not use {names}')
    return Template(path.stem, text)


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
    """Return the messages; the last one now says which JSON is expected."""
    *before, last = messages
    request = _JSON_REQUEST.format(thought='{"thought": "...", ' if thinks else '{')
    return (*before, Message(last.role, f'{last.content}\n\n{request}'))
