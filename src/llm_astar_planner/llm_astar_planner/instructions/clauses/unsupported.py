# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""unsupported: something that a path does not have, as a speed."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.fields import Fields, as_choice

ABOUT = ('speed', 'waiting', 'time', 'following', 'manner', 'action')


@dataclass(frozen=True)
class Unsupported(Unknown):
    """Words that were understood, about what no path can keep; the other clauses are not spoilt.

    `about` is one of ABOUT.
    """

    kind: ClassVar[str] = 'unsupported'
    about: str = 'manner'

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        about = as_choice(values.get('about'), f'{where}: about', ABOUT)
        return {**super().read(values, where), 'about': about}

    def phrase(self) -> str:
        """Return '"slowly" is about speed, which a path does not have'."""
        return f'"{self.text}" is about {self.about}, which a path does not have'
