# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""keep_distance: the path keeps away from a region, or from all walls."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder
from llm_astar_planner.instructions.fields import MAX_METRES, Fields, SpecificationError, as_number
from llm_astar_planner.instructions.regions import WALLS, Region, metres, region_from_json


@dataclass(frozen=True)
class KeepDistance(Clause):
    """The path keeps at least `metres` from a region, or from all walls where it is None."""

    kind: ClassVar[str] = 'keep_distance'
    is_closed: ClassVar[bool] = True
    reducible: ClassVar[str] = 'metres'
    metres: float = 0.0
    region: Region | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the fields of its own in JSON."""
        other = WALLS if self.region is None else self.region.to_json()
        return {'from': other, 'metres': self.metres}

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        length = as_number(values.get('metres'), f'{where}: metres', 0.0, MAX_METRES)
        if length == 0.0:
            raise SpecificationError(f'{where}: metres: must be above 0')
        other = values.get('from')
        region = None if other == WALLS else region_from_json(other, f'{where}: from')
        return {'metres': length, 'region': region}

    def phrase(self) -> str:
        """Return 'keep 2 m away from the walls'."""
        other = 'the walls' if self.region is None else self.region.from_phrase()
        return f'keep {metres(self.metres)} away from {other}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Forbid what is too near to the walls or the region."""
        if self.region is None:
            return Constraints(finder.near_walls(self.metres), ends_within=self.metres)
        return Constraints(finder.avoided(self.region, self.metres), ends_within=self.metres)
