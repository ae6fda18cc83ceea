# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The words for a map's places: names, aliases, their translations, kinds and tags."""

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from llm_astar_msgs_adapter.maps.places import Place, Places

from llm_astar_planner.instructions.grammar.spoken import NUMBER_WORDS, NUMBERS
from llm_astar_planner.instructions.grammar.vocabulary import LANGUAGES, Noun, nouns, vocabulary
from llm_astar_planner.instructions.grammar.words import Phrases, comparable, phrase_words

AREA, WALL = 'area', 'wall'
# Words that may stand before the number of a place.
BEFORE_NUMBERS = ('number', 'nummer', 'numero')
OBJECT, PASSAGE, ROOM, PLACE = 'object', 'passage', 'room', 'place'
Members = tuple[Place, ...]
# Of a place without a noun in its name, kind and tags.
UNNAMED = 'unnamed'
# How a map itself has a word for places: as kind or tag, or at the end of names.
KIND, HEAD = 'kind', 'head'


@dataclass(frozen=True)
class Group:
    """Places that one word may mean: 'room', 'doors', 'blue'.

    - `all_places`: all places of the map.
    - `tag`: where the words name a kind or tag ('all blue places').
    - `noun`: the noun of the table, '' if it is none.
    - `own`: how the map itself has the word, KIND or HEAD; '' for a synonym or wider word.
    """

    words: str
    all_places: Places
    places: tuple[Place, ...]
    plural: bool
    tag: str = ''
    noun: str = ''
    own: str = KIND


class Lexicon:
    """The words for the places of a map.

    - `names`: names and aliases; `near_names`: their translations and other number, each with
      whether it is a sure one, no synonym.
    - `tags`: kinds and tags that are no nouns, as adjectives ('blue').
    - `members`: by the name of a noun, the places that it may mean; `partial`: the nouns that
      only end an alias of these ('desk' of 'front desk'), so that nobody knows.
    - `spellings`: the words that a misspelt one is compared with.
    - `starts`: the words that any of the phrases begin with.
    """

    def __init__(self, places: Places) -> None:
        """Find the words for some places."""
        self.places = places
        self.names: Phrases[Place] = Phrases(articles())
        self.near_names: Phrases[tuple[Place, bool]] = Phrases(articles())
        self.tags: Phrases[str] = Phrases()
        self.tag_groups: Phrases[str] = Phrases()
        for place in places:
            for words in map(phrase_words, (place.name, *place.aliases)):
                # The last word of 'rack A' is no article.
                inner = [word for word in words[:-1] if word not in articles()]
                self.names.add(words, place)
                self.names.add((*inner, *words[-1:]), place)
                for said in numbered(words):
                    self.names.add(said, place)
                for variant, is_sure in variants(words):
                    for said in (variant, *numbered(variant)):
                        self.near_names.add(said, (place, is_sure))
        for tag in places.tags:
            add_tag(tag, self.tags, self.tag_groups)
        languages = name_languages(places)
        nouns_of = {place.name: own_nouns(place, languages) for place in places}
        called = frozenset().union(*nouns_of.values())
        # What only ends an alias counts where the map has nothing else of it.
        ends_of = {place.name: alias_nouns(place, languages) - called for place in places}
        self.partial = frozenset().union(*ends_of.values())
        all_nouns = {name: nouns_of[name] | ends_of[name] for name in nouns_of}
        self.members = members_of(places, all_nouns)
        known = (self.names, self.near_names, self.tags, self.tag_groups)
        self.starts = frozenset().union(*(phrases.starts for phrases in known))
        spelt = self.names.words | self.near_names.words | self.tags.words
        self.spellings = frozenset(w for w in spelt if w.isalpha() and w not in NUMBERS)

    def group(self, noun: Noun, words: str) -> Group:
        """Return the places that a noun may mean."""
        places = self.kind_of(noun, words) or self.members[noun.name]
        own = {own_word(place, noun) for place in places}
        least = next((one for one in ('', HEAD, KIND) if one in own), KIND)
        if noun.name in self.partial and len(places) > 1:
            least = ''
        return Group(words, self.places, places, noun.plural, '', noun.name, least)

    def kind_of(self, noun: Noun, words: str) -> Members:
        """Return the places of the kind or tag that is a noun, if said so or all it may mean."""
        members = set(self.members[noun.name])
        for tag in self.places.tags if members else ():
            places = self.places.with_tag(tag)
            is_said = noun.plural and words == ' '.join(phrase_words(tag))
            if says(phrase_words(tag), noun) and (is_said or members <= set(places)):
                return places
        return ()


def members_of(places: Places, nouns_of: Mapping[str, frozenset[str]]) -> dict[str, Members]:
    """Return, by the name of a noun, the places that it may mean."""
    generics = {place.name: generic_of(place, nouns_of[place.name]) for place in places}
    found: dict[str, Members] = {}
    for name, generic in nouns().generic.items():
        meant = tuple(place for place in places if name in nouns_of[place.name])
        if name == PLACE:
            meant = places.places
        elif name == generic:
            covered = (generic, UNNAMED) if name == ROOM else (generic,)
            meant = tuple(place for place in places if generics[place.name] in covered)
        elif not meant and generic == PASSAGE:
            meant = tuple(place for place in places if generics[place.name] == PASSAGE)
        found[name] = meant
    return found


@lru_cache(maxsize=16)
def lexicon(places: Places) -> Lexicon:
    """Return the words for a map's places, made once for each `Places`."""
    return Lexicon(places)


@lru_cache(maxsize=1)
def articles() -> frozenset[str]:
    """Return the articles of all languages, which may stand within a name."""
    tables = [vocabulary(language) for language in LANGUAGES]
    return frozenset().union(*(table.articles | table.any_articles for table in tables))


def numbered(name: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield a name that ends with a number as people say it: 'ward two', 'ward number 2'."""
    number = name[-1] if len(name) > 1 else ''
    if number.isdecimal() and int(number) in NUMBER_WORDS:
        for said in (number, *NUMBER_WORDS[int(number)]):
            yield (*name[:-1], said)
            yield from ((*name[:-1], before, said) for before in BEFORE_NUMBERS)


def add_tag(tag: str, tags: Phrases[str], groups: Phrases[str]) -> None:
    """Add the words for a kind or tag: as an adjective, and as '<tag> places'."""
    words = phrase_words(tag)
    for places in ('places', 'place'):
        groups.add((*words, places), tag)
    if tag.casefold() in (AREA, PLACE):
        return
    colour = nouns().colours.get(words[0]) if len(words) == 1 else None
    for word, other in nouns().colours.items() if colour else ():
        if other == colour:
            tags.add((word,), tag)
            for coloured in nouns().coloured:
                tags.add((word, coloured), tag)
    count, _ = nouns().everywhere.longest(words, 0)
    if count < len(words):
        tags.add(words, tag)
        groups.add((*words[:-1], words[-1] + 's'), tag)


def head_of(words: tuple[str, ...]) -> tuple[str, ...]:
    """Return the words of a name up to its first preposition and without its identifier."""
    prepositions = nouns().prepositions
    end = next((n for n, word in enumerate(words) if n and word in prepositions), len(words))
    while end > 1 and (len(words[end - 1]) == 1 or not words[end - 1].isalpha()):
        end -= 1
    return words[:end]


def head_nouns(
    words: tuple[str, ...], languages: Collection[str] = LANGUAGES, is_whole: bool = False
) -> frozenset[str]:
    """Return the nouns that the head of a name ends with, or is: the longest phrase decides.

    The last word of a longer name is read in the languages of the map's names alone: 'fuel
    station' is no ward, which is 'Station' in German.
    """
    head = head_of(words)
    for start in range(1 if is_whole else len(head)):
        found = nouns().everywhere.exactly(head[start:])
        if found:
            return frozenset(one.name for one in found if start == 0 or one.language in languages)
    return frozenset()


def generic_of(place: Place, called: Collection[str] | None = None) -> str:
    """Return the generic word for a place that is called by some nouns, else by its own."""
    if place.is_object:
        return OBJECT
    called = (own_nouns(place) or alias_nouns(place)) if called is None else called
    return nouns().generic[min(called)] if called else UNNAMED


def name_languages(places: Places) -> tuple[str, ...]:
    """Return the languages that most names of a map are in."""
    counts = dict.fromkeys(LANGUAGES, 0)
    for place in places:
        head = head_of(phrase_words(place.name))
        for language, phrases in nouns().by_language.items():
            ends = (at for at in range(len(head)) if phrases.exactly(head[at:]))
            # A noun that is the whole name tells more than one that ends it.
            counts[language] += next((1 if at else 2 for at in ends), 0)
    return tuple(language for language in LANGUAGES if counts[language] == max(counts.values()))


def own_nouns(place: Place, languages: Collection[str] = LANGUAGES) -> frozenset[str]:
    """Return the nouns of a place's name, kind and tags, and those that are whole aliases."""
    kinds = [kind for kind in (place.kind, *place.tags) if kind not in (AREA, PLACE)]
    heads = [head_nouns(phrase_words(text), languages) for text in (place.name, *kinds)]
    wholes = [head_nouns(phrase_words(text), languages, True) for text in place.aliases]
    return frozenset().union(*heads, *wholes)


def alias_nouns(place: Place, languages: Collection[str] = LANGUAGES) -> frozenset[str]:
    """Return the nouns that the aliases of a place end with: 'desk' of 'front desk'."""
    ends = (head_nouns(phrase_words(text), languages) for text in place.aliases)
    return frozenset().union(*ends)


@lru_cache(maxsize=1024)
def sides_in(*names: str) -> frozenset[str]:
    """Return the sides that names hold: 'north' of 'north aisle'."""
    words = {word for name in names for word in phrase_words(name)}
    return frozenset(
        value or 'center'
        for word, language in itertools.product(words, LANGUAGES)
        for (kind, value), *_ in vocabulary(language).phrases.exactly([word])
        if kind in ('SIDE', 'CENTER')
    )


def common_tag(group: Group, found: Sequence[Place], wanted: Sequence[str], is_told: bool) -> str:
    """Return the kind or tag that means exactly the places found, '' if there is none.

    One of the `wanted` or one that is the group's noun; any other unless `is_told`.
    """
    places, names = group.all_places, {place.name for place in found}
    exact = [tag for tag in places.tags if {one.name for one in places.with_tag(tag)} == names]
    said = [tag for tag in exact if tag in wanted or group.noun in head_nouns(phrase_words(tag))]
    return (said or ([] if is_told else exact) or [''])[0]


@lru_cache(maxsize=4096)
def own_word(place: Place, noun: Noun) -> str:
    """Return how a place has the word of a noun itself, or its usual translation."""
    kinds = (place.kind, *place.tags, *place.aliases, place.name)
    if noun.name == PLACE or any(says(phrase_words(text), noun) for text in kinds):
        return KIND
    heads = [head_of(phrase_words(text)) for text in (place.name, *place.aliases)]
    ends = (words[at:] for words in heads for at in range(len(words)))
    return HEAD if any(says(words, noun) for words in ends) else ''


def says(words: tuple[str, ...], noun: Noun) -> bool:
    """Whether words, all of them, are a noun itself or its usual translation, in any number."""
    found = nouns().everywhere.exactly(words)
    return any(one.name == noun.name and is_same(one, noun) for one in found)


def is_same(one: Noun, other: Noun) -> bool:
    """Whether a noun is another one, or its translation: of two languages one is the main word."""
    return one.word == other.word or (
        one.language != other.language and (one.is_main or other.is_main)
    )


def variants(words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], bool]]:
    """Yield other ways to say a name: number, translations, 'door of the kitchen'.

    Each with whether it is a sure one: a synonym is not.
    """
    last = words[-1]
    if last.isalpha() and len(last) > 2:
        other = last.removesuffix('s') if last.endswith('s') else f'{last}s'
        yield (*words[:-1], other), True
    if '=' in words:
        at = words.index('=')
        yield words[:at] + words[at + 1 :], True
        yield (*words[: at - 1], 'at', *words[at - 1 :]), True
    for translation in translated(words):
        yield translation, not is_synonym(words, translation)


def is_synonym(words: tuple[str, ...], other: tuple[str, ...]) -> bool:
    """Whether the first noun of a name is said by a word that is not the usual one for it."""
    found = [nouns().everywhere.longest(phrase, 0)[1] for phrase in (words, other)]
    pairs = [(one, other) for one in found[0] for other in found[1] if one.name == other.name]
    return bool(pairs) and not any(is_same(one, other) for one, other in pairs)


def translated(words: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield the translations of 'rack A' (noun and identifier) and 'kitchen door' (two nouns)."""
    count, first = nouns().everywhere.longest(words, 0)
    if not count or count == len(words):
        return
    rest = words[count:]
    if len(rest) == 1 and (len(rest[0]) == 1 or not rest[0].isalpha()):
        for noun, language in itertools.product(first, LANGUAGES):
            for phrase in nouns().words[noun.name, language]:
                yield (*phrase, *rest)
    more, second = nouns().everywhere.longest(words, count)
    if more == len(rest):
        yield from compounds(first, second)


def compounds(first: list[Noun], second: list[Noun]) -> Iterator[tuple[str, ...]]:
    """Yield 'door of kitchen', 'Küchentür', 'porte de cuisine' of 'kitchen' and 'door'."""
    words = nouns().words
    for one, two, language in itertools.product(first, second, LANGUAGES):
        for a, b in itertools.product(words[one.name, language], words[two.name, language]):
            if language == 'en':
                yield (*b, 'of', *a)
                yield (*b, 'to', *a)
            elif language == 'de':
                yield from (
                    (*a[:-1], a[-1] + joint + comparable(b[0]), *b[1:]) for joint in ('', 'n', 's')
                )
            else:
                yield (*b, 'de', *a)
