# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""stay_in: the path lies in a region."""

from dataclasses import dataclass
from typing import ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder
from llm_astar_planner.instructions.regions import NOWHERE, Region


@dataclass(frozen=True)
class StayIn(Clause):
    """The path lies in the region, as much of it as is possible."""

    kind: ClassVar[str] = 'stay_in'
    region: Region = NOWHERE

    def phrase(self) -> str:
        """Return 'stay in the hall'."""
        return f'stay in {self.region.phrase()}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Forbid what lies outside of the region."""
        return Constraints(forbidden=finder.outside(self.region))
