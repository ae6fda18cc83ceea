# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""visit: the path enters regions, in any order; visits follow each other."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder
from llm_astar_planner.instructions.fields import Fields, as_list
from llm_astar_planner.instructions.regions import Region, bracketed, region_from_json


@dataclass(frozen=True)
class Visit(Clause):
    """The path enters each of the regions, in any order; visit clauses follow each other in order.

    "the dock, then the lab and the kitchen" is two clauses, the second one with two regions.
    """

    kind: ClassVar[str] = 'visit'
    regions: tuple[Region, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the fields of its own in JSON."""
        return {'regions': [region.to_json() for region in self.regions]}

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        regions = as_list(values.get('regions', [values.get('region')]), f'{where}: regions')
        return {'regions': tuple(region_from_json(item, f'{where}: regions') for item in regions)}

    def phrase(self) -> str:
        """Return 'visit the lab and the dock in any order'."""
        return f'visit {self.regions_phrase()}'

    def regions_phrase(self) -> str:
        """Return 'the lab and the dock in any order'."""
        if len(self.regions) == 1:
            return self.regions[0].phrase(any_one=True)
        *others, last = (bracketed(region, any_one=True) for region in self.regions)
        return f'{", ".join(others)} and {last} in any order'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Visit the regions."""
        return Constraints(visits=tuple(finder.visited(region) for region in self.regions))
