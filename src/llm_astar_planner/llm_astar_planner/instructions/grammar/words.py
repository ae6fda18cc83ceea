"""Text as words that can be compared: without case, accents, hyphens and apostrophes."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import lru_cache

# Each alternative starts with another kind of character, so that reading takes linear time.
WORD = re.compile(r'(?<![\w.])[-\u2212]?[0-9]+(?:\.[0-9]+)?|[0-9]+(?:\.[0-9]+)?|[^\W\d_]+|\S')
# The straight ones, the typographic ones of all languages, accents used as such, and
# the signs that open a Spanish exclamation or question.
QUOTES = frozenset('\'"`*_\u00ab\u00b4\u00bb\u2018\u2019\u201a\u201c\u201d\u201e\u00a1\u00bf')
HYPHENS = frozenset('-\u2010\u2011')
MINUS = '\u2212'


@dataclass(frozen=True)
class Word:
    """A word, a number or a sign: its comparable form and where it stands in the text."""

    text: str
    start: int
    end: int

    @property
    def is_number(self) -> bool:
        """Whether it is written in digits."""
        return self.text.isascii() and self.text[-1].isdigit()

    @property
    def is_letters(self) -> bool:
        """Whether it is a word in the narrow sense."""
        return self.text.isalpha()


@lru_cache(maxsize=4096)
def comparable(text: str) -> str:
    """Return a word without case and accents: 'Küche' is 'kuche', 'weiß' is 'weiss'."""
    if text[0] == MINUS:
        return f'-{text[1:]}'
    if text.isascii() or not text.isalpha():
        return text.lower()
    decomposed = unicodedata.normalize('NFKD', text.casefold())
    return ''.join(letter for letter in decomposed if not unicodedata.combining(letter)) or text


def read_words(text: str) -> list[Word]:
    """Return the words of a text in order, without quotes and hyphens within words."""
    return [
        Word(comparable(match[0]), match.start(), match.end())
        for match in WORD.finditer(text)
        if match[0] not in QUOTES and not is_joint(text, match.start())
    ]


def is_joint(text: str, at: int) -> bool:
    """Whether the character is a hyphen between a letter and a letter or digit."""
    return (
        text[at] in HYPHENS
        and at > 0
        and text[at - 1].isalpha()
        and text[at + 1 : at + 2].isalnum()
    )


def phrase_words(phrase: str) -> tuple[str, ...]:
    """Return the comparable words of a phrase."""
    return tuple(word.text for word in read_words(phrase))


def word_set(text: str) -> frozenset[str]:
    """Return the words of a text, divided by spaces, as a set."""
    return frozenset(text.split())
