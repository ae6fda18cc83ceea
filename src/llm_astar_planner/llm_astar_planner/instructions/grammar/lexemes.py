"""Lexemes: the words of an instruction with their meaning, numbers and points put together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

from llm_astar_planner.instructions.regions import Box

NUMBER, UNIT, LENGTH, POINT = 'NUMBER', 'UNIT', 'LENGTH', 'POINT'
AXIS, AXISLINE, RANGE = 'AXIS', 'AXISLINE', 'RANGE'
COMMA, AND, SIGN, UNKNOWN = 'COMMA', 'AND', 'SIGN', 'UNKNOWN'
# Metres. A number beyond it is no place on a map.
MOST = 1e6
OPENING, CLOSING = '([', ')]'
# Lexemes that say nothing before some others: 'the point | 20, 12', 'at least | 3 m'.
GO_WITH = {
    'POINTWORD': (POINT,),
    'ATLEAST': (LENGTH, 'DISTANCE', 'ATLEAST'),
    'LINE': (AXISLINE,),
}


@dataclass(frozen=True)
class Lexeme:
    """A word or phrase: its kind, its value, and where it stands in the text.

    `other` is another kind that the phrase may be of, `other_value` its value.
    """

    kind: str
    value: Any
    start: int
    end: int
    other: str = ''
    other_value: Any = ''

    def __str__(self) -> str:
        """Return the kind, for messages of the parser."""
        return self.kind

    @property
    def line(self) -> tuple[str, float]:
        """The axis and the coordinate of a line 'y = 3'; raises TypeError for others."""
        axis, at = self.value
        return str(axis), float(at)

    def as_other(self) -> Lexeme:
        """Return the lexeme as of its other kind."""
        return replace(self, kind=self.other, value=self.other_value)

    @property
    def number(self) -> float:
        """The value as a number."""
        return float(str(self.value))


def joined(lexemes: Sequence[Lexeme], kind: str, value: object) -> Lexeme:
    """Return several lexemes as one."""
    return Lexeme(kind, value, lexemes[0].start, lexemes[-1].end)


@cache
def choices_of(pattern: str) -> tuple[frozenset[str], ...]:
    """Return the kinds that a pattern allows one after the other."""
    return tuple(frozenset(choice.split('|')) for choice in pattern.split())


def kinds_match(lexemes: Sequence[Lexeme], at: int, pattern: str) -> bool:
    """Whether the kinds from `at` on are those of a pattern, 'NUMBER COMMA|AND'."""
    wanted = choices_of(pattern)
    if at < 0 or at + len(wanted) > len(lexemes):
        return False
    return all(lexemes[at + n].kind in kinds for n, kinds in enumerate(wanted))


def is_sign(lexemes: Sequence[Lexeme], at: int, signs: str) -> bool:
    """Whether a lexeme is one of some signs."""
    return at < len(lexemes) and lexemes[at].kind == SIGN and str(lexemes[at].value) in signs


# What a combination may begin with.
COMBINED = frozenset({NUMBER, SIGN, AXIS, 'BETWEEN', 'FROM'})
# Each takes the lexemes and an index and returns what they are put together to, or None.
Combined = tuple[int, Lexeme]


def length(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'3 m', and '2,5 m' with a decimal comma; '1,500 m' may be thousands and is not known."""
    if kinds_match(lexemes, at, 'NUMBER UNIT'):
        metres = lexemes[at].number * lexemes[at + 1].number
        return 2, joined(lexemes[at : at + 2], LENGTH, metres)
    whole = lexemes[at : at + 4]
    if not kinds_match(lexemes, at, 'NUMBER COMMA NUMBER UNIT') or has_gap(whole[:3]):
        return None
    units, decimals = str(whole[0].value), str(whole[2].value)
    is_thousand = len(decimals) == 3 and units.lstrip('-') != '0'
    if is_thousand or not (decimals.isdigit() and units.lstrip('-').isdigit()):
        return 4, joined(whole, UNKNOWN, f'{units},{decimals}')
    return 4, joined(whole, LENGTH, float(f'{units}.{decimals}') * whole[3].number)


def has_gap(lexemes: Sequence[Lexeme]) -> bool:
    """Whether there is a space between some of the lexemes."""
    return any(one.end != two.start for one, two in pairwise(lexemes))


def point(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'20, 12', '(20, 12)' and 'x=20, y=12', the latter also in brackets."""
    opening = is_sign(lexemes, at, OPENING)
    first = at + opening
    found = bare_point(lexemes, first, opening)
    if found is None:
        return None
    count, x, y = found
    if opening:
        if not is_sign(lexemes, first + count, CLOSING):
            return None
        count += 2
    return count, joined(lexemes[at : at + count], POINT, (x, y))


def bare_point(
    lexemes: Sequence[Lexeme], at: int, opening: bool
) -> tuple[int, float, float] | None:
    """Return the count of lexemes and the coordinates of a point without brackets."""
    line = axis_line(lexemes, at)
    if line is not None:
        count, one = line
        while kinds_match(lexemes, at + count, 'COMMA|AND'):
            count += 1
        other = axis_line(lexemes, at + count)
        if other is None or (one.line[0], other[1].line[0]) != ('x', 'y'):
            return None
        x, y = one.line[1], other[1].line[1]
        return count + other[0], x, y
    if opening and kinds_match(lexemes, at, 'NUMBER NUMBER'):
        return 2, lexemes[at].number, lexemes[at + 1].number
    if kinds_match(lexemes, at, 'NUMBER COMMA NUMBER') and not kinds_match(lexemes, at + 3, UNIT):
        return 3, lexemes[at].number, lexemes[at + 2].number
    return None


def axis_line(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'y = 22.5', 'y 22.5' and 'y of 22.5', with or without a unit."""
    if not kinds_match(lexemes, at, AXIS):
        return None
    number = at + 1
    if is_sign(lexemes, number, '=') or kinds_match(lexemes, number, 'OF|SIGNEQ'):
        number += 1
    if not kinds_match(lexemes, number, NUMBER):
        return None
    value = lexemes[number].number
    if kinds_match(lexemes, number + 1, UNIT):
        number += 1
        value *= lexemes[number].number
    count = number + 1 - at
    return count, joined(lexemes[at : at + count], AXISLINE, (lexemes[at].value, value))


def axis_range(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'x below 10', 'y > 3' and 'x from 2 to 5' (also 'between 2 and 5') as a Box."""
    if not kinds_match(lexemes, at, AXIS):
        return None
    axis = str(lexemes[at].value)
    if kinds_match(lexemes, at, 'AXIS ABOVE|BELOW NUMBER'):
        value = lexemes[at + 2].number
        above = lexemes[at + 1].kind == 'ABOVE'
        count, low, high = 3, value if above else -math.inf, math.inf if above else value
        if kinds_match(lexemes, at + 3, UNIT):
            count, scale = 4, lexemes[at + 3].number
            low, high = low * scale, high * scale
    elif kinds_match(lexemes, at, 'AXIS FROM|BETWEEN|OF NUMBER TO|AND NUMBER'):
        count, low, high = 5, lexemes[at + 2].number, lexemes[at + 4].number
    else:
        return None
    return count, joined(lexemes[at : at + count], RANGE, (axis_box(axis, low, high),))


def axis_box(axis: str, low: float, high: float) -> Box:
    """Return the Box with one coordinate within limits."""
    if axis == 'x':
        return Box(low, -math.inf, high, math.inf)
    return Box(-math.inf, low, math.inf, high)


def between_lines(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'between y = 5 and y = 20' as a Box."""
    if not kinds_match(lexemes, at, 'BETWEEN|FROM'):
        return None
    first = axis_line(lexemes, at + 1)
    if first is None or not kinds_match(lexemes, at + 1 + first[0], 'AND|TO'):
        return None
    second = axis_line(lexemes, at + 2 + first[0])
    if second is None:
        return None
    one, other = first[1].line, second[1].line
    if one[0] != other[0]:
        return None
    count = 2 + first[0] + second[0]
    box = axis_box(one[0], one[1], other[1])
    return count, joined(lexemes[at : at + count], RANGE, (box,))


COMBINATIONS: tuple[Callable[[Sequence[Lexeme], int], Combined | None], ...] = (
    length,
    point,
    axis_range,
    axis_line,
    between_lines,
)


def combined(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes with numbers, units and axes put together, in one pass."""
    result: list[Lexeme] = []
    at = 0
    while at < len(lexemes):
        for combine in COMBINATIONS if lexemes[at].kind in COMBINED else ():
            found = combine(lexemes, at)
            if found is not None:
                count, lexeme = found
                break
        else:
            count, lexeme = 1, lexemes[at]
        if not joins_area(result, lexeme):
            result.append(lexeme)
        at += count
    return result


def joins_area(result: list[Lexeme], lexeme: Lexeme) -> bool:
    """Whether a range goes on with an area, 'with x from 1 to 2 | and y above 3'; it is joined."""
    if lexeme.kind != RANGE or not kinds_match(result, len(result) - 3, 'AREAWITH RANGE AND'):
        return False
    _, first, _ = result[-3:]
    result[-2:] = [joined((first, lexeme), RANGE, (*first.value, *lexeme.value))]
    return True


# After these 'est' is the east in French.
BEFORE_SIDES = frozenset({'TO', 'SIDENOUN', 'HALFNOUN', 'THROUGH', 'IN', 'UPON', 'NOUN', 'AT'})


def told_apart(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes of two kinds as the one that goes with their neighbours.

    'y = 3' is an axis in Spanish, too, and 'um A' is around it in German, 'um 3 m' by so much.
    """
    result: list[Lexeme] = []
    for at, (lexeme, after) in enumerate(zip(lexemes, kinds_after(lexemes))):
        before = result[-1].kind if result else ''
        is_other = (
            (lexeme.other == AXIS and is_sign(lexemes, at + 1, '='))
            or (lexeme.other in ('ABOVE', 'BELOW') and AXIS in (before, after))
            or (lexeme.other == 'SIDE' and before in BEFORE_SIDES)
            or (lexeme.other == 'AROUND' and not kinds_match(lexemes, at + 1, 'NUMBER|LENGTH'))
        )
        result.append(lexeme.as_other() if is_other else lexeme)
    return result


def kinds_after(lexemes: Sequence[Lexeme]) -> list[str]:
    """Return the kind of the lexeme after each, '' at the end."""
    return [*(lexeme.kind for lexeme in lexemes[1:]), '']


def settled(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes without those that only go with the next one: 'the point', 'at least'.

    An ordinal is told from an order word by what follows ('first aisle', 'first the dock').
    """
    return [
        lexeme.as_other() if lexeme.other == 'ORDINAL' and following == 'NOUN' else lexeme
        for lexeme, following in zip(lexemes, kinds_after(lexemes))
        if following not in GO_WITH.get(lexeme.kind, ())
    ]


# After these 'it' stands for a place; elsewhere it says nothing: 'it is important that'.
BEFORE_IT = frozenset(
    {'AVOID', 'SKIP', 'VISIT', 'ENTER', 'THROUGH', 'AROUND_VERB', 'LEAVE', 'GIVE', 'FROM', 'PASS'}
    | {'PASSBY', 'AROUND', 'CLOSE', 'APPROACH', 'BETWEEN', 'USE'}
)
# Before these a pronoun is an article: 'those rooms'.
AFTER_ARTICLES = frozenset({'PLACE', 'NOUN', 'TAG', 'SIDE', 'MOST', 'CENTER', 'ORIENT', 'ORDINAL'})


def with_pronouns(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes without the pronouns that stand for no place."""
    result: list[Lexeme] = []
    for lexeme, after in zip(lexemes, [*lexemes[1:], None]):
        if lexeme.kind != 'PRONOUN':
            result.append(lexeme)
        elif after is not None and after.kind in AFTER_ARTICLES:
            continue
        elif lexeme.value != 'it':
            result.append(lexeme)
        elif result and result[-1].kind in BEFORE_IT:
            result.append(replace(lexeme, value='one'))
    return result
