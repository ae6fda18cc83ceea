# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What speaks against a reading: rules over the words, which know nothing of the networks.

Each was kept because on locked sentences it refused more of the wrong readings than of the right
ones, `twisted` because sentences of `test/language/mutations.py` were claimed falsely without it.
Rules for conditions on places, wishes, ends and unknown words were not kept.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from zlib import crc32

from llm_astar_planner.instructions.grammar.selection import OPPOSITE, WALL
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, SAID, nouns, vocabulary
from llm_astar_planner.instructions.grammar.words import comparable, phrase_words
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
    # Whatever the map calls its passage, 'the corridor' is that one.
    doubts = [said for said in doubts if not is_passage(said)]
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


def is_passage(said: str) -> bool:
    """Whether words are a name for any passage: 'the hallway'."""
    found = nouns().everywhere.exactly(phrase_words(said))
    return any(noun.generic == 'passage' for noun in found)


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
    told = {slot_name(token) for token in relevant(one) if token[0] == SIGN}
    for name, slot in one.slots.items():
        is_said = name in tokens or name[0] == 'R' or name not in told
        is_contrast = name[0] == 'S' and slot.value in opposites
        is_once = is_condition and name[0] == 'K' and slot.number == 1
        is_all = name[0] == 'K' and slot.number in counted
        if not (is_said or is_contrast or is_once or is_all):
            return f'{name} is left'
    return ''


def relevant(one: Lifted) -> list[str]:
    """Return the tokens of a sentence without those that say nothing about the route."""
    return SAID['irrelevant'].sub(' ', ' '.join(one.tokens)).split()


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
    rest = relevant(one)
    said = ' '.join(rest)
    found = [token for token in rest if SAID['partial'].fullmatch(token)]
    if not any(token.startswith('U_') for token in meaning):
        asked = (lexeme for lexeme in one.lexemes if lexeme.kind == 'UNSUPPORTED')
        words = (w.text for x in asked for w in one.words if x.start <= w.start < x.end)
        found += [word for word in words if word in rest and not SAID['any_time'].fullmatch(word)]
    names = ['unsayable', 'at_most'] if 'K' in meaning else ['unsayable']
    matches = (SAID[name].search(said) for name in names)
    found += [match[0] for match in matches if match]
    if 'A' in meaning and 'V' not in meaning:
        found += [one[0] for one in SAID['omission'].finditer(said)]
    if WISH not in meaning:
        is_condition = not CONDITIONAL.isdisjoint(meaning)
        found += [
            one[0]
            for one in SAID['conditions'].finditer(said)
            if not (is_condition and SIGN in one[0])
        ]
    return f'"{found[0]}" may ask for something else' if found else ''


def visited_again(one: Lifted, clauses: Sequence[Parts]) -> str:
    """Return a place to visit that is said again after another one, '' for none."""
    visited = {token for part in clauses for token in flat([part]) if is_visit(part)}
    said = [slot_name(token) for token in one.tokens if token[0] == SIGN]
    said = [name for name in said if name in visited]
    turns = [name for name, after in zip(said, [*said[1:], '']) if name != after]
    again = [name for n, name in enumerate(turns) if name in turns[:n]]
    return f'{again[0]} is said again' if again else ''


@dataclass(frozen=True)
class WordInContext:
    """A word of a sentence with the tokens around it, '' where there are none."""

    one: Lifted
    earlier: str
    before: str
    word: str
    after: str

    def kinds(self, token: str) -> frozenset[str]:
        """Return the kinds of lexemes that a token may be."""
        return kinds_of(token, self.one.language)

    def is_article(self, token: str) -> bool:
        """Whether a token is left out before a name."""
        words = vocabulary(self.one.language)
        return token in words.articles or token in words.any_articles

    @property
    def is_seen(self) -> bool:
        """Whether it was in many sentences and never a name."""
        return crc32(self.word.encode()) in known_words()

    @property
    def is_noun(self) -> bool:
        """Whether it is a word of what places are called."""
        is_function = self.is_article(self.word) or self.kinds(self.word) & KINDS.function_words
        return self.word in nouns().everywhere.words and not is_function

    @property
    def is_generic(self) -> bool:
        """Whether it is what places are called, in the language or in English: 'the room'."""
        languages = (self.one.language, 'en')
        return any(nouns().by_language[name].exactly([self.word]) for name in languages)

    @property
    def is_beside(self) -> bool:
        """Whether a place is before it: 'kitchen door'."""
        return self.before[:2] in REGIONS

    @property
    def is_told(self) -> bool:
        """Whether a verb or the like is before it, or before its article."""
        lead = self.earlier if self.is_article(self.before) else self.before
        return bool(self.kinds(lead) & KINDS.before_names)

    @property
    def follows(self) -> bool:
        """Whether what is before it may be before a name."""
        is_led = self.is_article(self.before) or self.kinds(self.before) & KINDS.before_names
        return bool(is_led) or self.is_beside or self.earlier[:2] in REGIONS

    @property
    def begins_name(self) -> bool:
        """Whether it is before a place and no word of instructions: 'the old kitchen'.

        In English what is before a place may be a part of its name even where it was often said.
        """
        kinds = self.kinds(self.word)
        is_known = self.is_article(self.word) or bool(kinds - {'REMARK'})
        is_known |= self.is_seen and self.one.language != 'en'
        is_known |= bool(SAID['before_places'].fullmatch(self.word))
        is_ordinal = 'ORDINAL' in kinds and self.word not in FIRST
        return self.after[:2] in REGIONS and (self.is_noun or is_ordinal or not is_known)

    def is_name(self, *, has_place: bool) -> bool:
        """Whether it may be a name, or a part of one; `has_place` where a meaning has its places.

        Then what follows no verb or place is in a reason, but for 'the door of the kitchen'.
        """
        is_asked = self.is_told or self.is_beside or not has_place
        is_unknown = (
            (is_asked and self.follows)
            and not (self.is_seen or self.kinds(self.word))
            and may_be_noun(self.word, self.one, has_article=self.is_article(self.before))
        )
        is_generic = self.is_generic and (is_asked or 'OF' in self.kinds(self.after))
        ends_name = self.is_beside and (self.is_noun or is_letter(self.word))
        return is_unknown or is_generic or ends_name or self.begins_name

    def is_meant(self, meaning: Collection[str]) -> bool:
        """Whether a meaning says it without a slot: walls, the map, any place."""
        if 'WALLS' in meaning and is_wall(self.word):
            return True
        name = 'whole_map' if 'HF' in meaning else 'any_place'
        return bool(SAID[name].fullmatch(self.word)) and 'WALLS' not in meaning


@lru_cache(maxsize=4096)
def kinds_of(token: str, language: str) -> frozenset[str]:
    """Return the kinds of lexemes that a token may be in a language."""
    return frozenset(found[0][0] for found in vocabulary(language).phrases.exactly([token]))


def unnamed(one: Lifted, meaning: Collection[str]) -> str:
    """Return a word that may be a name, or a part of one, that the map does not have; '' for none.

    That is one beside a place that is no word of instructions, 'the old kitchen', 'kitchen door',
    and an unknown word or a noun after an article, a verb or the like: 'avoid the ballroom'.
    """
    has_place = PLACELESS.isdisjoint(meaning)
    tokens = ('', '', *one.tokens, '')
    for around in zip(tokens, tokens[1:], one.tokens, tokens[3:]):
        word = WordInContext(one, *around)
        if not word.word.isalpha() or word.is_meant(meaning):
            continue
        if word.is_name(has_place=has_place):
            return f'"{word.word}" may be a name'
    return ''


def is_wall(word: str) -> bool:
    """Whether a word is a noun for walls."""
    return any(noun.name == WALL for noun in nouns().everywhere.exactly([word]))


def no_wall(one: Lifted, meaning: Collection[str]) -> str:
    """Return that a meaning is about walls of which no word speaks, '' else: '2 m from me'."""
    is_said = any(is_wall(token) for token in one.tokens)
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
        is_known = phrases.exactly([token]) or SAID['interjection'].fullmatch(token)
        if before in ENDS and after in ENDS and token.isalpha() and not is_known:
            return f'"{token}" is left'
    return ''
