# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""never_after: who has entered one region never enters another one again."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from llm_astar_planner.instructions.clauses.before import OfTwo
from llm_astar_planner.instructions.clauses.clause import Constraints, RegionFinder, Rule
from llm_astar_planner.instructions.regions import refused_phrase
from llm_astar_planner.search import automata


@dataclass(frozen=True)
class NeverAfter(OfTwo):
    """Once the path has entered `first` it is never in `second`: G(first -> G !second)."""

    kind: ClassVar[str] = 'never_after'

    def phrase(self) -> str:
        """Return 'do not enter the dock after the lab'."""
        first = self.first.phrase(any_one=True)
        return f'do not enter {refused_phrase(self.second)} after {first}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Forbid the second region from the first entry of the first one on."""
        zones = finder.entered(self.first), finder.entered(self.second)
        return Constraints(rules=(Rule(zones, partial(automata.never_after, 0, 1)),))
