# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The language of meanings that the model writes, and the clauses that they stand for.

A meaning is a row of tokens, clauses in prefix form: `A R1` avoids the first region of the
sentence, `V R1 R2 ) V R3 )` visits two in any order and then a third, `W` makes a wish of what
follows. Slots are regions R, lengths L, sides S and counts K, numbered as in the sentence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from llm_astar_msgs_adapter.errors import LlmAstarError

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before, OfTwo
from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import OfOne, StayIn
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.unsupported import ABOUT, Unsupported
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.grammar.meaning import CLEAR
from llm_astar_planner.instructions.grammar.selection import DRAWN
from llm_astar_planner.instructions.reader.lifting import SLOTS, Slot
from llm_astar_planner.instructions.regions import (
    NEAR_WIDTH,
    Along,
    AnyOf,
    Between,
    End,
    Except,
    Half,
    NamedPlace,
    Region,
)

# Tokens with a fixed number of parts, and those that end with ')'.
ARITY = {
    'A': 1, 'B': 2, 'T': 2, 'N': 2, 'S': 1, 'P': 2, 'K': 2, 'E': 1, 'C': 2, 'CN': 2,
    'HF': 1, 'HO': 2, 'AL': 1, 'BW': 2, 'W': 1, 'EA': 1,
}  # fmt: skip
VARIADIC = ('V', 'OR', 'EX')
END, CLOSE, UNKNOWN = '<end>', ')', '?'
REGIONS = ('START', 'GOAL', 'WALLS', UNKNOWN)
# All tokens in the order of the network's outputs.
TOKENS = (
    END, CLOSE, *ARITY, *VARIADIC, *REGIONS, 'D', *(f'U_{about}' for about in ABOUT),
    *(f'{kind}{number}' for kind, most in SLOTS.items() for number in range(1, most + 1)),
)  # fmt: skip


class Unreadable(LlmAstarError):  # noqa: N818 (no error of the program: the meaning is none)
    """A meaning that makes no clauses, or that names what the sentence has not."""


@dataclass
class Meaning:
    """Makes clauses of the tokens of a meaning, with the slots of its sentence.

    `used` are the slots that it names; `about` the words for what a path does not have.
    """

    tokens: Sequence[str]
    slots: Mapping[str, Slot]
    about: Mapping[str, str]
    at: int = 0
    used: set[str] = field(default_factory=set)

    def clauses(self) -> tuple[Clause, ...]:
        """Return the clauses. Raises Unreadable."""
        found: list[Clause] = []
        while self.at < len(self.tokens):
            is_wish = self.tokens[self.at] == 'W'
            self.at += is_wish
            clauses = self.clause(self.next())
            found += [replace(one, strength=SHOULD) if is_wish else one for one in clauses]
        return tuple(found)

    def next(self) -> str:
        """Return the next token. Raises Unreadable where there is none."""
        if self.at >= len(self.tokens):
            raise Unreadable('it ends too soon')
        self.at += 1
        return self.tokens[self.at - 1]

    def clause(self, kind: str) -> list[Clause]:
        """Return the clauses of one kind. Raises Unreadable."""
        if kind.startswith('U_'):
            about = kind[2:]
            return [Unsupported(text=self.about.get(about, self.about['']), about=about)]
        if kind == 'V':
            regions = [one for part in self.until_close(True) for one in part]
            return [Visit(regions=tuple(regions))]
        if kind == 'E' and self.tokens[self.at : self.at + 1] == ['START']:
            self.at += 1
            return [EndAt(region=End('start'))]
        if kind not in CLAUSES:
            raise Unreadable(f'{kind} is no clause')
        if kind == 'K' and self.tokens[self.at : self.at + 1] == ['WALLS']:
            self.at += 1
            return [KeepDistance(metres=self.metres())]
        region = self.region()
        if kind == 'A':
            return [Avoid(region=region)]
        if kind in TWO:
            return [TWO[kind](first=region, second=self.region())]
        if kind in ONE:
            return [ONE[kind](region=region)]
        if kind == 'P':
            return [Pass(region=region, side=str(self.slot('S').value))]
        if kind == 'K':
            return [KeepDistance(metres=self.metres(), region=region)]
        return [self.count(region, kind == 'CN')]

    def count(self, region: Region, is_refused: bool) -> Count:
        """Return how often a region is entered. Raises Unreadable."""
        least, most, turns = self.slot('K').value
        if is_refused != bool(turns):
            raise Unreadable('not so often, or how often')
        if is_refused:
            least, most = (0, least - 1) if least else (int(most) + 1, None)
        return Count(region=region, at_least=int(least), at_most=None if most is None else int(most))

    def metres(self) -> float:
        """Return a length; the usual one where the sentence has no number."""
        if self.tokens[self.at : self.at + 1] == ['D']:
            self.at += 1
            return CLEAR
        length = float(self.slot('L').value)
        if length <= 0.0:
            raise Unreadable('no distance')
        return length

    def slot(self, kind: str) -> Slot:
        """Return the next slot, which is of a kind. Raises Unreadable."""
        name = self.next()
        if name not in self.slots or name[0] != kind:
            raise Unreadable(f'{name} is no {kind}')
        self.used.add(name)
        return self.slots[name]

    def until_close(self, each: bool = False) -> list[tuple[Region, ...]]:
        """Return regions up to the closing sign; of a group with EA `each` of them."""
        found: list[tuple[Region, ...]] = []
        while (token := self.tokens[self.at : self.at + 1]) != [CLOSE]:
            if each and token == ['EA']:
                self.at += 1
                slot = self.slot('R')
                found.append(slot.members or (slot.value,))
            else:
                found.append((self.region(),))
        self.at += 1
        if not found:
            raise Unreadable('nothing to visit')
        return found

    def region(self) -> Region:
        """Return the next region. Raises Unreadable."""
        kind = self.next()
        if kind in ('START', 'GOAL'):
            return End(kind.lower())
        if kind in ('OR', 'EX'):
            first, *others = [one for part in self.until_close() for one in part]
            if not others:
                raise Unreadable('one of one')
            return AnyOf((first, *others)) if kind == 'OR' else Except(first, tuple(others))
        if kind == 'HF':
            return Half(str(self.slot('S').value))
        if kind == 'HO':
            side = DRAWN.get(side := str(self.slot('S').value), side)
            return Half(side, self.name())
        if kind == 'AL':
            return Along(self.name(), NEAR_WIDTH)
        if kind == 'BW':
            return Between(self.name(), self.name())
        self.at -= 1
        return self.slot('R').value  # type: ignore[no-any-return]

    def name(self) -> str:
        """Return the name of the next region, which is one place. Raises Unreadable."""
        region = self.region()
        if not isinstance(region, NamedPlace):
            raise Unreadable('no single place')
        return region.place


TWO: dict[str, type[OfTwo]] = {'B': Before, 'T': Then, 'N': NeverAfter}
ONE: dict[str, type[OfOne]] = {'S': StayIn, 'E': EndAt}
CLAUSES = frozenset({'A', 'P', 'K', 'C', 'CN', *TWO, *ONE})
