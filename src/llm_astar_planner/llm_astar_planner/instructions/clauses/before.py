# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""before: one region is entered only after another one was visited."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

from llm_astar_planner.instructions.asks import Ask, Rule
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.fields import Fields
from llm_astar_planner.instructions.regions import (
    NOWHERE,
    Region,
    refused_phrase,
    region_from_json,
)
from llm_astar_planner.search import automata

if TYPE_CHECKING:
    from llm_astar_planner.instructions.ground import Ground


@dataclass(frozen=True)
class OfTwo(Clause):
    """A clause about a `first` and a `second` region."""

    first: Region = NOWHERE
    second: Region = NOWHERE

    @property
    def regions(self) -> tuple[Region, ...]:
        """Both."""
        return self.first, self.second

    def to_json(self) -> dict[str, Any]:
        """Return the fields of its own in JSON."""
        return {'first': self.first.to_json(), 'second': self.second.to_json()}

    @classmethod
    def read(cls, fields: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        return {
            name: region_from_json(fields.get(name), f'{where}: {name}')
            for name in ('first', 'second')
        }


@dataclass(frozen=True)
class Before(OfTwo):
    """The path enters `second` only after it has visited `first`; it need not enter either."""

    kind: ClassVar[str] = 'before'

    def phrase(self) -> str:
        """Return 'do not enter the lab before the dock'."""
        first = self.first.phrase(any_one=True)
        return f'do not enter {refused_phrase(self.second)} before {first}'

    def ask(self, ground: Ground) -> Ask:
        """Forbid the second region until the first one was visited."""
        zones = ground.visited(self.first), ground.entered(self.second)
        return Ask(rules=(Rule(zones, partial(automata.before, 0, 1)),))
