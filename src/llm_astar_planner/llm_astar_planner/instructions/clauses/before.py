# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""before: one region is entered only after another one was visited."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder, Rule
from llm_astar_planner.instructions.regions import NOWHERE, Region, refused_phrase
from llm_astar_planner.search import automata


@dataclass(frozen=True)
class OfTwo(Clause):
    """A clause about a `first` and a `second` region."""

    first: Region = NOWHERE
    second: Region = NOWHERE


@dataclass(frozen=True)
class Before(OfTwo):
    """The path enters `second` only after it has visited `first`; it need not enter either."""

    kind: ClassVar[str] = 'before'

    def phrase(self) -> str:
        """Return 'do not enter the lab before the dock'."""
        first = self.first.phrase(any_one=True)
        return f'do not enter {refused_phrase(self.second)} before {first}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Forbid the second region until the first one was visited."""
        zones = finder.visited(self.first), finder.entered(self.second)
        return Constraints(rules=(Rule(zones, partial(automata.before, 0, 1)),))
