# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What speaks against a reading: rules over the words, which know nothing of the networks.

Each rule was kept because it stopped wrong readings and hardly any right ones; the others, such as
that each negation has its clause, refused more right readings than wrong ones.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from zlib import crc32

from llm_astar_planner.instructions.grammar.vocabulary import nouns
from llm_astar_planner.instructions.grammar.words import comparable
from llm_astar_planner.instructions.reader import network
from llm_astar_planner.instructions.reader.lifting import SIGN, Lifted
from llm_astar_planner.instructions.reader.meaning import TOKENS, UNKNOWN, Parts, flat

# The tokens that say a refusal.
REFUSING = ('A', 'N', 'B', 'K', 'S', 'CN', 'CL', 'EX')
# Words that may name a place the map does not have; each is tried as one.
MOST_STRANGE = 8
Counts = Counter[str]


def doubt(one: Lifted, clauses: Sequence[Parts]) -> str:
    """Return why the clauses of a meaning are not certain, '' where they are."""
    tokens = list(flat(clauses))
    if UNKNOWN in tokens:
        return 'a place that the map does not have'
    doubts = [said for name in one.slots if name in tokens for said in one.slots[name].doubts]
    if doubts:
        return f'"{doubts[0]}" is doubtful'
    kinds, heads = Counter(lexeme.kind for lexeme in one.lexemes), Counter(tokens)
    found = (rule(kinds, heads) for rule in RULES)
    return leftover(one) or next(filter(None, found), '') or unnamed(one)


def leftover(one: Lifted) -> str:
    """Return a word outside of slots that has digits in it, '' for none."""
    language = set(one.tokens)
    found = (word.said or word.text for word in one.words if re.search(r'\d', word.text))
    return next((f'"{said}" is left' for said in found if comparable(said) in language), '')


def unnamed(one: Lifted) -> str:
    """Return a word that would be read as a place if the map had it, '' for none."""
    found = strange(one)
    new = f'R{sum(name[0] == "R" for name in one.slots) + 1}'
    if new not in TOKENS or len(found) > MOST_STRANGE:
        return 'too many words that nobody knows'
    probes = [(*one.tokens[:at], f'{SIGN}{new}', *one.tokens[at + 1 :]) for at in found]
    names = {name: name for name in (*one.slots, new)}
    read_as = network.reading('reader', probes).written([names] * len(probes)) if probes else []
    named = (one.tokens[at] for at, (tokens, _) in zip(found, read_as) if new in tokens)
    return next((f'"{word}" is not on the map' for word in named), '')


def strange(one: Lifted) -> list[int]:
    """Return which tokens could name a place that is not on the map, or that nobody knows."""
    called, known = nouns().everywhere.words, network.known_words()
    return [
        at
        for at, token in enumerate(one.tokens)
        if token.isalpha() and (token in called or crc32(token.encode()) not in known)
    ]


def some(counts: Counts, names: Collection[str]) -> int:
    """Return how many there are of some."""
    return sum(counts[name] for name in names)


RULES: tuple[Callable[[Counts, Counts], str], ...] = ()
