# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What speaks against a reading: rules over the words, which know nothing of the networks.

Each was kept because on locked sentences it refused more of the wrong readings than of the right
ones; rules for negations, conditions, wishes, ends and unknown words were not.
"""

import re
from collections import Counter
from collections.abc import Collection, Sequence
from zlib import crc32

from llm_astar_planner.instructions.grammar.vocabulary import KINDS, nouns, vocabulary
from llm_astar_planner.instructions.grammar.words import comparable
from llm_astar_planner.instructions.reader.lifting import Lifted, is_letter
from llm_astar_planner.instructions.reader.meaning import UNKNOWN, Parts, flat
from llm_astar_planner.instructions.reader.network import known_words

# What slots of regions begin with, and tokens that say an order by themselves.
REGIONS = ('@R', '@O', '@G', '@Y')
ORDERED = 'BTNE'
Counts = Counter[str]


def doubt(one: Lifted, clauses: Sequence[Parts]) -> str:
    """Return why the clauses of a meaning are not certain, '' where they are."""
    tokens = list(flat(clauses))
    if UNKNOWN in tokens:
        return 'a place that the map does not have'
    doubts = [said for name in one.slots if name in tokens for said in one.slots[name].doubts]
    if doubts:
        return f'"{doubts[0]}" is doubtful'
    left = [name for name in one.slots if name not in tokens and name[0] != 'R']
    if left:
        return f'{left[0]} is left'
    kinds = Counter(lexeme.kind for lexeme in one.lexemes)
    return leftover(one) or orders(kinds, Counter(tokens)) or unnamed(one)


def leftover(one: Lifted) -> str:
    """Return a word outside of slots that has digits in it, '' for none."""
    language = set(one.tokens)
    found = (word.said or word.text for word in one.words if re.search(r'\d', word.text))
    return next((f'"{said}" is left' for said in found if comparable(said) in language), '')


def unnamed(one: Lifted) -> str:
    """Return a word that may be a name, or a part of one, that the map does not have; '' for none.

    That is one beside a place that is no word of instructions, 'the old kitchen', 'kitchen door',
    and an unknown word or a noun after an article: 'the ballroom'.
    """
    words, called = vocabulary(one.language), nouns().everywhere
    articles = words.articles | words.any_articles
    around = ('', *one.tokens, '')
    for before, token, after in zip(around, one.tokens, around[2:]):
        meant = words.phrases.exactly([token]) if token.isalpha() else []
        is_known = token in articles or any(one[0][0] != 'REMARK' for one in meant)
        is_noun = token in called.words
        is_new = is_noun or crc32(token.encode()) not in known_words()
        is_name = (after[:2] in REGIONS and (is_noun or not is_known)) or (
            before[:2] in REGIONS and (is_noun or (is_new and not meant))
        )
        is_name |= bool(called.exactly([token])) or (before in articles and is_new and not meant)
        if token.isalpha() and (is_name or (before[:2] in REGIONS and is_letter(token))):
            return f'"{token}" may be a name'
    return ''


def some(counts: Counts, names: Collection[str]) -> int:
    """Return how many there are of some."""
    return sum(counts[name] for name in names)


def orders(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with the order: where there is one, a word says so."""
    is_told = some(kinds, KINDS.ordering)
    is_way = kinds['THROUGH'] and some(kinds, ('TO', 'INTO', 'VISIT'))
    if heads['V'] > 1 and not (is_told or is_way):
        return 'no word says the order'
    if is_told and heads['V'] < 2 and not some(heads, ORDERED):
        return 'an order that is not read'
    return 'in any order' if kinds['ANYORDER'] and heads['V'] > 1 else ''
