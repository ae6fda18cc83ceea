# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The words of each language, read from the tables in `vocabulary/`."""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import yaml
from llm_astar_msgs_adapter.maps.places import Places, PlacesError

from llm_astar_planner.instructions.grammar.words import Phrases, comparable, phrase_words

FOLDER = Path(__file__).with_name('vocabulary')
LANGUAGES = ('en', 'de', 'fr', 'es')

# One or more lexemes: the kind and the value of each.
Meaning = tuple[tuple[str, str], ...]


def read_table(name: str) -> dict[str, Any]:
    """Return a table of `vocabulary/` by its name without suffix."""
    loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
    text = (FOLDER / f'{name}.yaml').read_text(encoding='utf-8')
    table: dict[str, Any] = yaml.load(text, Loader=loader)  # noqa: S506 (a safe loader)
    return table


class KindSets(SimpleNamespace):
    """Sets of kinds of words, as attributes: those of `vocabulary/kinds.yaml`."""

    def __getattr__(self, name: str) -> frozenset[str]:
        """Refuse a name that the table lacks."""
        raise AttributeError(f'kinds.yaml has no set {name!r}')


KINDS = KindSets(**{name: frozenset(text.split()) for name, text in read_table('kinds').items()})
# Words in a text as it was said.
SAID = {
    name: re.compile('|'.join(one) if isinstance(one, list) else one)
    for name, one in read_table('patterns').items()
}


def expand(phrase: str) -> Iterator[tuple[str, ...]]:
    """Yield what a phrase of a table stands for: 'a/b' are alternatives, 'c?' may be absent."""
    choices = []
    for part in phrase.split():
        options = part.removesuffix('?').split('/')
        choices.append(options + [''] if part.endswith('?') else options)
    for words in itertools.product(*choices):
        yield phrase_words(' '.join(words))


class Vocabulary:
    """The words of one language.

    - `phrases`: what each phrase means, in the order of the table where it means several things.
    - `articles`: words that are left out; `any_articles`: those that mean any one ('a').
    - `demonstratives`: articles of what was named before ('those').
    - `irrelevant`: phrases that say nothing about the route.
    - `questions`: what is asked where something is not certain, with `{said}` and `{meant}`.
    """

    def __init__(self, language: str) -> None:
        """Read the table of a language."""
        table = read_table(language)
        self.language = language
        self.questions: dict[str, str] = table.pop('QUESTIONS')
        phrases = {
            key: [phrase.strip() for phrase in str(text).split(',') if phrase.strip()]
            for key, text in table.items()
        }
        self.any_articles, self.demonstratives, others = (
            frozenset(map(comparable, phrases.pop(key)))
            for key in ('ANY_ARTICLE', 'DEMONSTRATIVES', 'ARTICLES')
        )
        self.articles = others | self.demonstratives
        self.phrases: Phrases[Meaning] = Phrases(self.articles | self.any_articles)
        self.irrelevant: Phrases[str] = Phrases(self.articles | self.any_articles)
        for phrase in phrases.pop('IRRELEVANT'):
            self.irrelevant.add(phrase_words(phrase), phrase)
        for key, texts in phrases.items():
            # 'SIDE=north SIDENOUN' are two lexemes.
            parts = (part.partition('=') for part in key.split())
            meaning = tuple((kind, value) for kind, _, value in parts)
            for words in itertools.chain.from_iterable(map(expand, texts)):
                self.phrases.add(words, meaning)

    def knows(self, word: str) -> bool:
        """Whether a word is in this language's table."""
        return word in self.phrases.words or word in self.articles or word in self.irrelevant.words


@cache
def vocabulary(language: str) -> Vocabulary:
    """Return the words of a language, read once."""
    return Vocabulary(language)


@dataclass(frozen=True)
class Noun:
    """A noun of the table: what it names, in which number it stands.

    `generic` is the wider word that covers it: 'room' of a kitchen, its own of 'room'. `word` is
    its singular; `is_main` for the first word of its language, not one of the synonyms.
    """

    name: str
    generic: str
    plural: bool
    language: str
    word: tuple[str, ...] = ()
    is_main: bool = False


class Nouns:
    """The table: phrases by language, all phrases, the words of each noun, and colours.

    `prepositions` are what a name goes on with after its noun, `coloured` what a colour does.

    `words` of a noun in a language are its singulars; `generic` the wider word of each.
    """

    def __init__(self) -> None:
        """Read the table."""
        table = read_table('nouns')
        self.prepositions = frozenset(table.pop('prepositions').split())
        self.coloured = tuple(table.pop('coloured').split())
        self.colours = {
            phrase_words(word)[0]: colour
            for colour, words in table.pop('colours').items()
            for word in words
        }
        self.by_language: dict[str, Phrases[Noun]] = {one: Phrases() for one in LANGUAGES}
        self.everywhere: Phrases[Noun] = Phrases()
        self.words: dict[tuple[str, str], list[tuple[str, ...]]] = {}
        self.generic = {name: entry.get('is', name) for name, entry in table.items()}
        for name, language in itertools.product(table, LANGUAGES):
            self.words[name, language] = []
            for word in table[name].get(language, ()):
                self.add(name, language, *word.split('/'))

    def add(self, name: str, language: str, singular: str, plural: str = '') -> None:
        """Add a word of a noun in a language; the first one is the main word."""
        singulars, one = self.words[name, language], phrase_words(singular)
        many = phrase_words(plural) if plural else plurals(one, language)
        for phrase, is_plural in forms(one, many, language):
            noun = Noun(name, self.generic[name], is_plural, language, one, not singulars)
            self.by_language[language].add(phrase, noun)
            self.everywhere.add(phrase, noun)
        singulars.append(one)


@cache
def nouns() -> Nouns:
    """Return the table of nouns, read once."""
    return Nouns()


def plurals(phrase: tuple[str, ...], language: str) -> tuple[str, ...]:
    """Return a phrase with an s at its last word in English, at its first one elsewhere."""
    at = len(phrase) - 1 if language in ('en', 'de') else 0
    return (*phrase[:at], f'{phrase[at]}s', *phrase[at + 1 :])


def forms(
    one: tuple[str, ...], many: tuple[str, ...], language: str
) -> list[tuple[tuple[str, ...], bool]]:
    """Return the forms of a noun, each with whether it is a plural: German has cases."""
    if language != 'de':
        return [(one, False), (many, True)]
    genitive = (*one[:-1], f'{one[-1]}s')
    dative = (*many[:-1], many[-1] if many[-1][-1] in 'ns' else f'{many[-1]}n')
    return [(one, False), (many, True), (genitive, False), (dative, True)]


def check_names(places: Places, source: str) -> Places:
    """Return the places. Raises PlacesError for a name that an instruction means otherwise."""
    for name in (name for place in places for name in (place.name, *place.aliases)):
        if means_otherwise(name):
            why = 'is a word that instructions are made of, so none could name the place'
            raise PlacesError(f'{source}: place {name!r}: {why}; call it otherwise')
    return places


def means_otherwise(name: str) -> bool:
    """Tell whether a name is an article, or nothing but a word of NO_NAMES, in any language.

    One letter is a name: 'A' may be a gate.
    """
    words = phrase_words(name) if len(name) > 1 else ()
    for known in map(vocabulary, LANGUAGES):
        kinds = {meaning[0][0] for meaning in known.phrases.exactly(words)}
        is_article = len(words) == 1 and words[0] in known.articles | known.any_articles
        if is_article or kinds & KINDS.no_names:
            return True
    return False
