# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Measures the check that decides whether a reading may be claimed, by itself.

Right readings, as a perfect model would give them, are handed to it, and wrong ones: each is the
right one with its verb, place, side, order, number, negation or scope changed.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_planner.instructions.grammar.selection import OPPOSITE
from llm_astar_planner.instructions.reader.check import doubt_about

from llm_astar_lab.report.table import markdown_table

RIGHT, WRONG, ALL = 'right', 'all wrong ones', 'all'
Counts = Counter[tuple[str, str, bool]]
Json = dict[str, Any]
Clauses = list[Json]
# Yields what may stand in the place of a clause; the names are those of places to exchange.
Change = Callable[[Json, Sequence[str]], Iterator[Clauses]]
# A clause of one region taken for another, and of two.
VERBS = {
    'avoid': 'stay_in', 'stay_in': 'end_at', 'end_at': 'stay_in', 'keep_distance': 'avoid',
    'before': 'then', 'then': 'before', 'never_after': 'before', 'pass': 'stay_in',
    'count': 'end_at',
}  # fmt: skip
REGION_FIELDS = ('region', 'from', 'first', 'second')


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
            sums = (kind,) if kind == RIGHT else (kind, WRONG)
            found.update((word, sum_, passes) for word in (case.language, ALL) for sum_ in sums)
    return found


def table(found: Counts) -> str:
    """Return the counts in Markdown: a row for each kind of change, a column for each language."""
    languages = [*sorted({language for language, _, _ in found} - {ALL}), ALL]
    kinds = (RIGHT, *CHANGES, WRONG)
    rows = [(kind, *(cell(found, language, kind) for language in languages)) for kind in kinds]
    return markdown_table(('reading', *languages), rows)


def cell(found: Counts, language: str, kind: str) -> str:
    """Return how many readings of a kind pass, and the share."""
    passed = found[language, kind, True]
    count = passed + found[language, kind, False]
    return f'{passed} of {count}, {100 * passed / max(1, count):.1f} %'


def readings(case: CheckCase) -> Iterator[tuple[str, Clauses]]:
    """Yield the right readings of a sentence, and wrong ones with what was changed."""
    truths = [[*truth] for truth in case.truths]
    yield from ((RIGHT, truth) for truth in truths)
    for kind, change in CHANGES.items():
        for clauses in changed(truths[0], case.places, change) if truths else ():
            if clauses and clauses not in truths:
                yield kind, clauses


def changed(clauses: Clauses, places: Places, change: Change) -> Iterator[Clauses]:
    """Yield clauses with one of them changed, for each way, and as a whole in another order."""
    names = [*named(clauses), *(place.name for place in places)]
    for at, clause in enumerate(clauses):
        for others in change(clause, names):
            yield [*clauses[:at], *others, *clauses[at + 1 :]]
    if change is orders:
        yield from reordered(clauses)


def verbs(clause: Json, _: Sequence[str]) -> Iterator[Clauses]:
    """Yield another kind of clause."""
    kind = VERBS.get(clause['kind'])
    if clause['kind'] == 'visit' and len(clause['regions']) == 1:
        yield [{'kind': 'end_at', 'region': clause['regions'][0]}]
    elif kind is not None and 'first' in clause:
        yield [{**clause, 'kind': kind}]
    elif kind is not None and clause.get('from') != 'walls':
        yield [{'kind': kind, 'region': clause.get('region', clause.get('from'))}]


def exchanged(clause: Json, names: Sequence[str]) -> Iterator[Clauses]:
    """Yield a clause with another place: another of the sentence, else of the map."""
    used = named([clause])
    new = next(({'place': name} for name in names if name not in used), None)
    if not used or new is None:
        return
    if clause['kind'] == 'visit':
        yield [{**clause, 'regions': [new, *clause['regions'][1:]]}]
    else:
        field = next(name for name in REGION_FIELDS if isinstance(clause.get(name), dict))
        yield [{**clause, field: new}]


def named(clauses: Sequence[Json]) -> list[str]:
    """Return the places that clauses name themselves."""
    regions = [clause.get(field) for clause in clauses for field in REGION_FIELDS]
    regions += [region for clause in clauses for region in clause.get('regions', ())]
    return [one['place'] for one in regions if isinstance(one, dict) and 'place' in one]


def orders(clause: Json, _: Sequence[str]) -> Iterator[Clauses]:
    """Yield a clause of two regions the other way round."""
    if 'first' in clause:
        yield [{**clause, 'first': clause.get('second'), 'second': clause.get('first')}]


def reordered(clauses: Clauses) -> Iterator[Clauses]:
    """Yield clauses with their visits in another order, and joined or apart."""
    visits = [clause for clause in clauses if clause['kind'] == 'visit']
    rest = [clause for clause in clauses if clause['kind'] != 'visit']
    if len(visits) > 1:
        yield [*visits[::-1], *rest]
    regions = [region for one in visits for region in one['regions']]
    if len(regions) > 1:
        some = [regions] if len(visits) > 1 else [[region] for region in regions]
        yield [*({**visits[0], 'regions': one} for one in some), *rest]


def sides(clause: Json, _: Sequence[str]) -> Iterator[Clauses]:
    """Yield a clause with the other side."""
    region = clause.get('region') or {}
    if 'side' in clause:
        yield [{**clause, 'side': OPPOSITE[clause['side']]}]
    elif 'half' in region:
        yield [{**clause, 'region': {**region, 'half': OPPOSITE[region['half']]}}]


def numbers(clause: Json, _: Sequence[str]) -> Iterator[Clauses]:
    """Yield a clause with another number."""
    for name in ('metres', 'at_least', 'at_most'):
        if clause.get(name):
            yield [{**clause, name: clause[name] + 1}]


def negations(clause: Json, _: Sequence[str]) -> Iterator[Clauses]:
    """Yield a visit in place of what is refused, or the other way round."""
    kept = {'strength': clause['strength']} if 'strength' in clause else {}
    if clause['kind'] in ('avoid', 'never_after'):
        yield [{**kept, 'kind': 'visit', 'regions': [clause.get('region', clause.get('second'))]}]
    elif clause['kind'] == 'visit':
        yield [{**kept, 'kind': 'avoid', 'region': one} for one in clause['regions']]


def scopes(clause: Json, _: Sequence[str]) -> Iterator[Clauses]:
    """Yield no clause, a wish for a demand or the other way round, and 'or' for 'and'."""
    yield []
    if clause['kind'] == 'unsupported':
        return
    plain = {key: value for key, value in clause.items() if key != 'strength'}
    yield [plain if clause.get('strength') == 'should' else {**plain, 'strength': 'should'}]
    if len(clause.get('regions', ())) > 1:
        yield [{**clause, 'regions': [{'any_of': clause['regions']}]}]


CHANGES: dict[str, Change] = {
    'verb': verbs, 'place': exchanged, 'side': sides, 'order': orders, 'number': numbers,
    'negation': negations, 'scope': scopes,
}  # fmt: skip
