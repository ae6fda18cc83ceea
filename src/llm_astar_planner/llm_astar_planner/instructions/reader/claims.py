# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether a reading is certain: rules over the words, which know nothing of the network.

The grammar's vocabulary says which words refuse, order, limit and wish; what a reading says has
to agree with them, every slot has to be in it, and no word may be left that could name a place.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from zlib import crc32

from llm_astar_planner.instructions.grammar.vocabulary import KINDS, nouns
from llm_astar_planner.instructions.grammar.words import comparable
from llm_astar_planner.instructions.reader.lifting import Lifted
from llm_astar_planner.instructions.reader.meaning import Parts
from llm_astar_planner.instructions.reader.network import known_words
from llm_astar_planner.instructions.regions import ROUTE_SIDES

# The tokens that say a refusal, those that say an order, and those that say a condition.
REFUSING, ORDERED, LIMITED = ('A', 'N', 'B', 'K', 'S', 'CN', 'EX'), 'BTNE', 'BTN'
Counts = Counter[str]


def doubt(one: Lifted, clauses: Sequence[Parts], used: Collection[str]) -> str:
    """Return why the clauses of a meaning are not certain, '' where they are."""
    kinds = Counter(lexeme.kind for lexeme in one.lexemes)
    heads = Counter(re.findall(r"'([^']+)'", str(clauses)))
    reasons = (slots(one, used), leftover(one), *(rule(kinds, heads) for rule in RULES))
    return next(filter(None, reasons), '')


def slots(one: Lifted, used: Collection[str]) -> str:
    """Return a slot that the meaning does not name, or one that is doubtful."""
    left = [name for name in one.slots if name not in used]
    doubts = [said for name in used for said in one.slots[name].doubts]
    if left or doubts:
        return f'{left[0]} is left' if left else f'"{doubts[0]}" is doubtful'
    # 'on your left': that of the robot or of the thing, which nobody can tell by the words.
    sides = {one.slots[name].value for name in used if name[0] == 'S'}
    return 'left and right of what' if sides & set(ROUTE_SIDES) else ''


def strange(one: Lifted) -> list[int]:
    """Return which tokens could name a place that is not on the map, or that nobody knows."""
    called, known = nouns().everywhere.words, known_words()
    return [
        at
        for at, token in enumerate(one.tokens)
        if token.isalpha() and (token in called or crc32(token.encode()) not in known)
    ]


def leftover(one: Lifted) -> str:
    """Return a word outside of slots that was misspelt, or that is a number."""
    language = set(one.tokens)
    for word in one.words:
        said = word.said or word.text
        is_number = not word.is_letters and word.text[-1].isdigit()
        if comparable(said) in language and (is_number or word.is_corrected):
            return f'"{said}" is left'
    return ''


def some(counts: Counts, names: Collection[str]) -> int:
    """Return how many there are of some."""
    return sum(counts[name] for name in names)


def refusals(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with what is refused: each word that refuses has its clause."""
    said, meant = some(kinds, KINDS.refusals), some(heads, REFUSING)
    if some(kinds, KINDS.unclear):
        return 'words that may turn the meaning round'
    if (kinds['NEG'] and some(kinds, KINDS.turning)) or kinds['NEG'] > meant:
        return 'a negation too many'
    if some(heads, ('A', 'N', 'CN')) and not said:
        return 'nothing refuses'
    return 'refused, but not read so' if said and not meant else ''


def orders(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with the order: where there is one, a word says so."""
    is_told = some(kinds, KINDS.ordering)
    is_way = kinds['THROUGH'] and some(kinds, ('TO', 'INTO', 'VISIT'))
    if heads['V'] > 1 and not (is_told or is_way):
        return 'no word says the order'
    if is_told and heads['V'] < 2 and not some(heads, ORDERED):
        return 'an order that is not read'
    return 'in any order' if kinds['ANYORDER'] and heads['V'] > 1 else ''


def limits(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with conditions, which are no commands."""
    is_limited, is_read = some(kinds, KINDS.conditions), some(heads, LIMITED)
    if is_limited and not is_read:
        return 'a condition that is not read'
    if is_read and not (is_limited or some(kinds, ('BEFORE', 'AFTER', 'FIRST'))):
        return 'no condition'
    if kinds['ONLY'] and not some(heads, 'BSC'):
        return 'only what'
    return 'or what' if kinds['OR'] and not (heads['OR'] or heads['A'] > 1) else ''


def numbers(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with how often: a word that limits it has its clause."""
    is_told, is_read = some(kinds, KINDS.counting), some(heads, ('C', 'CN', 'K'))
    return 'a number that is not read' if is_told and not is_read else ''


def wishes(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with wishes: a word says each."""
    return '' if bool(kinds['SHOULD']) == bool(heads['W']) else 'a wish or a demand'


def ends(kinds: Counts, heads: Counts) -> str:
    """Return what is wrong with the end of the way."""
    is_told = bool(some(kinds, ('END', 'COMEBACK')))
    return '' if is_told == bool(heads['E']) and not kinds['STOP'] else 'the end, or a visit'


RULES: tuple[Callable[[Counts, Counts], str], ...] = (
    refusals, orders, limits, numbers, wishes, ends,
)  # fmt: skip
