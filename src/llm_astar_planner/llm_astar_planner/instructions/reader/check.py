# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether a reading of a sentence may be claimed, whoever proposes it.

Networks that were trained apart have all to find it likely, in whatever order the slots of the
sentence are numbered, and rules that know nothing of them must find no doubt.
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.reader import claims, meaning, network
from llm_astar_planner.instructions.reader.lifting import SIGN, SLOTS, Lifted, lifted, slot_name
from llm_astar_planner.instructions.reader.translation import Translation

LONGEST = 64
# The least weight of a claim, set with locked sentences in sight, see docs/reader.md.
CERTAIN = 0.85
# The least weight of what the grammar may claim, set in the same way.
LIKELY = -4.0
# The least weight of what another reader proposes: it and the networks do not err alike.
PROPOSED = -1.5
# The log probability of a longer meaning is scaled as if it had so many tokens, since every token
# adds a little doubt.
USUAL_TOKENS = 4
# How often the slots of a sentence are numbered anew; what the checker counts beside the readers.
RENUMBERED, TRUST = 1, 0.2
Names = Mapping[str, str]
Clauses = tuple[meaning.Parts, ...]


class Views:
    """A sentence with its slots numbered in several ways, as the readers have read it."""

    def __init__(self, one: Lifted) -> None:
        """Read it."""
        self.sentences, self.names = zip(*numberings(one))
        self.read = [network.reading(name, self.sentences) for name in network.READERS]
        self._opinions: dict[Clauses, tuple[list[float], float]] = {}

    def readings(self) -> list[Clauses]:
        """Return what the readers read; () where that is nothing."""
        return [
            meaning.ordered(renamed(tokens, {shown: name for name, shown in names.items()}))
            for read in self.read
            for names, (tokens, _) in zip(self.names, read.written(self.names))
        ]

    def weight(self, clauses: Clauses) -> float:
        """Return one number by which meanings are compared: what doubts it most says."""
        likely, agreed = self.opinions(clauses)
        return min(likely) + TRUST * agreed

    def opinions(self, clauses: Clauses) -> tuple[list[float], float]:
        """Return the log probability that each reader gives a meaning, and the checker's log odds.

        Both on average over the numberings, the first scaled to USUAL_TOKENS; the networks are
        asked once about each meaning.
        """
        if clauses not in self._opinions:
            tokens = list(meaning.flat(clauses))
            said = [
                meaning.told_in_turn(sentence, renamed(tokens, names))
                for sentence, names in zip(self.sentences, self.names)
            ]
            share = min(1.0, USUAL_TOKENS / max(1, len(tokens)))
            likely = [float(read.log_probabilities(said).mean()) * share for read in self.read]
            agreed = float(network.agreement(self.read[0], said).mean())
            self._opinions[clauses] = likely, agreed
        return self._opinions[clauses]


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


def doubt_about(text: str, places: Places, clauses: Sequence[Mapping[str, Any]]) -> str:
    """Return why clauses in JSON may not be claimed of a clean text, '' where they may.

    They are what another reader takes it for, a language model or a person.
    """
    try:
        one, views = viewed(text, places)
        return doubt(one, meant(one, places, clauses), views, PROPOSED)
    except meaning.Unreadable as error:
        return str(error)


def is_likely(text: str, places: Places, clauses: Sequence[Mapping[str, Any]]) -> bool:
    """Whether any reader finds clauses in JSON likely of a clean text, or they cannot say."""
    try:
        one, views = viewed(text, places)
        likely, agreed = views.opinions(meant(one, places, clauses))
        return max(likely) + TRUST * agreed >= LIKELY
    except meaning.Unreadable:
        return True


def meant(one: Lifted, places: Places, clauses: Sequence[Mapping[str, Any]]) -> Clauses:
    """Return the meaning that clauses in JSON are of a sentence. Raises Unreadable."""
    return meaning.ordered(Translation(one.slots, places).meaning(clauses))


@lru_cache(maxsize=4)
def viewed(text: str, places: Places) -> tuple[Lifted, Views]:
    """Return a clean text with slots, and as the networks read it. Raises Unreadable."""
    one = lifted(text, places)
    if not 0 < len(one.tokens) <= LONGEST:
        raise meaning.Unreadable(f'more than {LONGEST} words')
    return one, Views(one)


def doubt(one: Lifted, clauses: Clauses, views: Views, least: float = CERTAIN) -> str:
    """Return why a meaning is not certain, '' where it is; `least` is the least weight of one."""
    is_certain = views.weight(clauses) >= least
    return claims.doubt(one, clauses) if is_certain else 'the networks do not agree on it'
