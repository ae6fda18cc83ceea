# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Lexemes: the words of an instruction with their meaning, numbers and points put together."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby, pairwise
from typing import Any

from llm_astar_msgs_adapter.maps.places import Place

from llm_astar_planner.instructions.grammar.lexicon import HEAD, WALL, Group
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, read_table
from llm_astar_planner.instructions.regions import Box

# No more than on the way, but not after a 'not'.
BEFORE_GOAL = 'before the goal'
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

    def as_other(self) -> Lexeme:
        """Return the lexeme as of its other kind."""
        return replace(self, kind=self.other, value=self.other_value)

    @property
    def number(self) -> float:
        """The value as a number."""
        return float(str(self.value))

    @property
    def places(self) -> tuple[Place, ...]:
        """The places that it may mean."""
        if isinstance(self.value, Group):
            return self.value.places
        return (self.value,) if isinstance(self.value, Place) else ()

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(place.name for place in self.places)


def joined(lexemes: Sequence[Lexeme], kind: str, value: object) -> Lexeme:
    """Return several lexemes as one, with the doubts of all, each once."""
    doubts = tuple(dict.fromkeys(doubt for lexeme in lexemes for doubt in lexeme.doubts))
    return Lexeme(kind, value, lexemes[0].start, lexemes[-1].end, doubts=doubts)


def tag_of(lexeme: Lexeme) -> str:
    """Return what the patterns below call a lexeme: its kind, or the sign that it is."""
    if lexeme.kind == 'SIGN' and len(str(lexeme.value)) == 1:
        return str(lexeme.value)
    if lexeme.kind == 'CONDITION' and lexeme.other == 'UNSUPPORTED':
        return 'WAIT'
    return 'ANYTIMES' if lexeme.kind == 'TIMES' and lexeme.value == 'any' else lexeme.kind


def numbers_in(run: Sequence[Lexeme]) -> list[float]:
    """Return the numbers of lexemes, in metres where a unit follows."""
    found: list[float] = []
    for lexeme in run:
        if lexeme.kind == 'NUMBER':
            found.append(lexeme.number)
        elif lexeme.kind == 'UNIT':
            found[-1] *= lexeme.number
    return found


def axes_in(run: Sequence[Lexeme]) -> list[str]:
    """Return the axes that lexemes name, in their order."""
    return [str(lexeme.value) for lexeme in run if lexeme.kind == 'AXIS']


def length(run: Sequence[Lexeme]) -> Lexeme | None:
    """'3 m', and '2,5 m' with a decimal comma; '1,500 m' may be thousands and is not known."""
    if len(run) == 2:
        return joined(run, 'LENGTH', numbers_in(run)[0])
    if any(one.end != two.start for one, two in pairwise(run[:3])):
        return None
    units, decimals = str(run[0].value), str(run[2].value)
    is_thousand = len(decimals) == 3 and units.lstrip('-') != '0'
    if is_thousand or not (decimals.isdigit() and units.lstrip('-').isdigit()):
        return joined(run, 'UNKNOWN', f'{units},{decimals}')
    return joined(run, 'LENGTH', float(f'{units}.{decimals}') * run[3].number)


def point(run: Sequence[Lexeme]) -> Lexeme | None:
    """'20, 12', '(20, 12)' and 'x=20, y=12', the latter also in brackets."""
    is_point = axes_in(run) in ([], ['x', 'y'])
    return joined(run, 'POINT', tuple(numbers_in(run))) if is_point else None


def axis_line(run: Sequence[Lexeme]) -> Lexeme:
    """'y = 22.5', 'y 22.5' and 'y of 22.5', with or without a unit."""
    return joined(run, 'AXISLINE', (run[0].value, numbers_in(run)[0]))


def axis_range(run: Sequence[Lexeme]) -> Lexeme | None:
    """'x below 10', 'y > 3', 'x from 2 to 5' and 'between y = 5 and y = 20' as a Box."""
    limits, (axis, *others) = numbers_in(run), axes_in(run)
    if len(limits) == 1:
        limits = [*limits, math.inf] if run[1].kind == 'ABOVE' else [-math.inf, *limits]
    low, high = limits
    return None if {*others} - {axis} else joined(run, 'RANGE', (axis_box(axis, low, high),))


def axis_box(axis: str, low: float, high: float) -> Box:
    """Return the Box with one coordinate within limits."""
    if axis == 'x':
        return Box(low, -math.inf, high, math.inf)
    return Box(-math.inf, low, math.inf, high)


def times(run: Sequence[Lexeme]) -> Lexeme | None:
    """'at most twice', 'exactly 3 times', 'at least 1 and at most 2 times', 'twice or more'.

    The value is the least and the most (None for any number), and whether 'not' turns it round.
    """
    if run[0].value == 'any':
        return joined(run, 'TIMES', (0, None, False))
    least, most, found = 0, None, []
    groups = groupby(run, lambda one: one.kind == 'AND')
    for part in (list(group) for is_and, group in groups if not is_and):
        kinds = [one.kind for one in part]
        limits = (kind for kind in (kinds[0], *kinds[::-1]) if kind in KINDS.limits | {'ORMORE'})
        value = next(one.number for one in part if one.kind in ('NUMBER', 'TIMES'))
        if not value == int(value) >= 0:
            return None
        limit = next(limits, 'EXACTLY')
        found.append(limit)
        least = int(value) + (limit == 'MORETHAN') if limit in KINDS.from_below else least
        most = int(value) - (limit == 'LESSTHAN') if limit in KINDS.from_above else most
    is_told = any(one.kind in ('TIMES', 'TIMESWORD') for one in run)
    turns = found in (['MORETHAN'], ['LESSTHAN'])
    return joined(run, 'TIMES', (least, most, turns)) if is_told else None


def moment(run: Sequence[Lexeme]) -> Lexeme:
    """'before noon', 'within 5 minutes', 'wait 5 minutes', 'wait for the nurse'."""
    first = run[0]
    about = {'UNSUPPORTED': first.value, 'CONDITION': first.other_value, 'PURPOSE': 'waiting'}
    return joined(run, 'UNSUPPORTED', about.get(first.kind) or 'time')


def following(run: Sequence[Lexeme]) -> Lexeme:
    """'follow the nurse'."""
    return joined(run, 'UNSUPPORTED', 'following')


def errand(run: Sequence[Lexeme]) -> Lexeme:
    """'pick up the box', which is no more than an action."""
    return joined(run, 'FETCH', 'errand')


# The first one whose run is found counts.
COMBINE = (times, errand, following, moment, length, point, axis_range, axis_line)


@cache
def combinations() -> list[tuple[re.Pattern[str], Callable[[Sequence[Lexeme]], Lexeme | None]]]:
    """Return what runs of lexemes look like, of `runs.yaml`, and what puts each together."""
    runs: dict[str, str] = {}
    for name, pattern in read_table('runs').items():
        runs[name] = pattern % runs
    return [(re.compile(runs[one.__name__]), one) for one in COMBINE]


def combined(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes with numbers, units and axes put together, in one pass."""
    result: list[Lexeme] = []
    text = ''.join(f'{tag_of(lexeme)} ' for lexeme in lexemes)
    at = begin = 0
    while at < len(lexemes):
        for pattern, combine in combinations():
            match = pattern.match(text, begin)
            run = lexemes[at : at + match[0].count(' ')] if match else ()
            lexeme = combine(run) if run else None
            if lexeme is not None:
                break
        else:
            run, lexeme = lexemes[at : at + 1], lexemes[at]
        at += len(run)
        begin += sum(len(tag_of(one)) + 1 for one in run)
        joins_area = [one.kind for one in result[-3:]] == ['AREAWITH', 'RANGE', 'AND']
        if lexeme.kind == 'RANGE' and joins_area:
            # 'with x from 1 to 2 | and y above 3' goes on with the area.
            limits = (*result[-2].value, *lexeme.value)
            result[-2:] = [joined((result[-2], lexeme), 'RANGE', limits)]
        else:
            result.append(lexeme)
    return result


def told_apart(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes of two kinds as the one that goes with their neighbours.

    'y = 3' is an axis in Spanish, too, and 'um A' is around it in German, 'um 3 m' by so much.
    """
    result: list[Lexeme] = []
    for at, (lexeme, after) in enumerate(zip(lexemes, kinds_after(lexemes))):
        before = result[-1].kind if result else ''
        is_other = (
            (lexeme.other == 'AXIS' and [*map(tag_of, lexemes[at + 1 : at + 2])] == ['='])
            or (lexeme.other in ('ABOVE', 'BELOW') and 'AXIS' in (before, after))
            or (lexeme.other == 'SIDE' and before in KINDS.before_sides)
            or (lexeme.other == 'AROUND' and after not in ('NUMBER', 'LENGTH'))
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


def without_fillers(scanned: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes without articles and filling words; the doubt about one goes to the next.

    After a place a letter, or a word such as 'path', is a part of a name that the map lacks.
    """
    kept: list[Lexeme] = []
    doubts: tuple[tuple[str, str], ...] = ()
    was_article = False
    for lexeme, after in zip(scanned, kinds_after(scanned)):
        before = kept[-1] if kept else Lexeme('', '', 0, -1)
        is_name = is_part_of_name(before, lexeme, after) or (
            was_article and lexeme.kind in ('MUST', 'THEN') and lexeme.value not in KINDS.unnaming
        )
        # 'then second bench': a link already, so it tells which one.
        is_name |= before.kind == 'THEN' == lexeme.kind and lexeme.other == 'ORDINAL'
        was_article = lexeme.kind == 'ARTICLE'
        if is_name:
            kept.append(replace(lexeme, kind='UNKNOWN'))
        elif lexeme.value == BEFORE_GOAL and 'NEG' in {one.kind for one in kept}:
            goal = replace(lexeme, kind='ENDPOINT', value='goal')
            kept += [replace(lexeme, kind='BEFORE', value=''), goal]
        elif lexeme.kind in KINDS.left_out:
            doubts += lexeme.doubts
        else:
            kept.append(replace(lexeme, doubts=doubts + lexeme.doubts))
            doubts = ()
    if doubts and kept:
        kept[-1] = replace(kept[-1], doubts=kept[-1].doubts + doubts)
    return kept


def is_part_of_name(place: Lexeme, lexeme: Lexeme, after: str) -> bool:
    """Whether a word right after a place makes another name of it, that the map lacks."""
    if place.kind not in ('PLACE', 'NOUN'):
        return False
    if lexeme.kind == 'MUST':
        return lexeme.value in KINDS.parts_of_names
    is_letter = lexeme.end - lexeme.start == 1 and place.end + 1 == lexeme.start
    if lexeme.kind in ('AND', 'OR'):
        return is_letter and not after
    return (
        is_letter and lexeme.kind in ('ARTICLE', 'ANY_ARTICLE') and after not in KINDS.with_article
    )


def in_context(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Settle articles and nouns by the lexemes next to them.

    'a' means any one before a noun and nothing elsewhere; a noun that means one place is it.
    """
    result: list[Lexeme] = []
    for lexeme, after in zip(lexemes, [*lexemes[1:], None]):
        following = after.kind if after else ''
        if lexeme.kind == 'ANY_ARTICLE':
            if following == 'NOUN' or following in KINDS.adjectives:
                result.append(replace(lexeme, kind='ANY', value='any'))
            continue
        if lexeme.kind == 'THIS':
            is_group = after is not None and following != 'PLACE' and as_place(after) is after
            if is_group and (following == 'NOUN' or following in KINDS.adjectives):
                result.append(replace(lexeme, kind='UNKNOWN'))
            continue
        before = result[-1] if result else Lexeme('', '', 0, 0)
        if any(tells_all(other, lexeme) for other in (before, after)):
            # What is left are the doubts of other words than the noun itself.
            lexeme = replace(lexeme, doubts=tuple(one for one in lexeme.doubts if one[1]))  # noqa: PLW2901
        result.append(lexeme if before.kind in KINDS.adjectives else as_place(lexeme))
    return result


def tells_all(tag: Lexeme | None, noun: Lexeme) -> bool:
    """Whether a tag of the map tells the places, whatever the noun beside it: 'blue rooms'."""
    if tag is None or tag.kind != 'TAG' or tag.doubts or not isinstance(noun.value, Group):
        return False
    return set(noun.value.all_places.with_tag(str(tag.value))) <= set(noun.value.places)


def as_place(lexeme: Lexeme) -> Lexeme:
    """Return a noun that means exactly one place as that place; walls in plural stay a group."""
    group = lexeme.value
    if not isinstance(group, Group) or len(group.places) != 1:
        return lexeme
    if group.noun == WALL and group.plural:
        return lexeme
    is_part = group.own == HEAD and not lexeme.doubts
    doubts = ((group.words, ''),) if is_part else lexeme.doubts
    return replace(lexeme, kind='PLACE', value=group.places[0], doubts=doubts)


def composed(scanned: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes without filling words, those put together that mean one thing."""
    return settled(in_context(combined(told_apart(with_pronouns(without_fillers(scanned))))))
