"""Finds the places that words of a sentence name: exactly, misspelt, in part, or by position."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from rapidfuzz.distance import OSA

from llm_astar_planner.instructions.grammar.lexicon import lexicon, translated
from llm_astar_planner.instructions.grammar.vocabulary import nouns
from llm_astar_planner.instructions.grammar.words import Word, phrase_words, squeezed
from llm_astar_planner.instructions.model.vocabulary import Token, is_known, tokens_of, words_of
from llm_astar_planner.instructions.regions import COMPASS

ENDINGS = ('es', 'en', 's', 'n', 'e')
MIN_STEM = 4
MIN_MISSPELT = 5
# From this many letters on, two of them may be wrong, else one.
LONG_WORD = 8
MIN_NOUN = 3
# A place this many times longer than wide is called horizontal or vertical.
ELONGATED = 3.0
# Words between a noun and the words that say which one.
REACH = 4
# Of the extent of the places: how much farther to a side the one that is meant must lie.
CLEAR_SHARE = 0.05


def same_word(word: str, known: str) -> bool:
    """Return whether a word of a sentence may be a word of a name: inflected or misspelt."""
    if word == known:
        return True
    if word[0] != known[0] or len(known) < MIN_STEM:
        return False
    if squeezed(word) == squeezed(known) or (len(word) >= MIN_STEM and stem(word) == stem(known)):
        return True
    return not is_known(word) and is_misspelt(word, known)


def is_misspelt(word: str, known: str) -> bool:
    """Return whether a word may be another one with wrong letters, or two letters swapped."""
    if min(len(word), len(known)) < MIN_MISSPELT and sorted(word) != sorted(known):
        return False
    allowed = 2 if len(known) >= LONG_WORD else 1
    return OSA.distance(word, known, score_cutoff=allowed) <= allowed


def stem(word: str) -> str:
    """Return a word without the ending of a plural or a case."""
    if word.endswith('ies') and len(word) > MIN_STEM:
        return f'{word[:-3]}y'
    for ending in ENDINGS:
        if word.endswith(ending) and len(word) - len(ending) >= MIN_STEM:
            return word[: -len(ending)]
    return word


def described(
    tokens: Sequence[Token], noun: tuple[int, ...], fitting: list[Place]
) -> tuple[list[Place], list[int]]:
    """Return the places that the words around a noun leave, and the positions of these words.

    None are left where a word says what fits none of them ('the horizontal wall').
    """
    used: list[int] = []
    around = [*words_before(tokens, noun[0]), *words_behind(tokens, noun[-1])]
    # Adjectives stand behind the noun in French and Spanish.
    behind = range(noun[-1] + 1, min(len(tokens), noun[-1] + 2))
    for at in dict.fromkeys([*around, *behind]):
        kept = [place for place in fitting if is_called(place, tokens[at].text)]
        if kept or tokens[at].text in words_of('horizontal') | words_of('vertical'):
            fitting, used = kept, [*used, at]
    sides = sides_among(tokens, around)
    if sides and len(fitting) > 1:
        extreme = outermost(fitting, [side for _, side in sides])
        if extreme is not None:
            corners = [at for at in around if 'position_words' in tokens[at].labels]
            return [extreme], [*used, *corners, *(at for at, _ in sides)]
    return fitting, used


def sides_among(tokens: Sequence[Token], around: Sequence[int]) -> list[tuple[int, str]]:
    """Return the compass sides that words name; 'left' is west only beside 'top' or 'bottom'."""
    sides = [(n, side) for n in around for side in COMPASS if f'sides.{side}' in tokens[n].labels]
    if any(side in ('north', 'south') for _, side in sides):
        for label, side in (('sides.left', 'west'), ('sides.right', 'east')):
            sides += [(n, side) for n in around if label in tokens[n].labels]
    return sides


def words_before(tokens: Sequence[Token], index: int) -> list[int]:
    """Return the positions of the words just before a noun: 'the northern', 'top left'."""
    found: list[int] = []
    for at in range(index - 1, max(-1, index - 1 - REACH), -1):
        if tokens[at].is_break or tokens[at].text in words_of('articles'):
            break
        found.append(at)
    return found


def words_behind(tokens: Sequence[Token], index: int) -> list[int]:
    """Return the positions of the words after 'in the', 'at the' behind a noun."""
    after = index + 1
    if after >= len(tokens) or tokens[after].text not in words_of('position'):
        return []
    found: list[int] = []
    for at in range(after, min(len(tokens), after + REACH + 1)):
        if tokens[at].is_break:
            break
        if tokens[at].text in words_of('no_position'):
            return []
        found.append(at)
    return found


def is_called(place: Place, word: str) -> bool:
    """Return whether a word is a tag, a colour or the orientation of a place."""
    tags = [tag.casefold() for tag in (place.kind, *place.tags)]
    colours = nouns().colours
    if any(same_word(word, tag) or colours.get(word, word) == colours.get(tag) for tag in tags):
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


def outermost(places: Sequence[Place], sides: Sequence[str]) -> Place | None:
    """Return the place farthest to a side, or to a corner of two; None where none clearly is."""
    signs = {'north': (0, 1), 'south': (0, -1), 'east': (1, 0), 'west': (-1, 0)}
    dx = sum(signs[side][0] for side in set(sides))
    dy = sum(signs[side][1] for side in set(sides))
    if (dx, dy) == (0, 0):
        return None
    centres = [place.geometry.centroid for place in places]
    x0, y0, x1, y1 = shapely.total_bounds(centres)
    scores = [dx * centre.x + dy * centre.y for centre in centres]
    *_, second, best = sorted(scores)
    is_clear = best - second >= CLEAR_SHARE * max(x1 - x0, y1 - y0)
    return places[scores.index(best)] if is_clear else None


@dataclass(frozen=True)
class Mention:
    """Words of a sentence that name something; `tokens` are their positions in it.

    - `names`: the places that may be meant, several where the words fit more than one.
    - `tags`: kinds and tags of places.
    - `numbers`: the value as written and, where a unit follows, in metres (the last one).
    - `sides`: directions.
    """

    tokens: tuple[int, ...]
    names: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()
    sides: tuple[str, ...] = ()
    has_unit: bool = False
    is_plural: bool = False

    @property
    def first(self) -> int:
        """The position of its first word."""
        return self.tokens[0]


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

    def match_at(self, index: int) -> Mention | None:
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

    def _whole_name(self, index: int) -> Mention | None:
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
            return Mention(best[forms[0]], names)
        names = tuple(place.name for place in self._places.with_tag(tags[0]))
        last = self._tokens[best[forms[0]][-1]].text
        return Mention(best[forms[0]], names, tags, is_plural=last != forms[0].words[-1])

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

    def _noun(self, index: int) -> Mention | None:
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
        return replace(noun, tokens=tuple(sorted({*noun.tokens, *used})), names=names)

    def _noun_of_table(self, index: int) -> Mention | None:
        count, found = nouns().everywhere.longest(self._words, index)
        if not found:
            return None
        groups = [lexicon(self._places).group(noun, '') for noun in found]
        names = dict.fromkeys(place.name for group in groups for place in group.places)
        if not names:
            return None
        plural = all(noun.plural for noun in found)
        return Mention(tuple(range(index, index + count)), tuple(names), is_plural=plural)

    def _noun_of_names(self, index: int) -> Mention | None:
        word = self._tokens[index].text
        if is_known(word):
            return None
        known = [self._index.places_with[name] for name in self._alike[word]]
        names = tuple(sorted(set().union(*known)))
        is_plural = stem(word) != word and word not in self._alike[word]
        return Mention((index,), names, is_plural=is_plural) if names else None

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
