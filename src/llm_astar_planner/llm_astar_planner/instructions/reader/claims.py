# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What speaks against a reading: rules over the words, which know nothing of the networks.

Each was kept because on locked sentences it refused more of the wrong readings than of the right
ones, `twisted` because sentences of `test/language/mutations.py` were claimed falsely without it.
Rules for conditions on places, wishes, ends and unknown words were not kept.
"""

import re
from collections.abc import Collection, Sequence
from zlib import crc32

from llm_astar_planner.instructions.grammar.selection import OPPOSITE, WALL
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, SAID, nouns, vocabulary
from llm_astar_planner.instructions.grammar.words import comparable
from llm_astar_planner.instructions.reader.lifting import SIGN, Lifted, is_letter, slot_name
from llm_astar_planner.instructions.reader.meaning import (
    EACH,
    UNKNOWN,
    WISH,
    Parts,
    flat,
    is_visit,
)
from llm_astar_planner.instructions.reader.network import known_words

# What slots of regions begin with.
REGIONS = ('@R', '@O', '@G', '@Y')
# Clauses that begin with a condition on a place.
CONDITIONAL = {'B', 'N', 'T'}
# What a meaning may be about that is no place of the map: what is named may have been one.
PLACELESS = {'HF', 'WALLS', 'START', 'GOAL'}
ENDS = ('.', ';', ':', '!', '?')
FIRST = ('first', 'erst', 'premier', 'primero')
# Ends of English words that are no names where no article is before them: 'booked', 'no barging'.
ENDINGS = ('ed', 'ing')


def doubt(one: Lifted, clauses: Sequence[Parts]) -> str:
    """Return why the clauses of a meaning are not certain, '' where they are."""
    tokens = list(flat(clauses))
    if UNKNOWN in tokens:
        return 'a place that the map does not have'
    doubts = [said for name in one.slots if name in tokens for said in one.slots[name].doubts]
    if doubts:
        return f'"{doubts[0]}" is doubtful'
    in_any_order = any(part[0] == 'V' and len(part) > 2 for part in clauses)
    if in_any_order and any(lexeme.kind == 'INORDER' for lexeme in one.lexemes):
        return 'the order is left'
    return (
        unused(one, tokens)
        or leftover(one)
        or twisted(one, tokens)
        or visited_again(one, clauses)
        or unnamed(one, tokens)
        or no_wall(one, tokens)
        or alone(one)
    )


def unused(one: Lifted, tokens: Collection[str]) -> str:
    """Return a length, side or number that a meaning leaves unsaid, '' for none.

    Not the other side of one that it says, 'on the left, not on the right', and not 'once' of a
    condition, 'une fois sorti du labo'.
    """
    said = [str(slot.value) for name, slot in one.slots.items() if name in tokens]
    opposites = {OPPOSITE.get(side) for side in said}
    is_condition = not CONDITIONAL.isdisjoint(tokens)
    # 'All three labs', 'the lab or the bar, one of the two'.
    counted = {2} if 'OR' in tokens else set()
    if EACH in tokens:
        counted |= {len(one.slots[token].members) for token in tokens if token in one.slots}
    for name, slot in one.slots.items():
        is_said = name in tokens or name[0] == 'R'
        is_contrast = name[0] == 'S' and slot.value in opposites
        is_once = is_condition and name[0] == 'K' and slot.number == 1
        is_all = name[0] == 'K' and slot.number in counted
        if not (is_said or is_contrast or is_once or is_all):
            return f'{name} is left'
    return ''


def leftover(one: Lifted) -> str:
    """Return a word outside of slots that has digits in it, '' for none."""
    language = set(one.tokens)
    found = (word.said or word.text for word in one.words if re.search(r'\d', word.text))
    return next((f'"{said}" is left' for said in found if comparable(said) in language), '')


def twisted(one: Lifted, meaning: Collection[str]) -> str:
    """Return words that ask for what no meaning can say; '' for none.

    'The corner of the lab', 'no more than 2 m from it', 'when it rains, go', 'Anna will go'; and
    those that ask for what a path does not have, where the meaning leaves it out.
    """
    said = ' '.join(one.tokens)
    found = [token for token in one.tokens if SAID['partial'].fullmatch(token)]
    if not any(token.startswith('U_') for token in meaning):
        asked = (lexeme for lexeme in one.lexemes if lexeme.kind == 'UNSUPPORTED')
        words = (w.text for x in asked for w in one.words if x.start <= w.start < x.end)
        found += [word for word in words if not SAID['any_time'].fullmatch(word)]
    names = ['unsayable', 'at_most'] if 'K' in meaning else ['unsayable']
    matches = (SAID[name].search(said) for name in names)
    found += [match[0] for match in matches if match]
    if 'A' in meaning and 'V' not in meaning:
        found += [one[0] for one in SAID['omission'].finditer(said)]
    if WISH not in meaning:
        found += [one[0] for one in SAID['conditions'].finditer(said) if SIGN not in one[0]]
    return f'"{found[0]}" may ask for something else' if found else ''


def visited_again(one: Lifted, clauses: Sequence[Parts]) -> str:
    """Return a place to visit that is said again after another one, '' for none."""
    visited = {token for part in clauses for token in flat([part]) if is_visit(part)}
    said = [slot_name(token) for token in one.tokens if token[0] == SIGN]
    said = [name for name in said if name in visited]
    turns = [name for name, after in zip(said, [*said[1:], '']) if name != after]
    again = [name for n, name in enumerate(turns) if name in turns[:n]]
    return f'{again[0]} is said again' if again else ''


def unnamed(one: Lifted, meaning: Collection[str]) -> str:
    """Return a word that may be a name, or a part of one, that the map does not have; '' for none.

    That is one beside a place that is no word of instructions, 'the old kitchen', 'kitchen door',
    and an unknown word or a noun after an article, a verb or the like: 'avoid the ballroom'.
    """
    words, called, known = vocabulary(one.language), nouns().everywhere, known_words()
    articles = words.articles | words.any_articles
    around = ('', '', *one.tokens, '')
    kinds_of = {
        token: {found[0][0] for found in words.phrases.exactly([token])} for token in around
    }
    needs_places = PLACELESS.isdisjoint(meaning)
    for earlier, before, token, after in zip(around, around[1:], one.tokens, around[3:]):
        named = called.exactly([token])
        is_wall = any(noun.name == WALL for noun in named)
        is_map = 'HF' in meaning and SAID['whole_map'].fullmatch(token)
        is_any = needs_places and SAID['any_place'].fullmatch(token)
        if not token.isalpha() or is_map or is_any or (is_wall and 'WALLS' in meaning):
            continue
        kinds, leads = kinds_of[token], kinds_of[before] & KINDS.before_names
        is_beside = before[:2] in REGIONS
        lead = earlier if before in articles else before
        is_told = bool(kinds_of[lead] & KINDS.before_names)
        is_noun = (
            token in called.words and token not in articles and not kinds & KINDS.function_words
        )
        is_seen = crc32(token.encode()) in known
        # In English what is before a place may be a part of its name.
        is_known = token in articles or bool(kinds - {'REMARK'})
        is_known |= is_seen and one.language != 'en'
        is_known |= bool(SAID['before_places'].fullmatch(token))
        is_known &= 'ORDINAL' not in kinds or token in FIRST
        follows = before in articles or bool(leads) or is_beside or earlier[:2] in REGIONS
        is_name = (
            (after[:2] in REGIONS and (is_noun or not is_known))
            or (is_beside and (is_noun or is_letter(token)))
            or (
                follows
                and (is_beside or is_told or not needs_places)
                and not (is_seen or kinds)
                and may_be_noun(token, one, has_article=before in articles)
            )
        )
        if is_name or named:
            return f'"{token}" may be a name'
    return ''


def no_wall(one: Lifted, meaning: Collection[str]) -> str:
    """Return that a meaning is about walls of which no word speaks, '' else: '2 m from me'."""
    called = nouns().everywhere
    is_said = any(noun.name == WALL for token in one.tokens for noun in called.exactly([token]))
    return '' if is_said or 'WALLS' not in meaning else 'no wall is named'


def may_be_noun(token: str, one: Lifted, *, has_article: bool) -> bool:
    """Whether a word may be one by its form: not 'no barging', nor a German one in small letters.

    German nouns begin with capitals where anything but the first word of the sentence does.
    """
    if one.language == 'en':
        return has_article or not token.endswith(ENDINGS)
    said = [word.said or word.text for word in one.words[1:]]
    has_capitals = any(word[0].isupper() for word in said)
    mine = (word for word in said if comparable(word) == token)
    return one.language != 'de' or not has_capitals or not all(word.islower() for word in mine)


def alone(one: Lifted) -> str:
    """Return a word that nobody knows and that is all of a part of the sentence; '' for none.

    'Keep 1 m away from the walls; fly' asks for more than a distance.
    """
    phrases = vocabulary(one.language).phrases
    around = ('.', *one.tokens, '.')
    for before, token, after in zip(around, one.tokens, around[2:]):
        if before in ENDS and after in ENDS and token.isalpha() and not phrases.exactly([token]):
            return f'"{token}" is left'
    return ''
