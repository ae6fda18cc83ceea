"""The words of a sentence, and what the shipped vocabulary knows of each."""

from __future__ import annotations

import json
import re
import unicodedata
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path

from rapidfuzz.distance import OSA

from llm_astar_planner.instructions.grammar.words import Phrases
from llm_astar_planner.instructions.regions import SIDES

WORDS_FILE = Path(__file__).with_name('words.json')
# Words that end a part of a sentence, besides punctuation.
BREAKS = frozenset('.;!?:()[]{}|\u2014\u2013,')
_TOKEN = re.compile(
    r'(?P<number>(?<![\w-])[-+]?(?:\d+(?:\.\d+)?|\.\d+))|(?P<digits>\d+(?:\.\d+)?)'
    r"|(?P<word>[^\W\d_]+(?:'[^\W\d_]+)*'?)|(?P<sign>[<>≤≥])|(?P<stop>[.;!?:()\[\]{}|\u2014\u2013,])"
)
_MARKS = str.maketrans({'\u2019': "'", '`': "'", '\u2212': '-'})
_ELISION = re.compile(r"(?:l|d|n|j|s|c|m|t|qu|jusqu|lorsqu|puisqu)'", re.IGNORECASE)

# Words of these classes are recognised where they are misspelt.
_CORRECTED = (
    ['verb', 'shun', 'negator', 'kinds.visit', 'order', 'strong.before', 'strong.after']
    + ['strong.way', 'articles', 'regions.half']
    + [f'sides.{side}' for side in SIDES]
)
# A phrase of the first class is none of the others: 'stop by' is no stop.
_OVERRIDES = {'strong.passing': {'strong.finish', 'strong.end_at'}}
MIN_SWAPPED = 3
MIN_MISSPELT = 5


def plain(text: str) -> str:
    """Return a text in lower case without accents, with straight apostrophes."""
    split = unicodedata.normalize('NFKD', text.translate(_MARKS).casefold())
    return ''.join(letter for letter in split if not unicodedata.combining(letter))


@dataclass
class Token:
    """A word, a number or a mark of a sentence; `text` is in plain form.

    `start` and `end` lie in the sentence. `labels` are the vocabulary's classes of the word.
    """

    text: str
    start: int
    end: int
    is_number: bool = False
    labels: set[str] = field(default_factory=set)

    @property
    def is_break(self) -> bool:
        """Whether it is punctuation."""
        return self.text in BREAKS

    @property
    def is_comma(self) -> bool:
        """Whether it is a comma."""
        return self.text == ','


def tokens_of(text: str) -> list[Token]:
    """Split a sentence into words, numbers and punctuation, in linear time."""
    # Letter by letter, since the plain form of some is longer: where in the sentence each lies.
    letters = [(part, at) for at, letter in enumerate(text) for part in plain(letter)]
    where = [at for _, at in letters] + [len(text)]
    found = raw_tokens(''.join(part for part, _ in letters))
    for token in found:
        if not is_known(token.text):
            token.text = token.text.removesuffix("'").removesuffix("'s")
        token.start, token.end = where[token.start], where[token.end - 1] + 1
    return found


def raw_tokens(flat: str) -> list[Token]:
    """Split a text in plain form; French elisions (l', d', qu') are words of their own."""
    found: list[Token] = []
    for match in _TOKEN.finditer(flat):
        word, start = match.group(), match.start()
        elided = _ELISION.match(word) if match.lastgroup == 'word' else None
        if elided and elided.end() < len(word):
            found.append(Token(elided.group(), start, start + elided.end()))
            word, start = word[elided.end() :], start + elided.end()
        is_number = match.lastgroup in ('number', 'digits')
        found.append(Token(word, start, match.end(), is_number))
    return found


@dataclass(frozen=True, eq=False)
class Vocabulary:
    """The shipped words: phrases by class, units and number words by their value."""

    classes: dict[str, Phrases[bool]]
    units: dict[str, float]
    numbers: dict[str, float]
    words: frozenset[str]
    correctable: dict[str, list[str]]


@cache
def vocabulary() -> Vocabulary:
    """Return the shipped vocabulary."""
    loaded = json.loads(WORDS_FILE.read_text(encoding='utf-8'))
    lists: dict[str, list[str]] = {
        name: value for name, value in loaded.items() if isinstance(value, list)
    }
    for group in ('kinds', 'regions', 'sides', 'compare', 'strong'):
        for name, value in loaded.get(group, {}).items():
            lists[f'{group}.{name}'] = value
    classes = {name: phrases_of(value) for name, value in lists.items()}
    tables = {
        group: {
            ' '.join(token.text for token in raw_tokens(plain(phrase))): float(value)
            for value, text in loaded[group].items()
            for phrase in text.split(',')
        }
        for group in ('units', 'numbers')
    }
    known = set().union(*(phrases.words for phrases in classes.values()))
    known.update(word for table in tables.values() for phrase in table for word in phrase.split())
    correctable: dict[str, list[str]] = {}
    for name in _CORRECTED:
        for word in sorted(classes[name].single_words):
            correctable.setdefault(word[0], []).append(word)
    return Vocabulary(
        classes,
        tables['units'],
        tables['numbers'],
        frozenset(known),
        defaultdict(list, correctable),
    )


def phrases_of(lists: Sequence[str]) -> Phrases[bool]:
    """Return the phrases of comma-separated lists."""
    phrases: Phrases[bool] = Phrases()
    for phrase in ', '.join(lists).split(', '):
        phrases.add([token.text for token in raw_tokens(plain(phrase))], True)
    return phrases


@cache
def words_of(name: str) -> frozenset[str]:
    """Return the single words of a class of the vocabulary."""
    return vocabulary().classes[name].single_words


def is_known(word: str) -> bool:
    """Return whether the vocabulary has a word."""
    return word in vocabulary().words


def label(tokens: Sequence[Token]) -> None:
    """Add to each token the classes of the vocabulary that it, or its phrase, belongs to."""
    for name, phrases in vocabulary().classes.items():
        index = 0
        while index < len(tokens):
            length, _ = phrases.longest(tokens, index)
            for token in tokens[index : index + length]:
                token.labels.add(name)
            index += max(1, length)
    for token in tokens:
        for name, others in _OVERRIDES.items():
            if name in token.labels:
                token.labels -= others


def correct(tokens: Sequence[Token], taken: set[int]) -> None:
    """Give misspelt words, which no class has, the classes of the word that was meant."""
    for index, token in enumerate(tokens):
        if token.labels or index in taken or token.is_number or token.is_break:
            continue
        meant = nearest_word(token.text)
        if meant:
            token.text = meant
            classes = vocabulary().classes.items()
            token.labels |= {name for name, phrases in classes if meant in phrases.single_words}


@lru_cache(maxsize=4096)
def nearest_word(word: str) -> str:
    """Return the word of the vocabulary that a misspelt one stands for, '' if none is near.

    Letters may be swapped in any word, and one may be wrong in those of five letters and more.
    """
    if len(word) < MIN_SWAPPED:
        return ''
    known = vocabulary().correctable
    close = [other for other in known[word[0]] if abs(len(other) - len(word)) <= 1]
    for other in close:
        if OSA.distance(word, other, score_cutoff=1) > 1:
            continue
        if sorted(other) == sorted(word) or min(len(word), len(other)) >= MIN_MISSPELT:
            return other
    return ''
