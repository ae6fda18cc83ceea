"""Finds the places that words of a sentence name: exactly, misspelt, in part, or by position."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from llm_astar_msgs_adapter.maps.places import Place, Places
from rapidfuzz.distance import OSA

from llm_astar_planner.instructions.model.vocabulary import (
    Token,
    is_known,
    tokens_of,
    words_of,
)
from llm_astar_planner.instructions.specification import COMPASS

ENDINGS = ('es', 'en', 's', 'n', 'e')
MIN_STEM = 4
MIN_MISSPELT = 5
# From this many letters on, two of them may be wrong, else one.
LONG_WORD = 8
# A place this many times longer than wide is called horizontal or vertical.
ELONGATED = 3.0
# Words between a noun and the words that say which one.
REACH = 4
# Of the extent of the places: how much farther to a side the one that is meant must lie.
CLEAR_SHARE = 0.05


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


class NameFinder:
    """Finds the names of a map's places in the words of one sentence."""

    def __init__(self, places: Places, tokens: Sequence[Token]) -> None:
        """Compare each word of the names with each word of the sentence, once."""
        self._places = places
        self._tokens = tokens
        self._forms = list(forms_of(places))
        vocabulary = {word for form in self._forms for word in form.words}
        self._alike = {
            word: {known for known in vocabulary if same_word(word, known)}
            for word in {token.text for token in tokens}
        }
        self._by_first: dict[str, list[Form]] = {}
        for form in self._forms:
            self._by_first.setdefault(form.words[0], []).append(form)
        self._joined: dict[str, list[Form]] = {}
        for form in self._forms:
            self._joined.setdefault(stem(''.join(form.words)), []).append(form)
        self._places_with: dict[str, set[str]] = {}
        for form in self._forms:
            for word in form.words:
                self._places_with.setdefault(word, set()).update(self._meant(form))

    def match_at(self, index: int) -> Match | None:
        """Return what the words from `index` on name, None for nothing."""
        whole = self._whole_name(index)
        if whole is not None and not whole.tags:
            return whole
        described = self._part_of_name(index)
        if described is not None and (whole is None or len(described.tokens) > 1):
            return described
        has_next = whole is not None and index + 1 < len(self._tokens)
        following = self._part_of_name(index + 1) if has_next else None
        if following is not None and index in following.tokens:
            return following
        return whole

    def _meant(self, form: Form) -> set[str]:
        if form.name:
            return {form.name}
        return {place.name for place in self._places.with_tag(form.tag)}

    def _whole_name(self, index: int) -> Match | None:
        """Return the longest whole name at a word; names before tags."""
        best: dict[Form, tuple[int, ...]] = {}
        for known in self._alike[self._tokens[index].text]:
            for form in self._by_first.get(known, ()):
                tokens = self._match_form(form, index)
                if tokens:
                    best[form] = tokens
        for count in (1, 2, 3):
            words = self._tokens[index : index + count]
            if any(token.is_break or token.is_number for token in words):
                break
            for form in self._joined.get(stem(''.join(token.text for token in words)), ()):
                best.setdefault(form, tuple(range(index, index + len(words))))
        if not best:
            return None
        longest = max(len(form.words) for form in best)
        forms = [form for form in best if len(form.words) == longest]
        exact = [f for f in forms if f.words == tuple(self._tokens[i].text for i in best[f])]
        forms = exact or forms
        names = tuple(dict.fromkeys(form.name for form in forms if form.name))
        tags = () if names else tuple(dict.fromkeys(form.tag for form in forms if form.tag))
        if tags:
            names = tuple(place.name for place in self._places.with_tag(tags[0]))
        return Match(best[forms[0]], names, tags)

    def _match_form(self, form: Form, index: int) -> tuple[int, ...]:
        """Return the positions of the words of a form from `index` on, () if they differ."""
        positions = [index]
        for word in form.words[1:]:
            at = positions[-1] + 1
            while (
                at < len(self._tokens)
                and self._tokens[at].text in words_of('articles')
                and len(word) > 1
            ):
                if word in self._alike[self._tokens[at].text]:
                    break
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

    def _part_of_name(self, index: int) -> Match | None:
        """Return the places that a noun, part of their names, fits with the words around it."""
        token = self._tokens[index]
        if (
            token.is_number
            or token.is_break
            or len(token.text) < 3
            or token.text in words_of('articles')
        ):
            return None
        fitting: set[str] = set()
        for known in self._alike[token.text]:
            fitting |= self._places_with.get(known, set())
        generic = token.text in words_of('any_place')
        if generic:
            fitting = {place.name for place in self._places if not place.is_object}
        elif is_known(token.text) and not (token.labels & {'regions.walls'}):
            return None
        if not fitting or self._has_other_number(index):
            return None
        chosen, used = self._described(index, [p for p in self._places if p.name in fitting])
        if generic and not used:
            return None
        names = tuple(place.name for place in chosen)
        if 'regions.walls' in token.labels and len(names) > 1:
            return None
        is_plural = stem(token.text) != token.text and not is_name_word(token.text, self._alike)
        return Match(tuple(sorted({index, *used})), names, is_plural=is_plural)

    def _has_other_number(self, index: int) -> bool:
        """Return whether a number or letter follows that belongs to another name ('hall B')."""
        following = self._tokens[index + 1 : index + 2]
        return bool(following) and (
            (len(following[0].text) == 1 and following[0].text.isalpha())
            and following[0].text not in words_of('articles')
        )

    def _described(self, index: int, fitting: list[Place]) -> tuple[list[Place], tuple[int, ...]]:
        """Return the places that the words around a noun leave, and the positions of the words."""
        used: list[int] = []
        around = [*self._before(index), *self._behind(index)]
        for at in around:
            kept = [place for place in fitting if self._is_called(place, self._tokens[at].text)]
            if kept:
                fitting, used = kept, [*used, at]
        sides = [
            (at, side)
            for at in around
            for side in COMPASS
            if f'sides.{side}' in self._tokens[at].labels
        ]
        for at in around:
            left_right = {'sides.left': 'west', 'sides.right': 'east'}
            if sides and any(s in ('north', 'south') for _, s in sides):
                sides += [(at, s) for n, s in left_right.items() if n in self._tokens[at].labels]
        if sides and len(fitting) > 1:
            extreme = outermost(fitting, [side for _, side in sides])
            if extreme is not None:
                return [extreme], tuple(used + [at for at, _ in sides])
        return fitting, tuple(used)

    def _before(self, index: int) -> list[int]:
        """Return the positions of the words just before a noun: 'the northern', 'top left'."""
        found: list[int] = []
        for at in range(index - 1, max(-1, index - 1 - REACH), -1):
            if self._tokens[at].is_break or self._tokens[at].text in words_of('articles'):
                break
            found.append(at)
        return found

    def _behind(self, index: int) -> list[int]:
        """Return the positions of the words after 'in the', 'at the' behind a noun."""
        after = index + 1
        if after >= len(self._tokens) or self._tokens[after].text not in words_of('position'):
            return []
        found: list[int] = []
        for at in range(after, min(len(self._tokens), after + REACH + 1)):
            if self._tokens[at].is_break:
                break
            if self._tokens[at].text in words_of('no_position'):
                return []
            found.append(at)
        return found

    @staticmethod
    def _is_called(place: Place, word: str) -> bool:
        """Return whether a word is a tag or the orientation of a place."""
        if any(same_word(word, tag.casefold()) for tag in (place.kind, *place.tags)):
            return True
        direction = orientation(place)
        return bool(direction) and word in words_of(direction)


def orientation(place: Place) -> str:
    """Return 'horizontal' or 'vertical' for a place that is long and narrow, else ''."""
    x0, y0, x1, y1 = place.geometry.bounds
    wide, high = x1 - x0, y1 - y0
    if wide >= ELONGATED * high > 0:
        return 'horizontal'
    return 'vertical' if high >= ELONGATED * wide > 0 else ''


def forms_of(places: Places) -> Iterable[Form]:
    """Return all ways to write the names, aliases, kinds and tags of places."""
    for place in places:
        for name in (place.name, *place.aliases):
            words = name_words(name)
            if words:
                yield Form(words, name=place.name)
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


def same_word(word: str, known: str) -> bool:
    """Return whether a word of a sentence may be a word of a name: inflected or misspelt."""
    if word == known:
        return True
    if word[0] != known[0]:
        return False
    if max(len(word), len(known)) >= MIN_STEM and undoubled(word) == undoubled(known):
        return len(known) >= MIN_STEM
    if min(len(word), len(known)) < MIN_STEM:
        return False
    if stem(word) == stem(known):
        return True
    if is_known(word) or min(len(word), len(known)) < MIN_MISSPELT:
        return False
    allowed = 2 if len(known) >= LONG_WORD else 1
    return OSA.distance(word, known, score_cutoff=allowed) <= allowed


def undoubled(word: str) -> str:
    """Return a word with doubled letters written once: 'wal' and 'wall' are the same then."""
    return ''.join(a for a, b in zip(word, f'{word[1:]} ') if a != b)


def is_name_word(word: str, alike: dict[str, set[str]]) -> bool:
    """Return whether a word of the sentence stands so in a name: 'stairs' is then no plural."""
    return word in alike.get(word, ())


def stem(word: str) -> str:
    """Return a word without the ending of a plural or a case."""
    if word.endswith('ies') and len(word) > MIN_STEM:
        return f'{word[:-3]}y'
    for ending in ENDINGS:
        if word.endswith(ending) and len(word) - len(ending) >= MIN_STEM:
            return word[: -len(ending)]
    return word


def outermost(places: Sequence[Place], sides: Sequence[str]) -> Place | None:
    """Return the place farthest to a side, or to a corner of two; None where none clearly is."""
    signs = {'north': (0, 1), 'south': (0, -1), 'east': (1, 0), 'west': (-1, 0)}
    dx = sum(signs[side][0] for side in set(sides))
    dy = sum(signs[side][1] for side in set(sides))
    if (dx, dy) == (0, 0):
        return None
    centres = [place.geometry.centroid for place in places]
    extent = max(
        max(c.x for c in centres) - min(c.x for c in centres),
        max(c.y for c in centres) - min(c.y for c in centres),
    )
    ranked = sorted(
        ((dx * c.x + dy * c.y, place) for c, place in zip(centres, places)),
        key=lambda pair: pair[0],
        reverse=True,
    )
    if ranked[0][0] - ranked[1][0] < CLEAR_SHARE * extent:
        return None
    return ranked[0][1]
