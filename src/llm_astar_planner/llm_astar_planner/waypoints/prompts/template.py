# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Prompt templates: text files with placeholders in braces, shipped ones or the user's own.

A template is an instruction, solved examples and a question. It is put to a model in one of three
forms: `message` is one message of a user with the whole text, `turns` has the examples as turns of
user and assistant, `completion` is one text that a model without chat continues.
For structured output, a prompt also says which JSON is expected; the schema is sent along.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from llm_astar_msgs_adapter.files import read_text

from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.prompts.map_description import Description
from llm_astar_planner.waypoints.source import MESSAGE, TURNS, Message

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


class TemplateError(LlmAstarError, ValueError):
    """A prompt template cannot be used; the message names it and what is wrong."""


class Example(NamedTuple):
    """A question as a prompt asks it, and its answer with what introduces it."""

    question: str
    answer: str


class TemplateParts(NamedTuple):
    """The paragraphs of a template; `cue` is how an answer begins, '' where that is open."""

    instruction: str
    examples: tuple[Example, ...]
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

    @property
    def stop(self) -> str:
        """What a model that goes on after its answer would write next; '' where unknown."""
        label = line_labels(self.parts.question)[0].strip()
        return f'\n{label}' if label else ''

    def prompt_name(self, form: str, retrieved: int) -> str:
        """Return the name of a prompt in replies, rows and transcripts, such as `few_shot+turns`.

        It says which template it was, in which form if that is not `message`, and how many
        examples were retrieved if any were.
        """
        parts = [self.name] if form == MESSAGE else [self.name, form]
        return '+'.join(parts + ([f'retrieved_{retrieved}'] if retrieved else []))

    def example(self, description: Description, path: Sequence[Cell]) -> Example:
        """Return a solved question in the template's words; `path` has lattice points (x, y)."""
        values = description.values()
        points = str([list(point) for point in path])
        cue = fill(self.parts.cue, values) or 'Generated Path:'
        return Example(fill(self.parts.question, values), f'{cue} {points}')

    def render(
        self,
        description: Description,
        form: str = MESSAGE,
        examples: Sequence[Example] | None = None,
    ) -> tuple[Message, ...]:
        """Return the messages that ask for a path on a described map, in one of FORMS.

        `examples` replace the template's own. In the form `completion` the one message holds the
        text to complete.
        """
        values, parts = description.values(), self.parts
        if form == TURNS:
            system = [Message('system', parts.instruction)] if parts.instruction else []
            shown = parts.examples if examples is None else examples
            turns = (turn for example in shown for turn in zip(('user', 'assistant'), example))
            asked = (*system, *turns, ('user', parts.question))
            return tuple(Message(role, fill(content, values)) for role, content in asked)
        text = self.text
        if examples is not None:
            solved = (f'{question}\n{answer}' for question, answer in examples)
            question = f'{parts.question}\n{parts.cue}'
            text = '\n\n'.join((parts.instruction, *solved, question))
        return (Message('user', fill(text, values)),)


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
    found = [(item, read_example(item, line_labels(question))) for item in paragraphs[:begin]]
    instruction = '\n\n'.join(item for item, example in found if example is None)
    return TemplateParts(instruction, tuple(e for _, e in found if e is not None), question, cue)


def line_labels(question: str) -> list[str]:
    """Return what stands before the first placeholder of each line of a question."""
    return [_PLACEHOLDER.split(line)[0] for line in question.split('\n')]


def read_example(paragraph: str, labels: Sequence[str]) -> Example | None:
    """Return the example that a paragraph holds if its lines begin with `labels`, else None."""
    lines, count = paragraph.split('\n'), len(labels)
    if len(lines) > count and any(labels) and all(map(str.startswith, lines, labels)):
        return Example('\n'.join(lines[:count]), '\n'.join(lines[count:]))
    return None


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
    with raising(TemplateError, 'prompt: ', TemplateError):
        text = read_text(path, TemplateError, limit=MAX_TEMPLATE_BYTES)
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


def ask_for_json(messages: tuple[Message, ...], *, thinks: bool) -> tuple[Message, ...]:
    """Return the messages; the last one now says which JSON is expected."""
    *before, last = messages
    request = _JSON_REQUEST.format(thought='{"thought": "...", ' if thinks else '{')
    return (*before, Message(last.role, f'{last.content}\n\n{request}'))
