"""Finds the places that words of a sentence name: exactly, misspelt, in part, or by position."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.grammar.lexicon import lexicon, translated
from llm_astar_planner.instructions.grammar.nouns import nouns
from llm_astar_planner.instructions.grammar.words import Word, phrase_words
from llm_astar_planner.instructions.model.descriptions import described
from llm_astar_planner.instructions.model.spelling import same_word, stem
from llm_astar_planner.instructions.model.vocabulary import Token, is_known, tokens_of, words_of

MIN_NOUN = 3


class Match(NamedTuple):
    """Words that name places (`names`, several if they fit several) or a tag."""

    tokens: tuple[int, ...]
    names: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    is_plural: bool = False


@dataclass(frozen=True)
class Form:
    """One way to write a name: its words in plain form, and what it names."""

    words: tuple[str, ...]
    name: str = ''
    tag: str = ''


@dataclass(frozen=True, eq=False)
class NameIndex:
    """The names and tags of a map's places, to be found by their words.

    - `by_first`: the forms by their first word; `joined`: by all their words written as one.
    - `words`: all words of forms, by their first letter.
    - `places_with`: the names of the places that a word of a form may mean.
    """

    by_first: dict[str, list[Form]]
    joined: dict[str, list[Form]]
    words: dict[str, set[str]]
    places_with: dict[str, set[str]]


@lru_cache(maxsize=16)
def name_index(places: Places) -> NameIndex:
    """Return the index of a map's places, made once for each `Places`."""
    index = NameIndex({}, {}, {}, {})
    for form in forms_of(places):
        index.by_first.setdefault(form.words[0], []).append(form)
        index.joined.setdefault(stem(''.join(form.words)), []).append(form)
        meant = [form.name] if form.name else [p.name for p in places.with_tag(form.tag)]
        for word in form.words:
            index.words.setdefault(word[0], set()).add(word)
            index.places_with.setdefault(word, set()).update(meant)
    return index


class NameFinder:
    """Finds the names of a map's places in the words of one sentence."""

    def __init__(self, places: Places, tokens: Sequence[Token]) -> None:
        """Compare each word of the sentence with the words of the names, once."""
        self._places = places
        self._tokens = tokens
        self._index = name_index(places)
        self._words = [Word(token.text.strip("'"), token.start, token.end) for token in tokens]
        self._alike = {
            word: {known for known in self._index.words.get(word[0], ()) if same_word(word, known)}
            for word in {token.text for token in tokens}
        }

    def match_at(self, index: int) -> Match | None:
        """Return what the words from `index` on name, None for nothing."""
        whole = self._whole_name(index)
        if whole is not None and not whole.tags:
            return whole
        has_next = whole is not None and index + 1 < len(self._tokens)
        following = self._noun(index + 1) if has_next else None
        if following is not None and index in following.tokens:
            return following
        described = self._noun(index)
        if described is not None and (whole is None or len(described.tokens) > 1):
            return described
        return whole

    def _whole_name(self, index: int) -> Match | None:
        """Return the longest whole name at a word; names before tags."""
        best: dict[Form, tuple[int, ...]] = {}
        for known in self._alike[self._tokens[index].text]:
            for form in self._index.by_first.get(known, ()):
                tokens = self._match_form(form, index)
                if tokens:
                    best[form] = tokens
        for count in (1, 2, 3):
            words = self._tokens[index : index + count]
            if any(token.is_break or token.is_number for token in words):
                break
            for form in self._index.joined.get(stem(''.join(token.text for token in words)), ()):
                best.setdefault(form, tuple(range(index, index + len(words))))
        if not best:
            return None
        longest = max(len(form.words) for form in best)
        forms = [form for form in best if len(form.words) == longest]
        exact = [f for f in forms if f.words == tuple(self._tokens[i].text for i in best[f])]
        forms = exact or forms
        names = tuple(dict.fromkeys(form.name for form in forms if form.name))
        tags = () if names else tuple(dict.fromkeys(form.tag for form in forms if form.tag))
        if not tags:
            return Match(best[forms[0]], names)
        names = tuple(place.name for place in self._places.with_tag(tags[0]))
        last = self._tokens[best[forms[0]][-1]].text
        return Match(best[forms[0]], names, tags, is_plural=last != forms[0].words[-1])

    def _match_form(self, form: Form, index: int) -> tuple[int, ...]:
        """Return the positions of the words of a form from `index` on, () if they differ."""
        positions = [index]
        for word in form.words[1:]:
            at = positions[-1] + 1
            while len(word) > 1 and self._may_skip(at, word):
                at += 1
            if at >= len(self._tokens) or word not in self._alike[self._tokens[at].text]:
                return ()
            positions.append(at)
        return tuple(range(index, positions[-1] + 1))

    def _may_skip(self, at: int, word: str) -> bool:
        """Return whether a word of the sentence is an article before the word of a name."""
        if at >= len(self._tokens) or word in self._alike[self._tokens[at].text]:
            return False
        return self._tokens[at].text in words_of('articles')

    def _noun(self, index: int) -> Match | None:
        """Return the places that a noun fits, as far as the words around it tell.

        The noun is one of the grammar's table, in any language, or a part of names or tags.
        """
        token = self._tokens[index]
        if token.is_number or len(token.text) < MIN_NOUN or token.text in words_of('articles'):
            return None
        noun = self._noun_of_table(index) or self._noun_of_names(index)
        if noun is None or self._has_other_number(noun.tokens[-1]):
            return None
        fitting = [place for place in self._places if place.name in noun.names]
        chosen, used = described(self._tokens, noun.tokens, fitting)
        if not chosen or ('regions.walls' in token.labels and len(chosen) > 1):
            return None
        names = tuple(place.name for place in chosen)
        return noun._replace(tokens=tuple(sorted({*noun.tokens, *used})), names=names)

    def _noun_of_table(self, index: int) -> Match | None:
        count, found = nouns().everywhere.longest(self._words, index)
        if not found:
            return None
        groups = [lexicon(self._places).group(noun, '') for noun in found]
        names = dict.fromkeys(place.name for group in groups for place in group.places)
        if not names:
            return None
        plural = all(noun.plural for noun in found)
        return Match(tuple(range(index, index + count)), tuple(names), is_plural=plural)

    def _noun_of_names(self, index: int) -> Match | None:
        word = self._tokens[index].text
        if is_known(word):
            return None
        known = [self._index.places_with[name] for name in self._alike[word]]
        names = tuple(sorted(set().union(*known)))
        is_plural = stem(word) != word and word not in self._alike[word]
        return Match((index,), names, is_plural=is_plural) if names else None

    def _has_other_number(self, index: int) -> bool:
        """Return whether a letter or number follows that belongs to another name ('hall B')."""
        following = self._tokens[index + 1 : index + 2]
        if not following:
            return False
        token = following[0]
        is_letter = len(token.text) == 1 and token.text.isalpha()
        return is_letter and not (token.labels - {'numbers'} or token.text in words_of('articles'))


def forms_of(places: Places) -> Iterable[Form]:
    """Return all ways to write the names, aliases, kinds and tags of places."""
    for place in places:
        for name in (place.name, *place.aliases):
            words = name_words(name)
            if words:
                yield Form(words, name=place.name)
            for other in translated(phrase_words(name)):
                yield Form(name_words(' '.join(other)), name=place.name)
    for tag in places.tags:
        words = name_words(tag)
        if words and tag != 'object':
            yield Form(words, tag=tag)


def name_words(name: str) -> tuple[str, ...]:
    """Return the words of a name in plain form, without articles but for its last word."""
    words = [token.text for token in tokens_of(name) if not token.is_break]
    return tuple(
        w for n, w in enumerate(words) if w not in words_of('articles') or n == len(words) - 1
    )
