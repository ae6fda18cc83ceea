# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""avoid: no part of the path lies in a region."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder
from llm_astar_planner.instructions.fields import MAX_METRES, Fields, as_number
from llm_astar_planner.instructions.regions import NOWHERE, Region, metres


@dataclass(frozen=True)
class Avoid(Clause):
    """No part of the path lies in the region or within `margin` metres of it."""

    kind: ClassVar[str] = 'avoid'
    is_closed: ClassVar[bool] = True
    region: Region = NOWHERE
    margin: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the fields of its own in JSON."""
        margin = {'margin': self.margin} if self.margin else {}
        return {'region': self.region.to_json(), **margin}

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        margin = as_number(values.get('margin', 0.0), f'{where}: margin', 0.0, MAX_METRES)
        return {'margin': margin, **super().read(values, where)}

    def phrase(self) -> str:
        """Return 'avoid the lab by 2 m'."""
        if self.margin:
            return f'avoid {self.region.from_phrase()} by {metres(self.margin)}'
        return f'avoid {self.region.phrase()}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Forbid the region and its margin."""
        return Constraints(forbidden=finder.avoided(self.region, self.margin))
