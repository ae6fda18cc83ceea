"""A prompt as it is sent: a template in one of its forms, with its own or retrieved examples."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from llm_astar_planner.waypoints.prompts.examples import ExampleLibrary
from llm_astar_planner.waypoints.prompts.map_description import CHARS_PER_TOKEN, Description
from llm_astar_planner.waypoints.prompts.template import MESSAGE, Example, Template, prompt_name
from llm_astar_planner.waypoints.source import Message, WaypointQuery


@dataclass(frozen=True)
class Prompt:
    """How maps are put to a model; `form` is one of FORMS.

    With a `library`, the `retrieved` samples of it that are most similar to the query replace
    the template's own examples.
    """

    template: Template
    form: str = MESSAGE
    library: ExampleLibrary | None = None
    retrieved: int = 0

    @property
    def name(self) -> str:
        """The name in replies, rows and transcripts."""
        return prompt_name(self.template.name, self.form, self.retrieved)

    @property
    def digest(self) -> str:
        """The SHA-256 of the template's text."""
        return hashlib.sha256(self.template.text.encode()).hexdigest()

    def examples(
        self, query: WaypointQuery, description: Description, max_tokens: int
    ) -> tuple[Example, ...] | None:
        """Return the retrieved examples, the most similar last; None for the template's own.

        The least similar are left out where they and the description would take more than about
        `max_tokens` tokens.
        """
        if self.library is None:
            return None
        left = int(max_tokens * CHARS_PER_TOKEN) - sum(map(len, description.values().values()))
        found: list[Example] = []
        for solved in islice(self.library.nearest(query), self.retrieved):
            example = self.template.example(*solved)
            left -= sum(map(len, example))
            if left < 0:
                break
            found.append(example)
        return tuple(reversed(found))

    def messages(
        self, description: Description, examples: Sequence[Example] | None = None
    ) -> tuple[Message, ...]:
        """Return the messages that ask for a path; `examples` replace the template's own."""
        return self.template.render(description, self.form, examples)
