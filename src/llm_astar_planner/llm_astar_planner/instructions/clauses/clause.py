# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What all clauses have, and what they ask of the search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from llm_astar_planner.instructions.fields import Fields
from llm_astar_planner.instructions.regions import Region, region_from_json

if TYPE_CHECKING:  # clauses are read where no search is
    from llm_astar_planner.costmap.raster import Cover
    from llm_astar_planner.instructions import region_finder
    from llm_astar_planner.instructions.region_finder import Mask, RegionCells
    from llm_astar_planner.search.automata import Automaton

    RegionFinder = region_finder.RegionFinder
else:
    RegionFinder = object

MUST, SHOULD = 'must', 'should'
STRENGTHS = (MUST, SHOULD)
COMMON = ('strength', 'unsure')


class Rule(NamedTuple):
    """An automaton over zones, made for the price per cell of what it forbids; inf forbids it."""

    zones: tuple[RegionCells, ...]
    automaton: Callable[[float], Automaton]


@dataclass(frozen=True, eq=False)
class Constraints:
    """What one clause asks of the cells of a path.

    - `forbidden`: cells that no move may begin or end in; None for none.
    - `visits`: regions to visit, after those of the clauses before, in any order.
    - `rules`: automata.
    - `goals`: cells to end in, bool [height, width].
    - `ends_within`: metres around start and goal in which nothing is forbidden to a path that
      begins or ends in what is; 0: it is nowhere forbidden to that.
    """

    forbidden: Cover | None = None
    visits: tuple[RegionCells, ...] = ()
    rules: tuple[Rule, ...] = ()
    goals: Mask | None = None
    ends_within: float = 0.0


@dataclass(frozen=True)
class Clause:
    """One thing that is asked of the path.

    `strength` is `must` or `should` ("if possible"). `unsure` is a question for the person: the
    clause was read, but not for certain, and is never reported as kept. '' if it is sure.
    """

    kind: ClassVar[str] = ''
    # Whether the path is not to be in the regions; they are drawn hatched.
    is_closed: ClassVar[bool] = False
    # A field of metres of which the most that is possible is kept, where all of it is not.
    reducible: ClassVar[str] = ''
    strength: str = MUST
    unsure: str = ''

    def to_json(self) -> dict[str, Any]:
        """Return the fields of its own in JSON."""
        own = {name: value for name, value in vars(self).items() if name not in COMMON}
        return {name: in_json(value) for name, value in own.items()}

    @classmethod
    def read(cls, values: Fields, where: str) -> dict[str, Any]:
        """Read the fields of its own, here its regions; `where` names it in errors.

        Raises SpecificationError.
        """
        names = (field.name for field in fields(cls) if isinstance(field.default, Region))
        return {name: region_from_json(values.get(name), f'{where}: {name}') for name in names}

    def phrase(self) -> str:
        """Return what it asks for, without its strength."""
        raise NotImplementedError

    def sentence(self) -> str:
        """Return its canonical sentence, which the grammar reads as the same clause."""
        return f'{"if possible, " if self.strength == SHOULD else ""}{self.phrase()}'

    def ask(self, finder: RegionFinder) -> Constraints | None:
        """Return what it asks of the search, None if that is nothing. Raises NoRegionError."""
        raise NotImplementedError

    @property
    def regions(self) -> tuple[Region, ...]:
        """The regions it is about."""
        return tuple(value for value in vars(self).values() if isinstance(value, Region))


def in_json(value: Any) -> Any:  # noqa: ANN401 - JSON
    """Return the JSON form of what a field holds."""
    return value.to_json() if isinstance(value, Region) else value


Clauses = tuple[Clause, ...]
