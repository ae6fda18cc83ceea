"""What places are called in four languages: 'kitchen', 'Küche', 'cuisine', 'cocina'."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from llm_astar_planner.instructions.grammar.phrases import Phrases
from llm_astar_planner.instructions.grammar.vocabulary import LANGUAGES, read_table
from llm_astar_planner.instructions.grammar.words import phrase_words

COLOURS = 'colours'
VOWELS = frozenset('aeiou')


@dataclass(frozen=True)
class Noun:
    """A noun of the table: what it names, in which number it stands.

    `generic` is the wider word that covers it: 'room' of a kitchen, its own of 'room'.
    """

    name: str
    generic: str
    plural: bool
    language: str


@dataclass(frozen=True, eq=False)
class Nouns:
    """The table: phrases by language, all phrases, the words of each noun, and colours."""

    by_language: dict[str, Phrases[Noun]]
    everywhere: Phrases[Noun]
    # Words of a noun in a language: (singular, plural).
    words: dict[tuple[str, str], list[tuple[str, ...]]]
    generic: dict[str, str]
    colours: dict[str, str]


def plurals(phrase: tuple[str, ...], language: str) -> tuple[str, ...]:
    """Return the usual plural of a phrase: its last word in English, its first one elsewhere."""
    at = len(phrase) - 1 if language in ('en', 'de') else 0
    word = phrase[at]
    if word.endswith(('s', 'x', 'z')):
        ending = 'es' if language == 'en' else ''
    elif word.endswith('eau'):
        ending = 'x'
    else:
        consonant = language == 'es' and word[-1] not in VOWELS
        ending = 'es' if consonant or word.endswith(('ch', 'sh')) else 's'
    return (*phrase[:at], word + ending, *phrase[at + 1 :])


@cache
def nouns() -> Nouns:
    """Return the table of nouns, read once."""
    table = read_table('nouns')
    colours = {
        phrase_words(word)[0]: colour
        for colour, words in table.pop(COLOURS).items()
        for word in words
    }
    read = Nouns({language: Phrases() for language in LANGUAGES}, Phrases(), {}, {}, colours)
    for name, entry in table.items():
        read.generic[name] = entry.get('is', name)
        for language in LANGUAGES:
            add_noun(read, name, language, entry.get(language, ()))
    return read


def add_noun(read: Nouns, name: str, language: str, words: list[str]) -> None:
    """Add the words of a noun in a language, 'singular/plural' each."""
    singulars = read.words.setdefault((name, language), [])
    for word in words:
        singular, _, plural = word.partition('/')
        one = phrase_words(singular)
        many = phrase_words(plural) if plural else plurals(one, language)
        singulars.append(one)
        for phrase, is_plural in forms(one, many, language):
            noun = Noun(name, read.generic[name], is_plural, language)
            read.by_language[language].add(phrase, noun)
            read.everywhere.add(phrase, noun)


def forms(
    one: tuple[str, ...], many: tuple[str, ...], language: str
) -> list[tuple[tuple[str, ...], bool]]:
    """Return the forms of a noun, each with whether it is a plural: German has cases."""
    if language != 'de':
        return [(one, False), (many, True)]
    genitive = (*one[:-1], f'{one[-1]}s')
    dative = (*many[:-1], many[-1] if many[-1][-1] in 'ns' else f'{many[-1]}n')
    return [(one, False), (many, True), (genitive, False), (dative, True)]
