# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Lexemes: the words of an instruction with their meaning, numbers and points put together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

from llm_astar_planner.instructions.grammar.vocabulary import KINDS
from llm_astar_planner.instructions.regions import Box

# Metres. A number beyond it is no place on a map.
MOST = 1e6
OPENING, CLOSING = '([', ')]'
# Lexemes that say nothing before some others: 'the point | 20, 12', 'at least | 3 m'.
GO_WITH = {
    'POINTWORD': ('POINT',),
    'ATLEAST': ('LENGTH', 'DISTANCE', 'ATLEAST'),
    'MORETHAN': ('LENGTH', 'DISTANCE'),
    'LINE': ('AXISLINE',),
}


@dataclass(frozen=True)
class Lexeme:
    """A word or phrase: its kind, its value, and where it stands in the text.

    `other` is another kind that the phrase may be of, `other_value` its value. `doubts` are the
    words as they were said, and what was taken for them, where they are misspelt or a synonym.
    """

    kind: str
    value: Any
    start: int
    end: int
    other: str = ''
    other_value: Any = ''
    doubts: tuple[tuple[str, str], ...] = ()

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
    return Lexeme(kind, value, lexemes[0].start, lexemes[-1].end, doubts=doubts_of(lexemes))


def doubts_of(lexemes: Sequence[Lexeme]) -> tuple[tuple[str, str], ...]:
    """Return the doubts of several lexemes, each once."""
    return tuple(dict.fromkeys(doubt for lexeme in lexemes for doubt in lexeme.doubts))


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
    return at < len(lexemes) and lexemes[at].kind == 'SIGN' and str(lexemes[at].value) in signs


# What may stand between a verb of fetching and the end of what is fetched.
ERRANDS = 'THING|PERSON|PRONOUN|NUMBER|RECTANGLE|THIS|ANY_ARTICLE|ANY|YOUR|AND'
# Each takes the lexemes and an index and returns what they are put together to, or None.
Combined = tuple[int, Lexeme]


def length(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'3 m', and '2,5 m' with a decimal comma; '1,500 m' may be thousands and is not known."""
    if kinds_match(lexemes, at, 'NUMBER UNIT'):
        metres = lexemes[at].number * lexemes[at + 1].number
        return 2, joined(lexemes[at : at + 2], 'LENGTH', metres)
    whole = lexemes[at : at + 4]
    if not kinds_match(lexemes, at, 'NUMBER COMMA NUMBER UNIT') or has_gap(whole[:3]):
        return None
    units, decimals = str(whole[0].value), str(whole[2].value)
    is_thousand = len(decimals) == 3 and units.lstrip('-') != '0'
    if is_thousand or not (decimals.isdigit() and units.lstrip('-').isdigit()):
        return 4, joined(whole, 'UNKNOWN', f'{units},{decimals}')
    return 4, joined(whole, 'LENGTH', float(f'{units}.{decimals}') * whole[3].number)


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
    return count, joined(lexemes[at : at + count], 'POINT', (x, y))


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
    if kinds_match(lexemes, at, 'NUMBER COMMA NUMBER') and not kinds_match(
        lexemes, at + 3, 'UNIT'
    ):
        return 3, lexemes[at].number, lexemes[at + 2].number
    return None


def axis_line(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'y = 22.5', 'y 22.5' and 'y of 22.5', with or without a unit."""
    if not kinds_match(lexemes, at, 'AXIS'):
        return None
    number = at + 1
    if is_sign(lexemes, number, '=') or kinds_match(lexemes, number, 'OF|SIGNEQ'):
        number += 1
    if not kinds_match(lexemes, number, 'NUMBER'):
        return None
    value = lexemes[number].number
    if kinds_match(lexemes, number + 1, 'UNIT'):
        number += 1
        value *= lexemes[number].number
    count = number + 1 - at
    return count, joined(lexemes[at : at + count], 'AXISLINE', (lexemes[at].value, value))


def axis_range(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'x below 10', 'y > 3' and 'x from 2 to 5' (also 'between 2 and 5') as a Box."""
    if not kinds_match(lexemes, at, 'AXIS'):
        return None
    axis = str(lexemes[at].value)
    if kinds_match(lexemes, at, 'AXIS ABOVE|BELOW NUMBER'):
        value = lexemes[at + 2].number
        above = lexemes[at + 1].kind == 'ABOVE'
        count, low, high = 3, value if above else -math.inf, math.inf if above else value
        if kinds_match(lexemes, at + 3, 'UNIT'):
            count, scale = 4, lexemes[at + 3].number
            low, high = low * scale, high * scale
    elif kinds_match(lexemes, at, 'AXIS FROM|BETWEEN|OF NUMBER TO|AND NUMBER'):
        count, low, high = 5, lexemes[at + 2].number, lexemes[at + 4].number
    else:
        return None
    return count, joined(lexemes[at : at + count], 'RANGE', (axis_box(axis, low, high),))


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
    return count, joined(lexemes[at : at + count], 'RANGE', (box,))


def times(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'at most twice', 'exactly 3 times', 'at least 1 and at most 2 times', 'twice or more'.

    The value is the least and the most (None for any number), and whether 'not' turns it round.
    """
    least: float = 0
    most: float | None = None
    end, found = at, []
    if lexemes[at].kind == 'TIMES' and lexemes[at].value == 'any':
        return 1, joined(lexemes[at : at + 1], 'TIMES', (0, None, False))
    while (one := limited(lexemes, end)) is not None:
        count, number, limit = one
        end += count
        found.append(limit)
        least = max(least, number + (limit == 'MORETHAN')) if limit in KINDS.from_below else least
        most = number - (limit == 'LESSTHAN') if limit in KINDS.from_above else most
        if kinds_match(lexemes, end - 1, 'TIMES|TIMESWORD') or not kinds_match(
            lexemes, end, 'AND ATMOST'
        ):
            break
        end += 1
    if not found or not any(lexeme.kind in ('TIMES', 'TIMESWORD') for lexeme in lexemes[at:end]):
        return None
    turns = found in (['MORETHAN'], ['LESSTHAN'])
    return end - at, joined(lexemes[at:end], 'TIMES', (int(least), most, turns))


def limited(lexemes: Sequence[Lexeme], at: int) -> tuple[int, int, str] | None:
    """Return the lexemes, the number and the limit of 'at most twice', None without one."""
    before = kinds_match(lexemes, at, 'ATLEAST|ATMOST|EXACTLY|MORETHAN|LESSTHAN|ONLY')
    limit, end = (lexemes[at].kind, at + 1) if before else ('EXACTLY', at)
    if not kinds_match(lexemes, end, 'TIMES|NUMBER') or isinstance(lexemes[end].value, tuple):
        return None
    number = lexemes[end].number
    end += 1
    for _ in range(2):
        if kinds_match(lexemes, end, 'ORMORE|ATMOST|ATLEAST') and not (
            before or kinds_match(lexemes, end, 'ATMOST|ATLEAST TIMES|NUMBER')
        ):
            limit, end = lexemes[end].kind, end + 1
        if kinds_match(lexemes, end, 'TIMESWORD'):
            end += 1
    return (end - at, int(number), limit) if number == int(number) >= 0 else None


def moment(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'before noon', 'within 5 minutes', 'wait 5 minutes', 'follow the nurse', 'pick up a box'."""
    first = lexemes[at]
    if kinds_match(lexemes, at, 'FETCH|ALONG'):
        return errand(lexemes, at)
    is_wait = 'UNSUPPORTED' in (first.kind, first.other)
    if not is_wait and first.kind in ('CONDITION', 'UNSUPPORTED'):
        return None
    end = at + (is_wait or first.kind in KINDS.before_time)
    end += kinds_match(lexemes, end, 'BEFORE|BY|IN|UPON|AT|PURPOSE|ATLEAST')
    end += kinds_match(lexemes, end, 'ATLEAST')
    if kinds_match(lexemes, end, 'NUMBER TIMEWORD'):
        end += 2
    elif kinds_match(lexemes, end, 'TIMEWORD') or (
        is_wait and kinds_match(lexemes, end, 'PERSON')
    ):
        end += 1
    elif first.kind == 'UNSUPPORTED':
        end = at + 1
    else:
        return None
    about = first.value if first.kind == 'UNSUPPORTED' else first.other_value if is_wait else ''
    about = about or ('waiting' if first.kind == 'PURPOSE' else 'time')
    return end - at, joined(lexemes[at:end], 'UNSUPPORTED', about)


def errand(lexemes: Sequence[Lexeme], at: int) -> Combined | None:
    """'pick up the box', which is no more than an action, and 'follow the nurse'."""
    if kinds_match(lexemes, at, 'ALONG PERSON'):
        return 2, joined(lexemes[at : at + 2], 'UNSUPPORTED', 'following')
    end = at + 1
    while kinds_match(lexemes, end, ERRANDS):
        end += 1
    while end > at + 1 and not kinds_match(lexemes, end - 1, 'THING|PERSON|PRONOUN|RECTANGLE'):
        end -= 1
    if lexemes[at].kind != 'FETCH' or end == at + 1:
        return None
    return end - at, joined(lexemes[at:end], 'FETCH', 'errand')


COMBINATIONS: tuple[Callable[[Sequence[Lexeme], int], Combined | None], ...] = (
    times,
    moment,
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
        for combine in COMBINATIONS if lexemes[at].kind in KINDS.combined else ():
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
    if lexeme.kind != 'RANGE' or not kinds_match(result, len(result) - 3, 'AREAWITH RANGE AND'):
        return False
    _, first, _ = result[-3:]
    result[-2:] = [joined((first, lexeme), 'RANGE', (*first.value, *lexeme.value))]
    return True


def told_apart(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes of two kinds as the one that goes with their neighbours.

    'y = 3' is an axis in Spanish, too, and 'um A' is around it in German, 'um 3 m' by so much.
    """
    result: list[Lexeme] = []
    for at, (lexeme, after) in enumerate(zip(lexemes, kinds_after(lexemes))):
        before = result[-1].kind if result else ''
        is_other = (
            (lexeme.other == 'AXIS' and is_sign(lexemes, at + 1, '='))
            or (lexeme.other in ('ABOVE', 'BELOW') and 'AXIS' in (before, after))
            or (lexeme.other == 'SIDE' and before in KINDS.before_sides)
            or (lexeme.other == 'AROUND' and not kinds_match(lexemes, at + 1, 'NUMBER|LENGTH'))
            or (lexeme.other == 'AFTER' and is_after(result, lexemes[at + 1 :]))
            or (lexeme.other == 'FETCH' and after in ('THING', 'PERSON'))
            or (lexeme.other == 'LONGWAY' and after in ('BY', 'THROUGH', 'UPON', 'IN'))
            or (
                lexeme.other == 'TIMES'
                and (before in KINDS.limits or after not in KINDS.after_once)
            )
        )
        result.append(lexeme.as_other() if is_other else lexeme)
    return result


def is_after(before: Sequence[Lexeme], behind: Sequence[Lexeme]) -> bool:
    """Whether the German 'nach' between these is 'after', not 'to'.

    As in 'besuche A nach B' and 'nach A nicht durch B', but not in 'nach A fahren'.
    """
    kinds = [lexeme.kind for lexeme in before]
    if kinds[-1:] in ([], ['HARD'], ['COMMA'], ['AND']):
        rest = [one.kind for one in behind[:5] if one.kind not in ('PLACE', 'NOUN', 'NUMBER')]
        return (
            len(behind) > len(rest)
            and rest[:1] not in ([], ['HARD'], ['COMMA'])
            and (rest[:1] == ['NEG'] or len(behind) > len(rest) + 1)
        )
    return kinds[-1:] in (['PLACE'], ['NOUN'], ['NUMBER']) and not {'OF', 'FROM'} & set(kinds)


def kinds_after(lexemes: Sequence[Lexeme]) -> list[str]:
    """Return the kind of the lexeme after each, '' at the end."""
    return [*(lexeme.kind for lexeme in lexemes[1:]), '']


def settled(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes without those that only go with the next one: 'the point', 'at least'.

    An ordinal is told from an order word by what follows ('first aisle', 'first the dock'), and
    brackets that are left enclose a region.
    """
    return [
        lexeme.as_other()
        if lexeme.other == 'ORDINAL' and following == 'NOUN'
        else replace(lexeme, kind=BRACKETS.get(lexeme.value, 'SIGN'))
        if lexeme.kind == 'SIGN'
        else lexeme
        for lexeme, following in zip(lexemes, kinds_after(lexemes))
        if following not in GO_WITH.get(lexeme.kind, ())
    ]


BRACKETS = {'(': 'BRACKET', ')': 'ENDBRACKET'}


def with_pronouns(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes without the pronouns that stand for no place."""
    result: list[Lexeme] = []
    for lexeme, after in zip(lexemes, [*lexemes[1:], None]):
        if lexeme.kind != 'PRONOUN':
            result.append(lexeme)
        elif after is not None and after.kind in KINDS.after_articles:
            continue
        elif lexeme.value != 'it':
            result.append(lexeme)
        elif result and result[-1].kind in KINDS.before_it:
            result.append(replace(lexeme, value='one'))
    return result
