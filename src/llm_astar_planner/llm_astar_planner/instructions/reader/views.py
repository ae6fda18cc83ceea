# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A sentence in several wordings that mean the same, and what the networks say of them."""

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from llm_astar_planner.instructions.reader import network
from llm_astar_planner.instructions.reader.lifting import SIGN, SLOTS, Lifted, slot_name
from llm_astar_planner.instructions.reader.meaning import Parts, flat, ordered, told_in_turn

# Wordings of one sentence with its slots numbered anew.
RENUMBERED = 4
Names = Mapping[str, str]
Clauses = tuple[Parts, ...]


@dataclass(frozen=True)
class Weight:
    """What the networks say of a meaning, on average over the wordings.

    `likely`: the log probability that the reader gives it; `agreed`: the checker's log odds.
    """

    likely: float
    agreed: float


class Views:
    """The wordings of one sentence, those of one length together, as the reader has read them."""

    def __init__(self, one: Lifted) -> None:
        """Read the wordings."""
        variants = sorted(variants_of(one), key=lambda pair: len(pair[0]))
        self.groups = [
            tuple(zip(*group)) for _, group in groupby(variants, key=lambda pair: len(pair[0]))
        ]
        self.count = len(variants)
        self.read = [network.reading(sentences) for sentences, _ in self.groups]

    def readings(self) -> list[Clauses]:
        """Return what the reader reads in each wording; () where that is nothing."""
        return [
            ordered(renamed(tokens, {shown: name for name, shown in names.items()}))
            for read, (_, some) in zip(self.read, self.groups)
            for names, (tokens, _) in zip(some, read.written(some))
        ]

    def weigh(self, clauses: Clauses) -> Weight:
        """Return what the networks say of a meaning."""
        likely = agreed = 0.0
        tokens = list(flat(clauses))
        for read, (sentences, some) in zip(self.read, self.groups):
            said = [told_in_turn(s, renamed(tokens, names)) for s, names in zip(sentences, some)]
            likely += float(read.log_probabilities(said).sum())
            agreed += float(network.agreement(sentences, said).sum())
        return Weight(likely / self.count, agreed / self.count)


def renamed(tokens: Sequence[str], names: Names) -> list[str]:
    """Return the tokens of a meaning with slots by other names."""
    return [names.get(token, token) for token in tokens]


def variants_of(one: Lifted) -> Iterator[tuple[Sequence[str], Names]]:
    """Yield the tokens of a sentence in several ways, each with the names of its slots."""
    tokens, same = one.tokens, {name: name for name in one.slots}
    yield tokens, same
    yield ('please', ',', *tokens), same
    yield tuple(word for word in tokens if word != ',') or tokens, same
    yield tokens[:-1] if tokens[-1] in '.!' and tokens[1:] else (*tokens, '.'), same
    draw = random.Random(0)  # noqa: S311 - no secret
    for _ in range(RENUMBERED if one.slots else 0):
        names: dict[str, str] = {}
        for kind, most in SLOTS.items():
            mine = [name for name in one.slots if name[0] == kind]
            numbers = draw.sample(range(1, most + 1), len(mine))
            names |= {name: f'{kind}{n}' for name, n in zip(mine, numbers)}
        yield tuple(shown(token, names) for token in tokens), names


def shown(token: str, names: Names) -> str:
    """Return a token with the number of its slot by other names."""
    return token if token[0] != SIGN else token[:2] + names[slot_name(token)][1:]
