# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""count: a region is entered at least or at most so many times."""

from dataclasses import dataclass
from typing import Any, ClassVar

from llm_astar_planner.instructions.clauses.clause import Clause, Constraints, RegionFinder, Rule
from llm_astar_planner.instructions.fields import Fields, SpecificationError, as_count
from llm_astar_planner.instructions.regions import NOWHERE, Region
from llm_astar_planner.search import automata

MAX_ENTRIES = 8
NUMERALS = {1: 'once', 2: 'twice'}


@dataclass(frozen=True)
class Count(Clause):
    """The path enters the region `at_least` and `at_most` so many times; None is no limit.

    It enters when it is as deep in it as a visit has to be, for the first time or after it was
    outside, by more than a cell and a half.
    """

    kind: ClassVar[str] = 'count'
    region: Region = NOWHERE
    at_least: int = 0
    at_most: int | None = None

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own."""
        most = values.get('at_most')
        most = None if most is None else as_count(most, f'{where}: at_most', MAX_ENTRIES)
        least = as_count(values.get('at_least', 0), f'{where}: at_least', MAX_ENTRIES)
        if most is not None and most < least:
            raise SpecificationError(f'{where}: at_most: {most} is below at_least')
        return {'at_least': least, 'at_most': most, **super().read(values, where)}

    def phrase(self) -> str:
        """Return 'enter the lab at most twice'."""
        limits = [('at least', self.at_least)] if self.at_least else []
        limits += [] if self.at_most is None else [('at most', self.at_most)]
        if self.at_least == self.at_most:
            limits = [('exactly', self.at_most)]
        if len(limits) == 1:
            word, times = limits[0]
            how_often = f'{word} {NUMERALS.get(times, f"{times} times")}'
        else:
            words = ' and '.join(f'{word} {times}' for word, times in limits)
            how_often = f'{words} times' if limits else 'as often as needed'
        return f'enter {self.region.phrase(any_one=True)} {how_often}'

    def ask(self, finder: RegionFinder) -> Constraints:
        """Count the entries: at least by the surest of them, at most by all that may be one."""
        rules = []
        if self.at_least:
            zones = finder.visited(self.region), finder.around(self.region)
            rules.append(Rule(zones, lambda _: automata.entries(0, 1, self.at_least)))
        if self.at_most is not None:
            zones = finder.touching(self.region), finder.entered(self.region)
            rules.append(Rule(zones, lambda _: automata.entries(0, 1, 0, self.at_most)))
        return Constraints(rules=tuple(rules))
