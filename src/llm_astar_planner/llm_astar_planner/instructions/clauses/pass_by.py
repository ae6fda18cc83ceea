# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""pass: an object is passed on a side."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder, Rule
from llm_astar_planner.instructions.fields import Fields, as_choice
from llm_astar_planner.search import automata


@dataclass(frozen=True)
class Pass(Clause):
    """The path passes the object on a side: it crosses the ray from it to that side of the map.

    It crosses neither the object nor the ray to the opposite side.
    """

    kind: ClassVar[str] = 'pass'
    region: regions.Region = regions.NOWHERE
    side: str = 'north'

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        side = as_choice(values.get('side'), f'{where}: side', regions.SIDES)
        region = values.get('region', values.get('object'))
        return {'side': side, **super().read({'region': region}, where)}

    def phrase(self) -> str:
        """Return 'pass the rack on the north side'."""
        of_way = self.side in regions.ROUTE_SIDES
        where = f'{self.side} of the direct way' if of_way else f'{self.side} side'
        # 'all blue places on the north side' would be those that lie there, walls likewise.
        how = 'by' if isinstance(self.region, (regions.Tagged, regions.Along)) else 'on'
        return f'pass {regions.bracketed(self.region)} {how} the {where}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Forbid the object and the ray to the wrong side; cross the ray to the right side."""
        forbidden, crossing = finder.sides(self.region, self.side)
        return Constraints(
            forbidden, rules=(Rule((crossing,), lambda _: automata.visits(((0,),))),)
        )
