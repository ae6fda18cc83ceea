"""What a sentence mentions: places, tags, numbers, directions; found without any model."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from functools import partial

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.fields import FAR
from llm_astar_planner.instructions.model.names import Mention, NameFinder
from llm_astar_planner.instructions.model.vocabulary import (
    Token,
    correct,
    label,
    tokens_of,
    vocabulary,
)
from llm_astar_planner.instructions.regions import SIDES


@dataclass(frozen=True, eq=False)
class Sentence:
    """A sentence split into words, with all that it mentions in its order."""

    text: str
    tokens: tuple[Token, ...]
    mentions: tuple[Mention, ...]
    places: Places

    @property
    def numbers(self) -> list[float]:
        """Every number that a clause may hold: as written, and in metres."""
        found = (value for mention in self.mentions for value in mention.numbers)
        return list(dict.fromkeys(found))

    @property
    def sides(self) -> list[str]:
        """The directions that it names, in the order of SIDES."""
        found = {side for mention in self.mentions for side in mention.sides}
        return [side for side in SIDES if side in found]

    @property
    def has_strange_words(self) -> bool:
        """Whether a word is neither in the vocabulary nor part of a mention: maybe a name."""
        mentioned = {index for mention in self.mentions for index in mention.tokens}
        return any(
            not (token.labels or token.is_break or token.is_number or index in mentioned)
            or any(len(mention.names) > 1 for mention in self.mentions)
            for index, token in enumerate(self.tokens)
            if len(token.text) > 1
        )

    def has(self, name: str) -> bool:
        """Return whether a word of a class of the vocabulary is in it."""
        return any(name in token.labels for token in self.tokens)

    def words(self, first: int, last: int) -> str:
        """Return the sentence from one token to another, as it was written."""
        return self.text[self.tokens[first].start : self.tokens[last].end]


def read_sentence(text: str, places: Places) -> Sentence:
    """Find what a sentence mentions. The time grows with its length alone."""
    tokens = tokens_of(text)
    label(tokens)
    mentions = mentions_at(len(tokens), NameFinder(places, tokens).match_at)
    taken = {index for mention in mentions for index in mention.tokens}
    correct(tokens, taken)
    mentions += mentions_at(len(tokens), partial(number_at, tokens), taken)
    mentions += side_mentions(tokens, taken)
    mentions.sort(key=lambda mention: mention.first)
    return Sentence(text, tuple(tokens), tuple(mentions), places)


def mentions_at(
    count: int, mention_at: Callable[[int], Mention | None], taken: Container[int] = ()
) -> list[Mention]:
    """Return the mentions that begin at some of so many tokens and do not overlap."""
    found: list[Mention] = []
    index = 0
    while index < count:
        mention = None if index in taken else mention_at(index)
        found += [mention] if mention else []
        index = mention.tokens[-1] + 1 if mention else index + 1
    return found


def number_at(tokens: Sequence[Token], index: int) -> Mention | None:
    """Return the number that begins at a token, with its unit, None if none does."""
    value, end = leading_number(tokens, index)
    if value is None:
        return None
    in_words = not tokens[index].is_number
    end, half = skip_half(tokens, end)
    unit, after = unit_at(tokens, end)
    if unit is None and in_words:
        return None
    if unit is not None and not half:
        after, half = skip_half(tokens, after)
    value += half
    if not math.isfinite(value) or abs(value) > FAR:
        return None
    values = (value,) if unit in (None, 1.0) else (value, round(value * unit, 6))
    return Mention(tuple(range(index, after)), numbers=values, has_unit=unit is not None)


def leading_number(tokens: Sequence[Token], index: int) -> tuple[float | None, int]:
    """Return the number at a token and the position behind it."""
    token = tokens[index]
    if token.is_number:
        if is_decimal_comma(tokens, index):
            return float(f'{token.text}.{tokens[index + 2].text}'), index + 3
        return float(token.text), index + 1
    numbers = vocabulary().numbers
    for length in (3, 2, 1):
        phrase = ' '.join(part.text for part in tokens[index : index + length])
        if phrase in numbers:
            value, end = numbers[phrase], index + length
            following = numbers.get(tokens[end].text) if end < len(tokens) else None
            if value >= 20 and value % 10 == 0 and following and following < 10:
                return value + following, end + 1
            return value, end
    return None, index


def is_decimal_comma(tokens: Sequence[Token], index: int) -> bool:
    """Return whether '2,5' is two and a half: a unit follows, or an axis goes before it."""
    if index + 2 >= len(tokens):
        return False
    number, comma, rest = tokens[index : index + 3]
    if not (comma.is_comma and rest.is_number and rest.text.isdigit() and '.' not in number.text):
        return False
    if number.end != comma.start or comma.end != rest.start:
        return False
    follows = unit_at(tokens, index + 3)[0] is not None
    return follows or (index > 0 and tokens[index - 1].text in ('x', 'y'))


def skip_half(tokens: Sequence[Token], index: int) -> tuple[int, float]:
    """Return the position behind 'and a half' at a token, and 0.5; else the position and 0."""
    words = [token.text for token in tokens[index : index + 3]]
    if words in (['and', 'a', 'half'], ['et', 'un', 'demi'], ['y', 'un', 'medio']):
        return index + 3, 0.5
    if words[:2] in (['et', 'demi'], ['y', 'medio'], ['and', 'half']):
        return index + 2, 0.5
    return index, 0.0


def unit_at(tokens: Sequence[Token], index: int) -> tuple[float | None, int]:
    """Return the metres of the unit at a token, past 'a' and 'of', and the position behind it."""
    units = vocabulary().units
    for skipped in range(2):
        at = index + skipped
        if at >= len(tokens) or (skipped and tokens[at - 1].text not in ('a', 'an', 'of', 'de')):
            break
        # 'in' is an inch only where it is no preposition.
        if tokens[at].text in units and tokens[at].text != 'in':
            return units[tokens[at].text], at + 1
    return None, index


def side_mentions(tokens: Sequence[Token], taken: set[int]) -> list[Mention]:
    """Return the directions: compass words, top and bottom, left and right."""
    found: list[Mention] = []
    for index, token in enumerate(tokens):
        sides = tuple(side for side in SIDES if f'sides.{side}' in token.labels)
        if sides and index not in taken:
            found.append(Mention((index,), sides=sides))
    return found
