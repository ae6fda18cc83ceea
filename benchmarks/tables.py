"""Tables of a folder of results, as text or in Markdown."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.ours import EXACT

Table = list[tuple[str, ...]]
# A percentile of time ratios is taken over queries that take the exact search so long.
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
        if cases:
            sections += [
                (
                    f'{kind} costs: time / {EXACT}, median of rounds ± half the spread',
                    ratios(cases),
                ),
                (f'{kind} costs: milliseconds of CPU a query', figures(cases, 'milliseconds')),
                (f'{kind} costs: milliseconds to prepare a map', figures(cases, 'preparation_ms')),
                (f'{kind} costs: means over cases', means(cases)),
            ]
    sections += [
        ('Bytes a cell beside the map: peak / held', memory(load(folder, 'memory'))),
        ('Live maps: CPU milliseconds', live(load(folder, 'live'))),
        ('Any waypoints: time / exact search', waypoints(load(folder, 'waypoints'))),
    ]
    draw = draw_markdown if markdown else draw_text
    return '\n\n'.join(f'{title}\n\n{draw(rows)}' for title, rows in sections if len(rows) > 1)


def ratios(cases: dict[str, Any]) -> Table:
    """Return a row for each planner and a column for each case: the ratio of times."""

    def cell(row: dict[str, Any]) -> str:
        spread = (row['ratio_high'] - row['ratio_low']) / 2
        return '1' if row['planner'] == EXACT else f'{number(row["ratio"])}±{number(spread)}'

    return by_planner(cases, cell)


def figures(cases: dict[str, Any], field: str) -> Table:
    """Return a row for each planner and a column for each case: one figure."""
    return by_planner(cases, lambda row: number(row[field]))


def by_planner(cases: dict[str, Any], cell: Any) -> Table:  # noqa: ANN401
    """Return a table with a row for each planner and a column for each case."""
    rows = {name: {row['planner']: row for row in one['rows']} for name, one in cases.items()}
    lines: Table = [('', *cases)]
    for planner in planners(cases):
        lines.append(
            (planner, *(cell(own[planner]) if planner in own else '' for own in rows.values()))
        )
    return lines


def planners(cases: dict[str, Any]) -> list[str]:
    """Return the names of all planners that were measured, in order."""
    return list(dict.fromkeys(row['planner'] for one in cases.values() for row in one['rows']))


def means(cases: dict[str, Any]) -> Table:
    """Return a row for each planner: its mean ratio over cases, and what its paths are like."""
    lines: Table = [
        ('', 'version', 'cases', 'time ratio', 'legal %', 'optimal %', 'length', 'published')
    ]
    for planner in planners(cases):
        took_part = [
            one for one in cases.values() if any(row['planner'] == planner for row in one['rows'])
        ]
        rows = [row for one in took_part for row in one['rows'] if row['planner'] == planner]
        queries = [one['queries'] for one in took_part]
        legal, optimal, excess = (
            float(np.average([row[field] for row in rows], weights=queries))
            for field in ('legal', 'optimal', 'excess')
        )
        equal, known = (sum(one['published'] for one in some) for some in (rows, took_part))
        ratio = number(geometric_mean(row['ratio'] for row in rows))
        shares = (f'{100 * legal:.0f}', f'{100 * optimal:.0f}', f'{1 + excess:.3f}')
        version = rows[0]['version']
        lines.append((planner, version, str(len(rows)), ratio, *shares, f'{equal}/{known}'))
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
    rows = [row for one in results.values() for row in one if row['exact_ms'] >= WORTH_MS]
    lines: Table = [('waypoints', '50 %', '99 %', 'worst', 'no landmarks: 50 %', '99 %', 'worst')]
    names = list(dict.fromkeys(row['waypoints'] for row in rows))
    for name in [*names, 'all'] if rows else ():
        own = [row for row in rows if name in (row['waypoints'], 'all')]
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
