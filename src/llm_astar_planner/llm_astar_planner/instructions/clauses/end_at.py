# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""end_at: the path ends in a region."""

from dataclasses import dataclass
from typing import ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder
from llm_astar_planner.instructions.regions import NOWHERE, Region


@dataclass(frozen=True)
class EndAt(Clause):
    """The path ends in the region, at the cell that suits the other clauses best."""

    kind: ClassVar[str] = 'end_at'
    region: Region = NOWHERE

    def phrase(self) -> str:
        """Return 'end in the dock'."""
        return f'end in {self.region.phrase(any_one=True)}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """End in the region."""
        return Constraints(goals=finder.visited(self.region).cells)
