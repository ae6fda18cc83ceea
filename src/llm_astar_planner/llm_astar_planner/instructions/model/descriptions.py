"""Which of several places words around a noun mean: 'the vertical wall', 'the top left room'."""

from __future__ import annotations

from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.places import Place

from llm_astar_planner.instructions.grammar.nouns import nouns
from llm_astar_planner.instructions.model.spelling import same_word
from llm_astar_planner.instructions.model.vocabulary import Token, words_of
from llm_astar_planner.instructions.specification import COMPASS

# A place this many times longer than wide is called horizontal or vertical.
ELONGATED = 3.0
# Words between a noun and the words that say which one.
REACH = 4
# Of the extent of the places: how much farther to a side the one that is meant must lie.
CLEAR_SHARE = 0.05


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
        if kept or is_orientation(tokens[at].text):
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


def is_orientation(word: str) -> bool:
    """Return whether a word means horizontal or vertical."""
    return word in words_of('horizontal') | words_of('vertical')


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
