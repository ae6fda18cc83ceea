# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""then: who enters one region visits another one later."""

from dataclasses import dataclass
from typing import ClassVar

from llm_astar_planner.instructions.clauses.before import OfTwo
from llm_astar_planner.instructions.clauses.clause import Constraints, RegionFinder, Rule
from llm_astar_planner.search import automata


@dataclass(frozen=True)
class Then(OfTwo):
    """Whenever the path has entered `first` it visits `second` afterwards: G(first -> F second).

    A path that does not enter `first` owes nothing.
    """

    kind: ClassVar[str] = 'then'

    def phrase(self) -> str:
        """Return 'after every entry of the lab visit the dock'."""
        first, second = (region.phrase(any_one=True) for region in self.regions)
        return f'after every entry of {first} visit {second}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Owe a visit of the second region from each entry of the first one on."""
        zones = finder.entered(self.first), finder.visited(self.second)
        return Constraints(rules=(Rule(zones, lambda _: automata.then(0, 1)),))
