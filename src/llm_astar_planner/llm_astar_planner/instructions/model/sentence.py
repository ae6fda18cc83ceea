# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a sentence mentions, found by the lexer of the grammar: for prompts and schemas."""

from collections.abc import Iterator
from dataclasses import dataclass

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.fields import FAR
from llm_astar_planner.instructions.grammar.interpreter import languages_of, lexer_for
from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.words import read_words
from llm_astar_planner.instructions.regions import SIDES


@dataclass(frozen=True, eq=False)
class Sentence:
    """The lexemes of a sentence in its likeliest language, with all that they mention."""

    lexemes: tuple[Lexeme, ...]
    places: Places
    written: tuple[float, ...] = ()

    @property
    def names(self) -> list[str]:
        """The names of the places that it may mean."""
        return list(dict.fromkeys(name for one in self.lexemes for name in one.names))

    @property
    def numbers(self) -> list[float]:
        """Every number that a clause may hold: as written, and in metres."""
        found = (value for lexeme in self.lexemes for value in numbers_of(lexeme))
        return [value for value in dict.fromkeys([*self.written, *found]) if abs(value) <= FAR]

    @property
    def sides(self) -> list[str]:
        """The directions that it names, in the order of SIDES."""
        found = {one.value for one in self.lexemes if one.kind in ('SIDE', 'MOST')}
        return [side for side in SIDES if side in found]

    @property
    def has_strange_words(self) -> bool:
        """Whether a word is not known, or may mean several places: maybe a name."""
        return any(one.kind == 'UNKNOWN' or len(one.names) > 1 for one in self.lexemes)

    def has(self, *kinds: str) -> bool:
        """Return whether a word of one of some kinds is in it."""
        return any(lexeme.kind in kinds for lexeme in self.lexemes)


def read_sentence(text: str, places: Places) -> Sentence:
    """Find what a sentence mentions. The time grows with its length alone."""
    words = read_words(text)
    lexer = lexer_for(places, next(languages_of(words)))
    corrected, _ = lexer.corrected(words)
    written = tuple(float(word.text) for word in words if word.is_number)
    return Sentence(tuple(lexer.lexemes(corrected)), places, written)


def numbers_of(lexeme: Lexeme) -> Iterator[float]:
    """Yield the numbers of a lexeme, lengths in metres."""
    if lexeme.kind in ('LENGTH', 'NUMBER'):
        yield lexeme.number
    elif lexeme.kind == 'POINT':
        yield from lexeme.value
    elif lexeme.kind == 'AXISLINE':
        yield lexeme.value[1]
    elif lexeme.kind == 'RANGE':
        yield from (side for box in lexeme.value for side in box.sides)
