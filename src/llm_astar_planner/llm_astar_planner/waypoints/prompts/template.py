"""Prompt templates: text files with a few names in braces, shipped ones or the user's own."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from llm_astar_planner.waypoints.prompts.map_description import Description
from llm_astar_planner.waypoints.prompts.message import Message

TEMPLATES = ('few_shot', 'cot', 'repe')
NEEDED = ('start', 'goal', 'horizontal_barriers', 'vertical_barriers')
NAMES = (*NEEDED, 'x_min', 'x_max', 'y_min', 'y_max')
MAX_TEMPLATE_CHARS = 65536
_PLACEHOLDER = re.compile(r'\{(' + '|'.join(NAMES) + r')\}')


class TemplateError(ValueError):
    """A prompt template that cannot be used; the message names it and what is wrong."""


@dataclass(frozen=True)
class Template:
    """The text of a prompt with the names of NAMES in braces; other braces stay as they are."""

    name: str
    text: str

    @property
    def digest(self) -> str:
        """Twelve hex digits that name the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    @property
    def thinks(self) -> bool:
        """Whether the template asks for thoughts before the path."""
        return 'thought' in self.text.lower()

    def render(self, description: Description, addition: str = '') -> tuple[Message, ...]:
        """Return the messages that ask about a described map, with an addition put after it."""
        values = description.values()
        text = _PLACEHOLDER.sub(lambda match: values[match.group(1)], self.text).strip()
        return (Message('user', f'{text}\n\n{addition}' if addition else text),)


def template_path(name: str) -> Path:
    """Return the file of a shipped template, for users to copy. Raises TemplateError."""
    if name not in TEMPLATES:
        raise TemplateError(f'prompt: {name!r} is none of {", ".join(TEMPLATES)}')
    return Path(__file__).with_name(f'{name}.txt')


def load_template(prompt: str) -> Template:
    """Load a shipped template by name or a user's by its path; the file's stem is its name.

    Raises TemplateError where there is none, or where it leaves a needed name out.
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
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise TemplateError(f'prompt: {path}: {error}') from None
    if len(text) > MAX_TEMPLATE_CHARS:
        raise TemplateError(f'prompt: {path}: longer than {MAX_TEMPLATE_CHARS} characters')
    missing = [name for name in NEEDED if '{' + name + '}' not in text]
    if missing:
        names = ', '.join('{' + name + '}' for name in missing)
        raise TemplateError(f'prompt: {path}: does not use {names}')
    return Template(path.stem, text)
