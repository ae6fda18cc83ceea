# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A sentence with its slots numbered in several ways, and what the networks say of it."""

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from llm_astar_planner.instructions.reader import network
from llm_astar_planner.instructions.reader.lifting import SIGN, SLOTS, Lifted, slot_name
from llm_astar_planner.instructions.reader.meaning import Parts, flat, ordered, told_in_turn

# How often the slots of a sentence are numbered anew; what the checker counts beside the readers.
RENUMBERED, TRUST = 1, 0.15
Names = Mapping[str, str]
Clauses = tuple[Parts, ...]


@dataclass(frozen=True)
class Weight:
    """What the networks say of a meaning, on average over the numberings.

    `likely`: the least log probability that a reader gives it; `agreed`: the checker's log odds.
    """

    likely: float
    agreed: float

    @property
    def all(self) -> float:
        """One number by which meanings are compared."""
        return self.likely + TRUST * self.agreed


class Views:
    """A sentence with its slots numbered in several ways, as the readers have read it."""

    def __init__(self, one: Lifted) -> None:
        """Read it."""
        self.sentences, self.names = zip(*numberings(one))
        self.read = [network.reading(name, self.sentences) for name in network.READERS]
        self._weighed: dict[Clauses, Weight] = {}

    def readings(self) -> list[Clauses]:
        """Return what the readers read; () where that is nothing."""
        return [
            ordered(renamed(tokens, {shown: name for name, shown in names.items()}))
            for read in self.read
            for names, (tokens, _) in zip(self.names, read.written(self.names))
        ]

    def weigh(self, clauses: Clauses) -> Weight:
        """Return what the networks say of a meaning, each asked once."""
        if clauses not in self._weighed:
            self._weighed[clauses] = self.weight(clauses)
        return self._weighed[clauses]

    def weight(self, clauses: Clauses) -> Weight:
        """Ask the networks of a meaning."""
        tokens = list(flat(clauses))
        said = [
            told_in_turn(sentence, renamed(tokens, names))
            for sentence, names in zip(self.sentences, self.names)
        ]
        likely = min(float(read.log_probabilities(said).mean()) for read in self.read)
        return Weight(likely, float(network.agreement(self.sentences, said).mean()))


def renamed(tokens: Sequence[str], names: Names) -> list[str]:
    """Return the tokens of a meaning with slots by other names."""
    return [names.get(token, token) for token in tokens]


def numberings(one: Lifted) -> Iterator[tuple[Sequence[str], Names]]:
    """Yield the tokens of a sentence with its slots numbered in ways, and their names in each."""
    yield one.tokens, {name: name for name in one.slots}
    draw = random.Random(0)  # noqa: S311 - no secret
    for _ in range(RENUMBERED if one.slots else 0):
        names: dict[str, str] = {}
        for kind, most in SLOTS.items():
            mine = [name for name in one.slots if name[0] == kind]
            numbers = draw.sample(range(1, most + 1), len(mine))
            names |= {name: f'{kind}{n}' for name, n in zip(mine, numbers)}
        yield tuple(shown(token, names) for token in one.tokens), names


def shown(token: str, names: Names) -> str:
    """Return a token with the number of its slot by other names."""
    return token if token[0] != SIGN else token[:2] + names[slot_name(token)][1:]
