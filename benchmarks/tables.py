"""Tables of a folder of results, as text or in Markdown."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.ours import EXACT

Table = list[tuple[str, ...]]
Rows = list[dict[str, Any]]
Cases = dict[str, dict[str, Any]]
# Maps of up to so many cells are called so.
SIZES = (
    (4_000, '51x31'),
    (2**16, '100²'),
    (2**19, '512²'),
    (2**22, '1024²'),
    (2**25, '4096²'),
    (2**27, '8192²'),
)
# Percentiles of time ratios are taken over queries that take the exact search at least so long:
# in quicker ones the call from Python counts more than the search.
WORTH_MS = 0.1


def load(folder: Path, part: str) -> dict[str, Any]:
    """Return the results of a part by the names of their cases, small maps first."""
    found = {
        path.stem.removeprefix(f'{part} '): json.loads(path.read_text(encoding='utf-8'))
        for path in folder.glob(f'{part} *.json')
    }
    size = {
        name: one.get('cells', 0) if isinstance(one, dict) else 0 for name, one in found.items()
    }
    return dict(sorted(found.items(), key=lambda item: (size[item[0]], item[0])))


def report(folder: Path, *, markdown: bool) -> str:
    """Return all tables of a folder of results, each below a line that says what it holds."""
    search = load(folder, 'search')
    sections: list[tuple[str, Table]] = []
    for kind, graded in (('Uniform', False), ('Graded', True)):
        cases = {name: one for name, one in search.items() if one['graded'] is graded}
        sections += [
            (f'{kind} costs: time / {EXACT} (lowest to highest map)', by_size(cases, ratio)),
            (f'{kind} costs: milliseconds a query', by_size(cases, mean_of('milliseconds'))),
            (
                f'{kind} costs: milliseconds a map before',
                by_size(cases, mean_of('preparation_ms')),
            ),
            (f'{kind} costs: what the paths are like', paths(cases)),
            (
                f'{kind} costs: time / {EXACT} on each map, half the spread of rounds',
                by_map(cases),
            ),
        ]
    sections += [
        ('Bytes a cell beside the map: peak / held', memory(load(folder, 'memory'))),
        ('Live maps: CPU milliseconds', live(load(folder, 'live'))),
        ('Any waypoints: time / exact search', waypoints(load(folder, 'waypoints'))),
    ]
    draw = draw_markdown if markdown else draw_text
    return '\n\n'.join(f'{title}\n\n{draw(rows)}' for title, rows in sections if len(rows) > 1)


def by_size(cases: Cases, cell: Callable[[Rows], str]) -> Table:
    """Return a row for each planner and a column for each size of map, of `cell` of its rows."""
    sizes: dict[str, list[dict[str, Any]]] = {}
    for case in cases.values():
        label = next(name for most, name in SIZES if case['cells'] <= most)
        sizes.setdefault(label, []).append(case)
    lines: Table = [('', *(f'{label} ({len(some)})' for label, some in sizes.items()))]
    for planner in planners(cases):
        columns = [rows_of(planner, some) for some in sizes.values()]
        lines.append((planner, *(cell(rows) if rows else '' for rows in columns)))
    return lines


def rows_of(planner: str, cases: Iterable[dict[str, Any]]) -> Rows:
    """Return a planner's rows of the cases that it took part in."""
    return [row for case in cases for row in case['rows'] if row['planner'] == planner]


def ratio(rows: Rows) -> str:
    """Return the mean ratio of rows, and the lowest and the highest if there are several."""
    values = [row['ratio'] for row in rows]
    mean = number(geometric_mean(values))
    return mean if len(rows) == 1 else f'{mean} ({number(min(values))}-{number(max(values))})'


def mean_of(field: str) -> Callable[[Rows], str]:
    """Return the function that makes the geometric mean of a field."""
    return lambda rows: number(geometric_mean(max(row[field], 1e-6) for row in rows))


def planners(cases: Cases) -> list[str]:
    """Return the names of all planners that were measured, in order."""
    return list(dict.fromkeys(row['planner'] for one in cases.values() for row in one['rows']))


def by_map(cases: Cases) -> Table:
    """Return a row for each map and a column for each planner: the ratio of times."""
    names = planners(cases)
    lines: Table = [('', *names)]
    for case, one in cases.items():
        known = {row['planner']: row for row in one['rows']}
        cells = (
            f'{number(known[name]["ratio"])}±{number(half_spread(known[name]))}'
            if name in known
            else ''
            for name in names
        )
        lines.append((case, *cells))
    return lines


def half_spread(row: dict[str, Any]) -> float:
    """Return half the spread of the ratio over the rounds."""
    return float(row['ratio_high'] - row['ratio_low']) / 2


def paths(cases: Cases) -> Table:
    """Return a row for each planner: which of its paths are legal and optimal, and their cost."""
    lines: Table = [
        ('', 'version', 'maps', 'legal %', 'optimal %', 'mean cost', 'published lengths')
    ]
    for planner in planners(cases):
        own = [one for one in cases.values() if rows_of(planner, [one])]
        rows, queries = rows_of(planner, own), [one['queries'] for one in own]
        legal, optimal, excess = (
            float(np.average([row[field] for row in rows], weights=queries))
            for field in ('legal', 'optimal', 'excess')
        )
        equal, known = (sum(one['published'] for one in some) for some in (rows, own))
        shares = f'{100 * legal:.0f}', f'{100 * optimal:.0f}', f'{1 + excess:.3f}'
        lines.append((planner, rows[0]['version'], str(len(own)), *shares, f'{equal}/{known}'))
    return lines


def memory(results: dict[str, Any]) -> Table:
    """Return a row for each planner and a column for each case: peak and held bytes a cell."""
    names = list(dict.fromkeys(name for one in results.values() for name in one))
    lines: Table = [('', *results)]
    for name in names:
        cells = (one.get(name) for one in results.values())
        lines.append(
            (name, *(f'{one["peak"]:.0f}/{one["held"]:.0f}' if one else '' for one in cells))
        )
    return lines


def live(results: dict[str, Any]) -> Table:
    """Return a row for each size and way of taking live maps."""
    lines: Table = [
        ('cells a side', 'maps', 'to the first plan', 'p90', 'landmark upkeep', 'had landmarks %')
    ]
    for size, ways in sorted(results.items(), key=lambda item: int(item[0])):
        lines += [
            (
                size,
                way,
                number(one['plan_ms']),
                number(one['plan_p90_ms']),
                number(one['upkeep_ms']),
                f'{100 * one["had_landmarks"]:.0f}',
            )
            for way, one in ways.items()
        ]
    return lines


def waypoints(results: dict[str, Any]) -> Table:
    """Return a row for each waypoint set: percentiles of its time ratio over all queries."""
    every = [row for one in results.values() for row in one]
    rows = [row for row in every if row['exact_ms'] >= WORTH_MS]
    names = list(dict.fromkeys(row['waypoints'] for row in rows))
    sets = {name: [row for row in rows if row['waypoints'] == name] for name in names}
    sets |= {'all': rows, 'all, quick queries too': every}
    lines: Table = [('waypoints', '50 %', '99 %', 'worst', 'no landmarks: 50 %', '99 %', 'worst')]
    for name, own in sets.items() if rows else ():
        line = [name]
        for landmarks in (True, False):
            some = [row['ratio'] for row in own if row['landmarks'] is landmarks]
            line += [number(float(value)) for value in np.percentile(some, (50, 99, 100))]
        lines.append(tuple(line))
    return lines


def geometric_mean(values: Iterable[float]) -> float:
    """Return the geometric mean."""
    return math.exp(float(np.mean([math.log(value) for value in values])))


def number(value: float) -> str:
    """Return a number with two or three digits that matter."""
    if value >= 100:
        return f'{value:.0f}'
    return f'{value:.3g}' if value >= 1 else f'{value:.2g}'


def draw_text(rows: Sequence[tuple[str, ...]]) -> str:
    """Return rows as columns of text."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    return '\n'.join(
        '  '.join(text.ljust(width) for text, width in zip(row, widths)).rstrip() for row in rows
    )


def draw_markdown(rows: Sequence[tuple[str, ...]]) -> str:
    """Return rows as a Markdown table, the first as its head."""
    lines = [f'|{"|".join(row)}|' for row in rows]
    return '\n'.join([lines[0], '|---' * len(rows[0]) + '|', *lines[1:]])
