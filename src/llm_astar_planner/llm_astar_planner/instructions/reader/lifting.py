# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Lifting: slots in a sentence for what the map and numbers say, so that the rest is language.

'avoid the loading dock by 2 m' becomes `avoid the @R1 by @L1`. Names, kinds and tags, also as
descriptions ('the second aisle from the west'), are matched by the words of the grammar.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from llm_astar_msgs_adapter.maps.places import Place, Places

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.grammar.interpreter import languages_of, lexer_for
from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.lexicon import Group, common_tag
from llm_astar_planner.instructions.grammar.selection import (
    WALL,
    Modifier,
    Unclear,
    select_group,
)
from llm_astar_planner.instructions.grammar.spoken import with_spoken_numbers
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, SAID, nouns
from llm_astar_planner.instructions.grammar.words import Word, phrase_words, read_words
from llm_astar_planner.instructions.reader.relations import related
from llm_astar_planner.instructions.regions import NamedPlace, Region

# What slots begin with.
SIGN = '@'
# How many slots of a kind a sentence may have.
SLOTS = {'R': 9, 'L': 4, 'S': 4, 'K': 4}
# A noun with its adjectives, and with what may follow them, by the kinds of lexemes.
DESCRIBED = re.compile(
    f'((?:(?:{"|".join(sorted(KINDS.adjectives))}) )*NOUN )(?:TAG )*'
    '(?:(?:IN |UPON |TO |FROM )?(?:SIDE |CENTER )+(?:SIDENOUN |CORNER )?)?'
)
MOST_DESCRIBED = 12
SHORTEST_PART = 3
# Numbers that may say how often ('one' is a word: 'the big one'), and hundredths of a metre after
# metres: 'a metre fifty'.
TIMES = range(2, 21)
HUNDREDTHS = range(5, 100, 5)
# Parts of a metre after metres, and what the decimal point is called: 'a metre and a quarter'.
PARTS = {
    'half': 0.5, 'demi': 0.5, 'medio': 0.5, 'quarter': 0.25, 'viertel': 0.25, 'quart': 0.25,
    'cuarto': 0.25, **{str(n): n / 100 for n in HUNDREDTHS},
}  # fmt: skip
DECIMAL_POINTS = ('komma', 'virgule', 'coma')
# What a slot is called in the meaning, where it is not as it is shown.
NAMED_AS = {'O': 'R', 'G': 'R', 'Y': 'R', 'N': 'K'}
WORDS_OF_A_LETTER = frozenset('adeilmnostuy')
# Words before which 'right' is no side: 'right beside it'.
AFTER_RIGHT = frozenset(
    {'after', 'along', 'alongside', 'away', 'before', 'behind', 'beside', 'by', 'here', 'next',
     'now', 'past', 'round', 'there', 'through', 'up'}
)  # fmt: skip
# Words in names that tell nothing.
VAGUE = frozenset(
    {'room', 'area', 'zone', 'place', 'station', 'hall', 'main', 'raum', 'sala', 'patient',
     'patients', 'patienten', 'pacientes', 'people', 'personal', 'personnel', 'staff', 'visitors'}
)  # fmt: skip


@dataclass(frozen=True)
class Slot:
    """What one slot stands for.

    - `kind`: R a region, L metres, S a side, K how often: (least, most, turned round by 'not'), or
      a number.
    - `shown`: R one place, O an object, G several, Y any one of several, N a number.
    - `members`: the regions of a group. `doubts`: words that may mean something else.
    """

    kind: str
    value: Any
    shown: str = ''
    members: tuple[Region, ...] = ()
    doubts: tuple[str, ...] = ()

    @property
    def entries(self) -> tuple[int, int | None]:
        """The least and the most of a K slot with limits; 'not twice' is once at most."""
        least, most, turns = self.value
        if turns:
            least, most = (0, least - 1) if least else (int(most) + 1, None)
        return int(least), None if most is None else int(most)

    @property
    def number(self) -> int | None:
        """How many a K slot says by itself, of 'twice' too; None for limits, 'at most twice'."""
        if isinstance(self.value, int):
            return self.value
        return int(self.value[0]) if self.value[0] == self.value[1] else None

    def means(self, value: object) -> bool:
        """Whether the slot stands for a value, a number for K."""
        return (self.number if self.kind == 'K' else self.value) == value

    @property
    def in_json(self) -> Any:  # noqa: ANN401 - JSON
        """The value in JSON."""
        return self.value.to_json() if isinstance(self.value, Region) else self.value


@dataclass(frozen=True)
class Lifted:
    """A sentence with slots: tokens, what the slots stand for by name ('R1'), and the lexemes."""

    tokens: tuple[str, ...] = ()
    slots: dict[str, Slot] = field(default_factory=dict)
    lexemes: tuple[Lexeme, ...] = ()
    words: tuple[Word, ...] = ()
    language: str = 'en'


def lifted(text: str, places: Places) -> Lifted:
    """Return a clean text with slots, in the language that most of its words are of."""
    read = [word for word in with_spoken_numbers(read_words(text)) if word.text != SIGN]
    language = next(iter(languages_of(read)))
    lexer = lexer_for(places, language)
    words, _ = lexer.corrected(read)
    lexemes = with_tags(lexer.lexemes(words), read)
    tokens: list[str] = []
    slots: dict[str, Slot] = {}
    at = 0
    for start, end, slot in sorted(slots_in(lexemes, places, read), key=lambda one: one[0]):
        between = [word.text for word in read if at <= word.start < start]
        name = named(slot, slots)
        token = f'{SIGN}{slot.shown or slot.kind}{name[1:]}'
        # 'The red bathroom painted in crimson' is said once.
        is_again = tokens[-1:] == [token] and (not between or leads_to_tag(between))
        if not is_again:
            tokens += [*between, *([token] if name else [])]
        if name:
            slots.setdefault(name, slot)
        at = max(at, end)
    tokens += [word.text for word in read if word.start >= at]
    return Lifted(tuple(tokens), slots, tuple(lexemes), tuple(words), language)


def with_tags(lexemes: Sequence[Lexeme], words: Sequence[Word]) -> Sequence[Lexeme]:
    """Return lexemes without what leads from a noun to its tag: 'the room painted in green'."""
    kept = [*lexemes]
    for at in reversed([n for n, one in enumerate(lexemes) if one.kind == 'NOUN']):
        ahead = lexemes[at : at + MOST_DESCRIBED]
        tag = next((n for n, one in enumerate(ahead) if one.kind == 'TAG'), 0)
        said = [w.text for w in words if ahead[0].end <= w.start < ahead[tag].start]
        if tag > 1 and leads_to_tag(said):
            del kept[at + 1 : at + tag]
    return kept


def leads_to_tag(words: Sequence[str]) -> bool:
    """Whether words lead from a noun to its colour or tag: 'painted in'."""
    return bool(SAID['painted'].fullmatch(' '.join(words)))


def slot_name(token: str) -> str:
    """Return the name in the meaning of a slot as it is shown: 'R3' of '@G3'."""
    return NAMED_AS.get(token[1], token[1]) + token[2:]


def named(slot: Slot, slots: Mapping[str, Slot]) -> str:
    """Return the name of a slot, that of the same one before; '' where there are too many."""
    mine = {name: one for name, one in slots.items() if name[0] == slot.kind}
    same = (n for n, one in mine.items() if (one.value, one.shown) == (slot.value, slot.shown))
    new = f'{slot.kind}{len(mine) + 1}' if len(mine) < SLOTS[slot.kind] else ''
    return next(same, new)


def slots_in(
    lexemes: Sequence[Lexeme], places: Places, words: Sequence[Word]
) -> Iterator[tuple[int, int, Slot]]:
    """Yield the slots of a sentence, each with where it stands."""
    at, before = 0, ''
    while at < len(lexemes):
        count, slot = told_by_another(lexemes[at : at + MOST_DESCRIBED], words)
        if slot is None:
            count, slot = noun_phrase(lexemes[at:])
        if slot is None:
            count, slot = 1, next_of_series(before, lexemes[at], places)
        if slot is None:
            count, slot = metres_and_more(lexemes[max(0, at - 1) : at], lexemes[at : at + 3])
        if slot is None:
            count, slot = 1, simple_slot(lexemes[at], places, words)
        if slot is not None:
            yield lexemes[at].start, lexemes[at + count - 1].end, slot
            before = slot.value.place if isinstance(slot.value, NamedPlace) else before
        at += count


def noun_phrase(lexemes: Sequence[Lexeme]) -> tuple[int, Slot | None]:
    """Return how many lexemes a noun takes with what describes it, and its slot, None if unclear.

    Words after the noun count where they tell the place: 'the room in the top left corner'.
    """
    match = DESCRIBED.match(''.join(f'{one.kind} ' for one in lexemes[:MOST_DESCRIBED]))
    for count in (match[0].count(' '), match[1].count(' ')) if match else ():
        slot = described(lexemes[:count])
        if slot is not None:
            return count, slot
    return 0, None


def described(lexemes: Sequence[Lexeme]) -> Slot | None:
    """Return the slot of a noun with adjectives and words for where it lies; None if unclear."""
    noun = [one.kind for one in lexemes].index('NOUN')
    before = [Modifier(one.kind, one.value) for one in lexemes[:noun]]
    after = [Modifier(one.kind, one.value) for one in lexemes[noun + 1 :]]
    tags = [one for one in after if one.kind == 'TAG']
    where = [one for one in after if one.kind in ('SIDE', 'CENTER')]
    try:
        found = select_group(lexemes[noun].value, [*before, *tags], where)
    except Unclear:
        return any_of_group(lexemes[0]) if len(lexemes) == 1 else None
    doubts = tuple(said for one in lexemes for said, _ in one.doubts)
    if len(found.places) == 1 and not found.is_walls:
        return place_slot(found.places[0], doubts)
    region = found.together or regions.AnyOf(found.regions[: regions.MAX_JOINED])
    shown = 'Y' if found.any_one else 'G'
    return None if found.is_walls else Slot('R', region, shown, found.regions, doubts)


def told_by_another(lexemes: Sequence[Lexeme], words: Sequence[Word]) -> tuple[int, Slot | None]:
    """Return how many lexemes 'room next to the kitchen' takes, and its slot; None for others."""
    at = next((n for n, one in enumerate(lexemes) if one.kind == 'PLACE'), 0)
    if lexemes[0].kind != 'NOUN' or not at:
        return 0, None
    noun, other = lexemes[0], lexemes[at]
    said = ' '.join(one.text for one in words if noun.end <= one.start < other.start)
    found = related(candidates(noun), said, other.value)[: regions.MAX_JOINED]
    doubts = tuple(told for told, _ in other.doubts)
    if len(found) < 2:
        return at + 1, place_slot(found[0], doubts) if found else None
    members = tuple(NamedPlace(one.name) for one in found)
    return at + 1, Slot('R', regions.AnyOf(members), 'Y', members, (*doubts, said))


def candidates(noun: Lexeme) -> Sequence[Place]:
    """Return the places of a noun; of one that the map has not, 'room', all that may be rooms."""
    group, kinds = noun.value, nouns().generic
    if group.own or kinds.get(group.noun) != group.noun:
        return noun.places
    rooms = (one for one in group.all_places if not one.is_object)
    return [one for one in rooms if kinds.get(one.kind, group.noun) == group.noun]


def any_of_group(noun: Lexeme) -> Slot | None:
    """Return the slot of a noun in singular that may mean several places: 'either bathroom'."""
    group = noun.value
    is_wide = isinstance(group, Group) and nouns().generic.get(group.noun) == group.noun
    if not isinstance(group, Group) or is_wide or group.noun == WALL or len(group.places) < 2:
        return None
    members = tuple(NamedPlace(place.name) for place in group.places[: regions.MAX_JOINED])
    tag = group.tag or common_tag(group, list(group.places), (), is_told=False)
    doubts = tuple(said for said, _ in noun.doubts)
    return Slot('R', regions.Tagged(tag) if tag else regions.AnyOf(members), 'Y', members, doubts)


def metres_and_more(
    before: Sequence[Lexeme], lexemes: Sequence[Lexeme]
) -> tuple[int, Slot | None]:
    """Return how many lexemes a length in several words takes, and its slot.

    'A metre', 'one metre fifty', 'a metre and twenty', 'one point eight metres'.
    """
    first = lexemes[0]
    if first.kind == 'NUMBER' and first.number >= 0:
        return spoken_number(lexemes)
    is_told = any(one.kind in ('OF', 'HALFNOUN', 'AND', 'UNKNOWN') for one in before)
    if first.kind != 'LENGTH' and (first.kind != 'UNIT' or is_told):
        return 0, None
    if not float(first.value).is_integer():
        return 0, None
    is_joined = any(one.kind in ('AND', 'FROM') for one in lexemes[1:2])
    others = lexemes[2:3] if is_joined else lexemes[1:2]
    names = ['half' if one.kind == 'HALFNOUN' else str(one.value) for one in others]
    more = [PARTS[name] for name in names if name in PARTS]
    count = 1 + lexemes.index(others[0]) if more else 1
    return count, length_slot(float(first.value) + sum(more), first)


def spoken_number(lexemes: Sequence[Lexeme]) -> tuple[int, Slot | None]:
    """Return how many lexemes 'one point eight metres' takes."""
    first = lexemes[0].number
    kinds = [one.kind for one in lexemes]
    is_decimal = kinds[1:] == ['POINTWORD', 'LENGTH'] or (
        kinds[1:] == ['UNKNOWN', 'LENGTH'] and lexemes[1].value in DECIMAL_POINTS
    )
    if is_decimal and float(lexemes[2].value) in range(10):
        return 3, length_slot(first + float(lexemes[2].value) / 10, lexemes[2])
    return 0, None


def length_slot(metres: float, lexeme: Lexeme) -> Slot:
    """Return the slot of metres, rounded so that 70 cm are 0.7."""
    return Slot('L', round(metres, 6), doubts=tuple(said for said, _ in lexeme.doubts))


def next_of_series(name: str, lexeme: Lexeme, places: Places) -> Slot | None:
    """Return the place that a number or letter means after a name: 'lab 1 or 3', 'gate A, B'."""
    head, _, last = name.rpartition(' ')
    said = f'{lexeme.value:g}' if isinstance(lexeme.value, float) else str(lexeme.value)
    is_next = lexeme.kind in ('NUMBER', 'UNKNOWN') and (last.isdigit() or len(last) == 1)
    found = places.get(f'{head} {said}') if head and is_next else None
    return None if found is None else place_slot(found, ())


def place_slot(place: Place, doubts: tuple[str, ...]) -> Slot:
    """Return the slot of one place."""
    return Slot('R', NamedPlace(place.name), 'O' if place.is_object else 'R', (), doubts)


def is_adverb(lexeme: Lexeme, words: Sequence[Word]) -> bool:
    """Whether a side is none: 'right next to', 'right now'."""
    after = next((word.text for word in words if word.start >= lexeme.end), '')
    said = next((word.text for word in words if word.start == lexeme.start), '')
    return said == 'right' and after in AFTER_RIGHT


def simple_slot(lexeme: Lexeme, places: Places, words: Sequence[Word]) -> Slot | None:
    """Return the slot of one lexeme, None of one that is language."""
    doubts = tuple(said for said, _ in lexeme.doubts)
    value = lexeme.value
    if lexeme.kind == 'PLACE':
        return place_slot(value, doubts)
    if lexeme.kind == 'LENGTH':
        return length_slot(float(value), lexeme)
    if lexeme.kind == 'SIDE' and not is_adverb(lexeme, words):
        return Slot('S', str(value), doubts=doubts)
    if lexeme.kind == 'POINT':
        return Slot('R', regions.Disc(*value), 'R')
    if lexeme.kind == 'TIMES':
        return Slot('K', value, doubts=doubts) if isinstance(value, tuple) else None
    if lexeme.kind == 'NUMBER' and lexeme.number in TIMES:
        return Slot('K', int(lexeme.number), 'N')
    if lexeme.kind == 'TAG':
        found = places.with_tag(str(value))
        if len(found) == 1:
            return place_slot(found[0], doubts)
        members = tuple(NamedPlace(one.name) for one in found)
        return Slot('R', regions.Tagged(value), 'G', members, doubts)
    if lexeme.kind == 'UNKNOWN' and (len(str(value)) >= SHORTEST_PART or is_letter(str(value))):
        is_as_written = any(one.text == value and one.end == lexeme.end for one in words)
        return named_in_part(str(value), is_as_written, places)
    return None


def is_letter(word: str) -> bool:
    """Whether a word may be the letter of a place and is no word of a language."""
    return len(word) == 1 and word.isalpha() and word not in WORDS_OF_A_LETTER


def named_in_part(word: str, is_as_written: bool, places: Places) -> Slot | None:
    """Return the place that alone has a word in its names: 'packing' station.

    With a doubt where it is a letter, corrected or a plural: 'the boutiques' where there is one.
    """
    if word in VAGUE:
        return None
    parts = name_parts(places)
    doubts = () if is_as_written and word in parts and len(word) > 1 else (word,)
    found = parts.get(word) or parts.get(word.removesuffix('s')) or ()
    return place_slot(found[0], doubts) if len(found) == 1 else None


@lru_cache(maxsize=16)
def name_parts(places: Places) -> dict[str, list[Place]]:
    """Return the places by the words of their names and aliases."""
    found: dict[str, list[Place]] = {}
    for place in places:
        names = (place.name, *place.aliases)
        for word in {word for name in names for word in phrase_words(name)}:
            found.setdefault(word, []).append(place)
    return found
