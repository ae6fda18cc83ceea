# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Text as words that can be compared: without case, accents, hyphens and apostrophes."""

import re
import unicodedata
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Any, Generic, TypeVar

# A hyphen between a letter and a letter or digit is left out. Each of the other alternatives
# starts with another kind of character, so that reading takes linear time.
WORD = re.compile(
    r'(?<=[^\W\d_])(?P<joint>[-\u2010\u2011])(?=[^\W_])|'
    r'(?<![\w.])[-\u2212]?[0-9]+(?:\.[0-9]+)?|[0-9]+(?:\.[0-9]+)?|[^\W\d_]+|\S'
)
# The straight ones, the typographic ones of all languages, accents used as such, and
# the signs that open a Spanish exclamation or question.
QUOTES = frozenset('\'"`*_\u00ab\u00b4\u00bb\u2018\u2019\u201a\u201c\u201d\u201e\u00a1\u00bf')
MINUS = '\u2212'
NUMBER = re.compile(r'-?[0-9]+(?:\.[0-9]+)?')
# Between two numbers they make a range or something else that is no number: '2-3', '2 - 3'.
DASHES = frozenset('-\u2010\u2011\u2013\u2014\u2212~')
# What may be written at a number without a space and is no part of an identifier: '3m', '5pm'.
SUFFIXES = frozenset({'m', 'mm', 'cm', 'km', 'ft', 'yd', 'meter', 'metres', 'mal'})
SUFFIXES |= {'min', 'mins', 'sec', 'am', 'pm', 'uhr'}
# The longest letters before a number that make an identifier with it: 'B12', but not 'ward2'.
LONGEST_PREFIX = 2
NUMBER_SIGNS = frozenset('.,+/*')
# Numbers and signs that are written together, as `run_tag` gives them, to the last number.
RUN = re.compile(r'.[N.,](?:_[N.,+/*-]| -|(?<=-) [N.,+/*])+(?<=N)')
Value = TypeVar('Value')
END = ''


@dataclass(frozen=True)
class Word:
    """A word, a number or a sign: its comparable form and where it stands in the text.

    `said` is the word as it was written; `text` may be a correction of it.
    """

    text: str
    start: int
    end: int
    said: str = ''

    @property
    def is_number(self) -> bool:
        """Whether it is one number, written in digits; '2-3' is none."""
        return self.text[-1].isdigit() and NUMBER.fullmatch(self.text) is not None

    @property
    def is_corrected(self) -> bool:
        """Whether it was written otherwise."""
        return bool(self.said) and comparable(self.said) != self.text

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
    words = [
        Word(comparable(match[0]), match.start(), match.end(), match[0])
        for match in WORD.finditer(text)
        if match[0] not in QUOTES and match.lastgroup is None
    ]
    return with_identifiers(with_whole_numbers(words))


def with_identifiers(words: list[Word]) -> list[Word]:
    """Return words with '101a' and 'B12' as one word each, which is no number: a whole name."""
    result: list[Word] = []
    for word in words:
        before = result[-1] if result else None
        if before is not None and before.end == word.start and is_identifier(before, word):
            text = before.text + word.text
            result[-1] = Word(text, before.start, word.end, before.said + word.said)
        else:
            result.append(word)
    return result


def is_identifier(before: Word, word: Word) -> bool:
    """Whether two words that are written together are one identifier."""
    if word.is_letters:
        return before.text[-1].isdigit() and word.text not in SUFFIXES
    return before.is_letters and len(before.text) <= LONGEST_PREFIX and word.text[0].isdigit()


def with_whole_numbers(words: list[Word]) -> list[Word]:
    """Return words with '2-3', '1.5.2' and '.5' as one word each, which is no number.

    Two numbers with a comma between them stay: a point, a list, or a decimal comma.
    """
    result: list[Word] = []
    done = 0
    for match in RUN.finditer(''.join(map(run_tag, words, [None, *words]))):
        begin, end = match.start() // 2, match.end() // 2
        run = words[begin:end]
        if [word.text for word in run[1::2]] != [',']:
            text = ''.join(word.text for word in run)
            run = [Word(text, run[0].start, run[-1].end)]
        result += [*words[done:begin], *run]
        done = end
    return [*result, *words[done:]]


def run_tag(word: Word, before: Word | None) -> str:
    """Return two signs for a word: whether a space is before it, and what it is in a number."""
    gap = '_' if before is not None and before.end == word.start else ' '
    if word.is_number:
        return f'{gap}N'
    dash = '-' if word.text in DASHES else 'x'
    return gap + (word.text if word.text in NUMBER_SIGNS else dash)


def phrase_words(phrase: str) -> tuple[str, ...]:
    """Return the comparable words of a phrase."""
    if phrase.replace(' ', '').isalpha():  # nothing to divide, as in most of the vocabularies
        return tuple(map(comparable, phrase.split()))
    return tuple(word.text for word in read_words(phrase))


def squeezed(word: str) -> str:
    """Return a word with each doubled letter once: 'wal' and 'wall' are the same then."""
    return ''.join(letter for letter, _ in groupby(word))


def word_set(text: str) -> frozenset[str]:
    """Return the words of a text, divided by spaces, as a set."""
    return frozenset(text.split())


def errors_between(word: str, other: str) -> int:
    """Return how many letters were left out, added, changed or exchanged with the next one.

    No letter is changed twice: the optimal string alignment distance.
    """
    rows = [list(range(len(other) + 1))]
    for i, letter in enumerate(word, start=1):
        row = [i]
        for j, meant in enumerate(other, start=1):
            errors = min(rows[-1][j] + 1, row[-1] + 1, rows[-1][j - 1] + (letter != meant))
            if i > 1 and j > 1 and (letter, word[i - 2]) == (other[j - 2], meant):
                errors = min(errors, rows[-2][j - 2] + 1)
            row.append(errors)
        rows.append(row)
    return rows[-1][-1]


class Phrases(Generic[Value]):
    """Phrases (tuples of comparable words), each with the values that were added under it.

    It is a trie: to look for the longest phrase at a word takes as many steps as that phrase has
    words. `skipped` words, articles, may stand within a phrase without being part of it.
    """

    def __init__(self, skipped: Collection[str] = ()) -> None:
        """Start without phrases."""
        self.skipped = frozenset(skipped)
        self.words: set[str] = set()
        self._root: dict[str, Any] = {}

    def add(self, phrase: Sequence[str], value: Value) -> None:
        """Add a value under a phrase; the same value counts once."""
        node = self._root
        for word in phrase:
            node = node.setdefault(word, {})
            self.words.add(word)
        values = node.setdefault(END, [])
        if phrase and value not in values:
            values.append(value)

    @property
    def starts(self) -> frozenset[str]:
        """The first words of all phrases."""
        return frozenset(self._root)

    def longest(self, words: Sequence[Word], start: int) -> tuple[int, list[Value]]:
        """Return how many words the longest phrase at `start` takes, and its values."""
        node, best, values = self._root, 0, []
        for index in range(start, len(words)):
            text = words[index].text
            if text in node:
                node = node[text]
                if END in node:
                    best, values = index + 1 - start, node[END]
            elif index == start or text not in self.skipped:
                break
        return best, values

    def exactly(self, words: Sequence[str]) -> list[Value]:
        """Return the values of the phrase that words are, all of them."""
        count, values = self.longest([Word(word, 0, 0) for word in words], 0)
        return values if count == len(words) else []
