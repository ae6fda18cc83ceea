"""From the parts of a parsed noun phrase to regions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lark import Token, Transformer, v_args

from llm_astar_planner.instructions.grammar.asked import (
    Things,
    positive,
    strip_along,
    with_radius,
)
from llm_astar_planner.instructions.grammar.lexicon import Group
from llm_astar_planner.instructions.grammar.regions import (
    Part,
    Selection,
    Unclear,
    axis_half,
    common_box,
    half_of,
    joint_limits,
    select_group,
    select_place,
)
from llm_astar_planner.instructions.specification import Between, Box, Disc

# The type parameters of lark's class differ between its versions.
Callbacks: Any = Transformer


def value(token: Token) -> Any:
    """Return what a lexeme stands for."""
    return token.value.value


def side_in(tokens: tuple[Token, ...]) -> str:
    """Return the side among some lexemes."""
    return next(str(value(token)) for token in tokens if token.type == 'SIDE')


@v_args(inline=True)
class RegionMeaning(Callbacks):  # type: ignore[misc]
    """Called by the parser for the rules of regions in `clauses.lark`."""

    def things(self, *things: Selection) -> Things:
        """'A, B and C'; 'x above 2 and x below 5' is one area."""
        limits = [thing for thing in things if thing.is_limit]
        if len(limits) > 1:
            return (*(thing for thing in things if not thing.is_limit), *joint_limits(limits))
        return things

    def place(self, token: Token) -> Selection:
        """A name."""
        return select_place(value(token))

    def all_of(self, _: Token, place: Selection) -> Selection:
        """'all of A'."""
        return replace(place, is_all=True)

    def point(self, token: Token) -> Selection:
        """'20, 12'."""
        x, y = value(token)
        return Selection((Disc(x, y),), is_point=True)

    def group(self, described: tuple[Group, list[Part]], *where: list[Part]) -> Selection:
        """'the northern rooms', 'the room in the top left'."""
        noun, parts = described
        return select_group(noun, parts, where[0] if where else [])

    def described(self, *parts: Any) -> tuple[Group, list[Part]]:
        """'all blue rooms', 'la salle bleue': adjectives and the noun."""
        tokens = [part for part in parts if isinstance(part, Token)]
        adjectives = [part for part in parts if isinstance(part, Part)]
        noun, *after = tokens
        return value(noun), [*adjectives, *map(self.adjective, after)]

    def adjective(self, token: Token) -> Part:
        """'blue', 'northern', 'all'."""
        return Part(token.type, value(token))

    def where(self, *tokens: Token) -> list[Part]:
        """'in the top left', 'in the middle'."""
        return [Part(token.type, value(token)) for token in tokens]

    def around(self, metres: Token, thing: Selection) -> Selection:
        """'the 3 m around 20, 12'."""
        if not thing.is_point:
            raise Unclear('a strip around a place is said as avoid it by')
        return Selection((with_radius(thing, positive(value(metres))),))

    def disc(self, thing: Selection) -> Selection:
        """'the area around 20, 12': a disc of the default radius."""
        return self.surroundings(thing)

    def surroundings(self, thing: Selection) -> Selection:
        """'the surroundings of 20, 12': a disc of the default radius."""
        return Selection(thing.regions)

    def half(self, *parts: Any) -> Selection:
        """'the north half of the lab'."""
        tokens = tuple(part for part in parts if isinstance(part, Token))
        wholes = [part for part in parts if not isinstance(part, Token)]
        whole = wholes[0] if wholes else None
        is_half = any(token.type == 'HALFNOUN' for token in tokens)
        return half_of(side_in(tokens), is_half, whole)

    def of_map(self) -> str:
        """'of the map'."""
        return 'map'

    def of_way(self) -> str:
        """'of the direct way'."""
        return 'way'

    def of_place(self, thing: Selection) -> object:
        """'of the lab'."""
        return thing.place

    def field(self, side: Token, line: Token) -> Selection:
        """'north of y = 10'."""
        return Selection((axis_half(str(value(side)), *value(line)),), is_limit=True)

    def above(self, line: Token) -> Selection:
        """'above y = 10'."""
        return Selection((axis_half('north', *value(line)),), is_limit=True)

    def below(self, line: Token) -> Selection:
        """'below y = 10'."""
        return Selection((axis_half('south', *value(line)),), is_limit=True)

    def same(self, thing: Selection) -> Selection:
        """'everything north of y = 10'."""
        return thing

    def limits(self, box: Token) -> Selection:
        """'x below 10', 'between y = 5 and y = 20'."""
        return Selection((common_box(value(box)),), is_limit=True)

    def ranges(self, box: Token) -> Selection:
        """'the area with x from 1 to 2 and y above 3'."""
        return Selection((common_box(value(box)),))

    def whole(self) -> Selection:
        """'the whole map'."""
        return Selection((common_box(()),))

    def between(self, first: Selection, second: Selection) -> Selection:
        """'between A and B'."""
        return Selection((Between(first.place.name, second.place.name),))

    def between_two(self, pair: Selection) -> Selection:
        """'between the racks', if there are two."""
        if len(pair.places) != 2:
            raise Unclear('between which two')
        first, second = pair.places
        return Selection((Between(first.name, second.name),))

    def rectangle(self, corner: Token, other: Token) -> Selection:
        """'the rectangle from 1, 2 to 3, 4'."""
        (x0, y0), (x1, y1) = value(corner), value(other)
        if x0 == x1 or y0 == y1:
            raise Unclear('an empty area')
        return Selection((Box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)),))

    def strip(self, metres: Token, _: Token, thing: Selection) -> Selection:
        """'the 1 m along the lab'."""
        return Selection((strip_along(thing, value(metres)),))
