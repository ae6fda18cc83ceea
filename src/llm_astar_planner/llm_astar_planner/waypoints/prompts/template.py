# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Prompt templates: text files with placeholders in braces, shipped ones or the user's own.

A template is an instruction, solved examples and a question.
For structured output, a prompt also says which JSON is expected; the schema is sent along.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_text

from llm_astar_planner.search.result import Cell
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


class Example(NamedTuple):
    """A question as a prompt asks it, and its answer with what introduces it."""

    question: str
    answer: str


class TemplateParts(NamedTuple):
    """The paragraphs of a template; `cue` is how an answer begins, '' where that is open."""

    instruction: str
    question: str
    cue: str


@dataclass(frozen=True)
class Template:
    """The text of a prompt with placeholders, the NAMES in braces; other braces stay."""

    name: str
    text: str

    @property
    def thinks(self) -> bool:
        """Whether the template asks for thoughts before the path."""
        return 'thought' in self.text.lower()

    @cached_property
    def parts(self) -> TemplateParts:
        """The instruction, the examples and the question of the template."""
        return split_template(self.text)

    def prompt_name(self, retrieved: int) -> str:
        """Return the name in replies, rows and transcripts; it says how many examples it got."""
        return f'{self.name}+retrieved_{retrieved}' if retrieved else self.name

    def example(self, description: Description, path: Sequence[Cell]) -> Example:
        """Return a solved question in the template's words; `path` has lattice points (x, y)."""
        values = description.values()
        points = str([list(point) for point in path])
        cue = fill(self.parts.cue, values) or 'Generated Path:'
        return Example(fill(self.parts.question, values), f'{cue} {points}')

    def render(
        self, description: Description, examples: Sequence[Example] | None = None
    ) -> Message:
        """Return the message that asks for a path on a map; `examples` replace its own."""
        text, parts = self.text, self.parts
        if examples is not None:
            solved = (f'{question}\n{answer}' for question, answer in examples)
            question = f'{parts.question}\n{parts.cue}'
            text = '\n\n'.join((parts.instruction, *solved, question))
        return Message('user', fill(text, description.values()))


def split_template(text: str) -> TemplateParts:
    """Split a template that uses all of NEEDED at its empty lines.

    The question begins with the paragraph of the first needed placeholder and takes all that
    follows, but for its cue: the lines after the last needed placeholder, if they end with a
    colon. Earlier paragraphs are examples where their lines begin as those of the question do.
    """
    paragraphs = re.split(r'\n[ \t]*\n', text.strip())
    begin = next(i for i, item in enumerate(paragraphs) if any(map(item.__contains__, _NEEDED)))
    lines = '\n\n'.join(paragraphs[begin:]).split('\n')
    end = len(lines)
    if lines[-1].endswith(':'):
        end = 1 + max(next(i for i, line in enumerate(lines) if name in line) for name in _NEEDED)
    question, cue = '\n'.join(lines[:end]), '\n'.join(lines[end:])
    labels = [_PLACEHOLDER.split(line)[0] for line in question.split('\n')]
    others = [item for item in paragraphs[:begin] if not is_example(item, labels)]
    return TemplateParts('\n\n'.join(others), question, cue)


def is_example(paragraph: str, labels: Sequence[str]) -> bool:
    """Tell whether the lines of a paragraph begin as those of the question do, and go on."""
    lines = paragraph.split('\n')
    return len(lines) > len(labels) and any(labels) and all(map(str.startswith, lines, labels))


def fill(text: str, values: Mapping[str, str]) -> str:
    """Return a text with its placeholders replaced by their values."""
    return _PLACEHOLDER.sub(lambda match: values[match.group(1)], text).strip()


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
