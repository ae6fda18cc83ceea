"""The report as Markdown: the finding, the table in the paper's layout, what the means hide."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from llm_astar_planner.benchmark.analysis.scalability import Growth
from llm_astar_planner.benchmark.analysis.statistics import Interval
from llm_astar_planner.benchmark.analysis.summary import (
    CaseSummary,
    Contrast,
    is_learned,
    summarise,
)
from llm_astar_planner.benchmark.analysis.summary import contrasts as contrasts_of
from llm_astar_planner.benchmark.report.sentences import (
    counted,
    growth_sentence,
    headline,
    label,
    recorded_sentence,
    sentence,
    verdict,
)
from llm_astar_planner.benchmark.results import Row

# Table 1 of the paper as printed, on its own samples: method, model, prompt, then operation,
# storage, length and valid path ratio in percent.
PAPER_TABLE = (
    ('A*', '-', '-', '100', '100', '100', '100'),
    ('Dynamic WA* (w=2)', '-', '-', '60.91', '78.53', '100.24', '100'),
    ('LLM', 'GPT-3.5', 'Few-Shot', '-', '-', '119.38', '12.80'),
    ('LLM', 'GPT-3.5', 'CoT', '-', '-', '151.73', '15.20'),
    ('LLM', 'GPT-3.5', 'RePE', '-', '-', '183.87', '7.80'),
    ('LLM', 'LLAMA3', 'Few-Shot', '-', '-', '111.05', '12.60'),
    ('LLM', 'LLAMA3', 'CoT', '-', '-', '114.89', '12.00'),
    ('LLM', 'LLAMA3', 'RePE', '-', '-', '138.32', '16.40'),
    ('LLM-A*', 'GPT-3.5', 'Few-Shot', '57.39', '74.96', '102.44', '100'),
    ('LLM-A*', 'GPT-3.5', 'CoT', '69.50', '83.65', '102.54', '100'),
    ('LLM-A*', 'GPT-3.5', 'RePE', '85.47', '96.53', '102.41', '100'),
    ('LLM-A*', 'LLAMA3', 'Few-Shot', '44.59', '64.02', '102.47', '100'),
    ('LLM-A*', 'LLAMA3', 'CoT', '47.60', '66.27', '102.46', '100'),
    ('LLM-A*', 'LLAMA3', 'RePE', '64.08', '80.19', '102.54', '100'),
)
TABLE_HEAD = (
    'Methodology', 'Base model or source', 'Prompt', 'Operation ratio ↓ (%)',
    'Storage ratio ↓ (%)', 'Relative path length ↓ (%)', 'Valid path ratio ↑ (%)',
)  # fmt: skip
SPREAD_HEAD = (
    'Case', 'Operation p95', 'worst', 'Over exact A*', 'worst', 'Length p95', 'worst',
    'Proven within', 'Optimal (%)',
    'Source ms, median', 'p95', 'Search ms, median', 'p95', 'Round trip ms, median', 'p95',
)  # fmt: skip
WAYPOINT_HEAD = (
    'Case', 'Waypoints a sample', 'Verdicts (% of waypoints)', 'Tokens in', 'Tokens out', 'Cost',
    'Unanswered',
)  # fmt: skip
RECORDED_HEAD = 'Length / recorded plan (%)'
PATH_HEAD = (
    'Case', 'Clearance, least (m)', 'mean', 'Turns, mean', 'Through unknown, mean (m)',
    RECORDED_HEAD, 'worst',
)  # fmt: skip
CONTRAST_HEAD = ('Case', 'Operation / none (%)', 'Length / none (%)', 'WaypointStatus')
Table = list[tuple[str, ...]]


def report(
    summaries: Sequence[CaseSummary],
    contrasts: Sequence[Contrast],
    growths: Sequence[Growth],
    metadata: Mapping[str, Any],
    *,
    rows: Sequence[Row],
    pictures: Sequence[tuple[str, str]] = (),
) -> str:
    """Write the report; `pictures` are (file, caption) beside it."""
    parts = [
        f'# {title(metadata)}',
        headline(contrasts),
        recorded_sentence(rows),
        provenance(metadata, summaries),
        '## The table',
        'Geometric means of the ratios to A* on the same sample, in percent, with 95 % confidence '
        'intervals by bootstrap over maps. The rows without a model tell what a model is worth.',
        markdown_table(TABLE_HEAD, main_table(summaries)),
        '## What waypoints added over none',
        markdown_table(CONTRAST_HEAD, contrast_table(contrasts)),
        '\n'.join(f'- {sentence(contrast)}' for contrast in contrasts if contrast.samples),
        '## What the means hide',
        markdown_table(SPREAD_HEAD, spread_table(summaries)),
        '## Waypoints, tokens, cost',
        markdown_table(WAYPOINT_HEAD, waypoint_table(summaries)),
        '## The paths',
        markdown_table(PATH_HEAD, path_table(summaries)),
        *left_out_part(metadata),
        *_growth_part(growths),
        *(f'![{caption}]({file})\n\n{caption}' for file, caption in pictures),
        *_paper_part(metadata),
    ]
    return '\n\n'.join(part for part in parts if part) + '\n'


def title(metadata: Mapping[str, Any]) -> str:
    """Say what a report is of: samples, or bags by their names."""
    bags = metadata.get('bags')
    return f'Evaluation of bags: {", ".join(bags)}' if bags else 'Benchmark report'


def results_section(
    summaries: Sequence[CaseSummary], contrasts: Sequence[Contrast], metadata: Mapping[str, Any]
) -> str:
    """Write the part of a report that a README shows: finding, table, provenance."""
    table = markdown_table(TABLE_HEAD, main_table(summaries))
    return '\n\n'.join([headline(contrasts), table, provenance(metadata, summaries)])


def main_table(summaries: Sequence[CaseSummary]) -> Table:
    """Return the rows of the table in the paper's layout."""
    return [
        (
            label(summary.case.method),
            _who(summary),
            summary.case.prompt or '-',
            percent(summary.operation.mean),
            percent(summary.storage.mean),
            percent(summary.length.mean),
            percent(summary.valid),
        )
        for summary in summaries
    ]


def contrast_table(contrasts: Sequence[Contrast]) -> Table:
    """Return the rows of the comparison with no waypoints."""
    return [
        (
            str(contrast.case),
            percent(contrast.operation),
            percent(contrast.length),
            verdict(contrast.operation),
        )
        for contrast in contrasts
        if contrast.samples
    ]


def spread_table(summaries: Sequence[CaseSummary]) -> Table:
    """Return the rows on percentiles, worst cases and times."""
    return [
        (
            str(summary.case),
            *(number(100 * value) for value in summary.operation.spread[2:]),
            *_over_exact(summary),
            *(number(100 * value) for value in summary.length.spread[2:]),
            number(100 * summary.proven.worst),
            number(100 * summary.optimal, 1),
            *(number(1e3 * value, 3) for value in summary.seconds_source[1:3]),
            *(number(1e3 * value, 3) for value in summary.seconds_search[1:3]),
            *(number(1e3 * value, 3) for value in summary.seconds_round_trip[1:3]),
        )
        for summary in summaries
    ]


def _over_exact(summary: CaseSummary) -> tuple[str, str]:
    ratio = summary.operation_exact
    if ratio is None:
        return '-', '-'
    return percent(ratio.mean), number(100 * ratio.spread.worst)


def waypoint_table(summaries: Sequence[CaseSummary]) -> Table:
    """Return the rows on waypoints, tokens and cost, of the cases that had a source."""
    return [
        (
            str(summary.case),
            number(summary.waypoints),
            _shares(summary.verdicts),
            str(summary.prompt_tokens),
            str(summary.completion_tokens),
            '-' if summary.cost is None else f'{summary.cost:.4f}',
            str(summary.unanswered),
        )
        for summary in summaries
        if summary.case.source != 'none'
    ]


def path_table(summaries: Sequence[CaseSummary]) -> Table:
    """Return the rows on what a robot makes of the paths."""
    return [
        (
            str(summary.case),
            number(summary.least_clearance),
            number(summary.clearance.mean),
            number(summary.turns.mean, 1),
            number(summary.unknown_length.mean),
            _over_recorded(summary),
            '-' if summary.recorded is None else number(100 * summary.recorded.spread.worst),
        )
        for summary in summaries
    ]


def _over_recorded(summary: CaseSummary) -> str:
    return '-' if summary.recorded is None else percent(summary.recorded.mean)


def left_out_part(metadata: Mapping[str, Any]) -> list[str]:
    """Say what of the input is not in the figures, and what was odd about it."""
    parts: list[str] = []
    for title, name in (('## Left out', 'left_out'), ('## Notes on the input', 'notes')):
        lines = metadata.get(name) or []
        if lines:
            parts += [title, '\n'.join(f'- {line}' for line in lines)]
    return parts


def growth_table(growths: Sequence[Growth]) -> tuple[tuple[str, ...], Table]:
    """Return head and rows of the growth factors."""
    scales = sorted({scale for growth in growths for scale in growth.scales})
    head = ('Case', 'Quantity', 'Samples', *(f'x{scale}' for scale in scales), 'Slope')
    rows: Table = []
    for growth in growths:
        factors = dict(zip(growth.scales, growth.factors))
        cells = (number(factors.get(scale, math.nan)) for scale in scales)
        name, count = str(growth.case), str(growth.samples)
        rows.append((name, growth.quantity, count, *cells, number(growth.slope)))
    return head, rows


def provenance(metadata: Mapping[str, Any], summaries: Sequence[CaseSummary]) -> str:
    """Say in a few lines what the figures were made from and on."""
    dataset, machine = metadata.get('dataset', {}), metadata.get('machine', {})
    parameters = metadata.get('parameters', {})
    most = max(summaries, key=lambda summary: summary.samples, default=None)
    size = ''
    if most is not None:
        size = f'{counted(most.samples, "sample")} of {counted(most.maps, "map")} from '
    return (
        f'{size}`{dataset.get("file")}` (sha256 {str(dataset.get("sha256"))[:12]}), '
        f'seed {parameters.get("seed")}, heuristic {parameters.get("heuristic")}, '
        f'llm_astar_planner {metadata.get("version")}; run in '
        f'{float(metadata.get("seconds") or 0.0):.1f} s with {parameters.get("jobs")} at once on '
        f'{machine.get("cores")} cores of {machine.get("processor")}, '
        f'Python {machine.get("python")}.'
    )


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a Markdown table, empty for no rows."""
    if not rows:
        return ''
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def percent(interval: Interval) -> str:
    """Write a ratio in percent with its interval, left out where it is a point or unknown."""
    value, low, high = (100 * end for end in interval)
    if math.isnan(value):
        return '-'
    if math.isnan(low) or math.isclose(low, high):
        return f'{value:.2f}'
    return f'{value:.2f} ({low:.2f} to {high:.2f})'


def number(value: float, digits: int = 2) -> str:
    """Write a number, `-` for none."""
    return '-' if math.isnan(value) else f'{value:.{digits}f}'


def _shares(parts: Mapping[str, float]) -> str:
    return ', '.join(f'{name} {100 * part:.1f}' for name, part in parts.items()) or '-'


def _who(summary: CaseSummary) -> str:
    case = summary.case
    if is_learned(case):
        return f'{case.source} (learned, not an LLM)'
    return case.model or case.source


def _growth_part(growths: Sequence[Growth]) -> list[str]:
    if not growths:
        return []
    return [
        '## Growth with the scale of the map',
        'Mean growth factors against the same samples at scale 1. The slope is that of log growth '
        'over log scale: 1 is linear in the scale, 2 in step with the area.',
        markdown_table(*growth_table(growths)),
        growth_sentence(growths),
    ]


def _paper_part(metadata: Mapping[str, Any]) -> list[str]:
    """Show the paper's own figures, beside samples alone."""
    if metadata.get('bags'):
        return []
    return [
        '## Table 1 of the paper, as printed',
        'On its own 1000 samples, so not to be set against the rows above unless they are too.',
        markdown_table(TABLE_HEAD, PAPER_TABLE),
    ]


def text_report(rows: Sequence[Row], seed: int = 0) -> str:
    """Write the finding and the table for a terminal, of bags the lengths over the robot's own."""
    summaries = summarise(rows, seed)
    table = [TABLE_HEAD, *main_table(summaries)]
    if any(summary.recorded for summary in summaries):
        over = [RECORDED_HEAD, *map(_over_recorded, summaries)]
        table = [(*line, cell) for line, cell in zip(table, over)]
    widths = [max(map(len, column)) for column in zip(*table)]
    lines = [
        '  '.join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip()
        for line in table
    ]
    said = [recorded_sentence(rows), headline(contrasts_of(rows, seed))]
    return '\n'.join([*lines, '', *filter(None, said)])
