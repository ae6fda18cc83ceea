# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Measures the check that decides whether a reading may be claimed, by itself.

Right readings, as a perfect model would give them, are handed to it, and wrong ones: each is the
right one with its verb, place, side, order, number, negation or scope changed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_planner.instructions.grammar.selection import OPPOSITE
from llm_astar_planner.instructions.reader.check import doubt_about

RIGHT, WRONG, ALL = 'right', 'all wrong ones', 'all'
Counts = Counter[tuple[str, str, bool]]
Json = dict[str, Any]
Clauses = list[Json]
# A clause of one region taken for another, and of two.
VERBS = {
    'avoid': 'stay_in', 'stay_in': 'end_at', 'end_at': 'stay_in', 'keep_distance': 'avoid',
    'before': 'then', 'then': 'before', 'never_after': 'before', 'pass': 'stay_in',
    'count': 'end_at',
}  # fmt: skip
REGIONS = ('region', 'from', 'first', 'second')


@dataclass(frozen=True)
class CheckCase:
    """A sentence about places, and all that it may mean, each a list of clauses in JSON."""

    text: str
    places: Places
    language: str
    truths: Sequence[Sequence[Json]]


def measured(cases: Iterable[CheckCase]) -> Counts:
    """Return how many readings there are by language and by what was changed, and if they pass."""
    found: Counts = Counter()
    for case in cases:
        for kind, clauses in readings(case):
            passes = not doubt_about(case.text, case.places, clauses)
            found[case.language, kind, passes] += 1
    return found


def table(found: Counts) -> str:
    """Return the counts in Markdown: a row for each kind of change, a column for each language."""
    languages = [*sorted({language for language, _, _ in found}), ALL]
    for (language, kind, passes), count in list(found.items()):
        found[ALL, kind, passes] += count
        if kind != RIGHT:
            found[language, WRONG, passes] += count
            found[ALL, WRONG, passes] += count
    lines = [['reading', *languages], ['---'] * (len(languages) + 1)]
    lines += [
        [kind, *(cell(found, language, kind) for language in languages)]
        for kind in (RIGHT, *CHANGES, WRONG)
    ]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def cell(found: Counts, language: str, kind: str) -> str:
    """Return how many readings of a kind pass, and the share."""
    passed = found[language, kind, True]
    count = passed + found[language, kind, False]
    return f'{passed} of {count}, {100 * passed / max(1, count):.1f} %'


def readings(case: CheckCase) -> Iterator[tuple[str, Clauses]]:
    """Yield the right readings of a sentence, and wrong ones with what was changed."""
    for truth in case.truths:
        yield RIGHT, [*truth]
    for kind, change in CHANGES.items():
        for clauses in change([*case.truths[0]], case.places) if case.truths else ():
            if clauses and clauses not in [[*truth] for truth in case.truths]:
                yield kind, clauses


def each(clauses: Clauses, change: Callable[[Json], Json | None]) -> Iterator[Clauses]:
    """Yield clauses with one of them changed, for each that can be."""
    for at, clause in enumerate(clauses):
        other = change(clause)
        if other is not None:
            yield [*clauses[:at], other, *clauses[at + 1 :]]


def verbs(clauses: Clauses, _: Places) -> Iterator[Clauses]:
    """Yield clauses with one taken for another kind."""

    def other(clause: Json) -> Json | None:
        kind = VERBS.get(clause['kind'])
        if clause['kind'] == 'visit' and len(clause['regions']) == 1:
            return {'kind': 'end_at', 'region': clause['regions'][0]}
        if kind is None or clause.get('from') == 'walls':
            return None
        if 'first' in clause:
            return {**clause, 'kind': kind}
        return {'kind': kind, 'region': clause.get('region', clause.get('from'))}

    return each(clauses, other)


def exchanged(clauses: Clauses, places: Places) -> Iterator[Clauses]:
    """Yield clauses with another place in one: another of the sentence, else of the map."""
    names = list(dict.fromkeys([*named(clauses), *(place.name for place in places)]))

    def other(clause: Json) -> Json | None:
        used = named([clause])
        new = next(({'place': name} for name in names if name not in used), None)
        if not used or new is None:
            return None
        if clause['kind'] == 'visit':
            return {**clause, 'regions': [new, *clause['regions'][1:]]}
        field = next(name for name in REGIONS if isinstance(clause.get(name), dict))
        return {**clause, field: new}

    return each(clauses, other)


def named(clauses: Sequence[Json]) -> list[str]:
    """Return the places that clauses name themselves."""
    regions = [clause.get(field) for clause in clauses for field in REGIONS]
    regions += [region for clause in clauses for region in clause.get('regions', ())]
    return [one['place'] for one in regions if isinstance(one, dict) and 'place' in one]


def orders(clauses: Clauses, _: Places) -> Iterator[Clauses]:
    """Yield clauses in another order."""

    def other(clause: Json) -> Json | None:
        ends = {'first': clause.get('second'), 'second': clause.get('first')}
        return {**clause, **ends} if 'first' in clause else None

    yield from each(clauses, other)
    visits = [clause for clause in clauses if clause['kind'] == 'visit']
    rest = [clause for clause in clauses if clause['kind'] != 'visit']
    if len(visits) > 1:
        yield [*visits[::-1], *rest]
    regions = [region for one in visits for region in one['regions']]
    if len(regions) > 1:
        together, apart = [regions], [[region] for region in regions]
        some = together if len(visits) > 1 else apart
        yield [*({**visits[0], 'regions': one} for one in some), *rest]


def sides(clauses: Clauses, _: Places) -> Iterator[Clauses]:
    """Yield clauses with the other side in one."""

    def other(clause: Json) -> Json | None:
        region = clause.get('region') or {}
        if 'side' in clause:
            return {**clause, 'side': OPPOSITE[clause['side']]}
        turned = {**region, 'half': OPPOSITE[region['half']]} if 'half' in region else None
        return turned and {**clause, 'region': turned}

    return each(clauses, other)


def numbers(clauses: Clauses, _: Places) -> Iterator[Clauses]:
    """Yield clauses with another number in one."""
    for at, clause in enumerate(clauses):
        for name in ('metres', 'at_least', 'at_most'):
            if clause.get(name):
                yield [*clauses[:at], {**clause, name: clause[name] + 1}, *clauses[at + 1 :]]


def negations(clauses: Clauses, _: Places) -> Iterator[Clauses]:
    """Yield clauses with a visit in place of what is refused, or the other way round."""
    for at, clause in enumerate(clauses):
        kept = {'strength': clause['strength']} if 'strength' in clause else {}
        others: Clauses = []
        if clause['kind'] in ('avoid', 'never_after'):
            region = clause.get('region', clause.get('second'))
            others = [{**kept, 'kind': 'visit', 'regions': [region]}]
        elif clause['kind'] == 'visit':
            others = [{**kept, 'kind': 'avoid', 'region': one} for one in clause['regions']]
        if others:
            yield [*clauses[:at], *others, *clauses[at + 1 :]]


def scopes(clauses: Clauses, _: Places) -> Iterator[Clauses]:
    """Yield clauses without one, with a wish for a demand or the other way, or 'or' for 'and'."""
    for at, clause in enumerate(clauses):
        rest = [one for one in clauses if one is not clause]
        if rest:
            yield rest
        plain = {key: value for key, value in clause.items() if key != 'strength'}
        is_wish = clause.get('strength') == 'should'
        others = [plain if is_wish else {**plain, 'strength': 'should'}]
        if len(clause.get('regions', ())) > 1:
            others.append({**clause, 'regions': [{'any_of': clause['regions']}]})
        for other in others if clause['kind'] != 'unsupported' else ():
            yield [*clauses[:at], other, *clauses[at + 1 :]]


CHANGES: dict[str, Callable[[Clauses, Places], Iterator[Clauses]]] = {
    'verb': verbs, 'place': exchanged, 'side': sides, 'order': orders, 'number': numbers,
    'negation': negations, 'scope': scopes,
}  # fmt: skip
