# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""unknown: words that were not understood."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, RegionFinder
from llm_astar_planner.instructions.fields import Fields, as_text


@dataclass(frozen=True)
class Unknown(Clause):
    """Words that were not understood; nothing is enforced and nothing is claimed of them."""

    kind: ClassVar[str] = 'unknown'
    text: str = ''

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        return {'text': as_text(values.get('text'), f'{where}: text')}

    def phrase(self) -> str:
        """Return 'not understood: "hm"'."""
        return f'not understood: "{self.text}"'

    def ask(self, finder: RegionFinder) -> None:
        """Ask for nothing."""
