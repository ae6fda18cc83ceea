"""The report as Markdown and as text: the finding, the paper's table, spreads, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_planner.benchmark.analysis.statistics import Interval
from llm_astar_planner.benchmark.analysis.summary import (
    Growth,
    PairedComparison,
    Ratio,
    VariantSummary,
    compare_with_none,
    is_learned,
    summarise,
)
from llm_astar_planner.benchmark.report.sentences import (
    counted,
    effect_on,
    growth_sentence,
    headline,
    method_label,
    recorded_sentence,
    sentence,
    variant_label,
)
from llm_astar_planner.benchmark.results import Row

# Table 1 of the paper as printed, on the paper's samples: method, model, prompt, then operation,
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
    'Variant', 'Operation p95', 'worst', 'Over exact A*', 'worst', 'Length p95', 'worst',
    'Proven within', 'Optimal (%)',
    'Source ms, median', 'p95', 'Search ms, median', 'p95', 'Round trip ms, median', 'p95',
)  # fmt: skip
WAYPOINT_HEAD = (
    'Variant', 'Waypoints per sample', 'Status (% of waypoints)', 'Tokens in', 'Tokens out',
    'Cost', 'Unanswered',
)  # fmt: skip
RECORDED_HEAD = 'Length / recorded plan (%)'
INSTRUCTION_HEAD = ('Instruction satisfied (%)', 'by the recorded plan (%)')
PATH_HEAD = (
    'Variant', 'Clearance, least (m)', 'mean', 'Turns, mean', 'Through unknown, mean (m)',
    RECORDED_HEAD, 'worst', *INSTRUCTION_HEAD,
)  # fmt: skip
COMPARISON_HEAD = ('Variant', 'Operation / none (%)', 'Length / none (%)', 'Effect')
TABLE_NOTE = (
    'Geometric means of the ratios to A* on the same sample, in percent, with 95 % confidence '
    'intervals by bootstrap over maps. The rows without a model show what a model is worth.'
)
GROWTH_NOTE = (
    'Mean growth factors against the same samples at scale 1. The slope is that of log growth '
    'over log scale: 1 is linear in the scale, 2 proportional to the area.'
)
PAPER_NOTE = (
    "On the paper's own 1000 samples, so it can only be compared with the rows above if they are "
    'of the same samples.'
)
# The lines of a README between which `replace_section` writes.
SECTION_BEGIN, SECTION_END = '<!-- results:begin -->', '<!-- results:end -->'
Table = list[tuple[str, ...]]


def markdown_report(
    summaries: Sequence[VariantSummary],
    comparisons: Sequence[PairedComparison],
    growths: Sequence[Growth],
    metadata: Mapping[str, Any],
    *,
    rows: Sequence[Row],
    pictures: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the report; `pictures` are (file name, caption) in the same folder."""
    parts = [
        f'# {report_title(metadata)}',
        headline(comparisons),
        recorded_sentence(rows) or '',
        provenance(metadata, summaries),
        '## The table',
        TABLE_NOTE,
        markdown_table(TABLE_HEAD, main_table(summaries)),
        '## What waypoints added over none',
        markdown_table(COMPARISON_HEAD, comparison_table(comparisons)),
        '\n'.join(f'- {sentence(comparison)}' for comparison in comparisons if comparison.samples),
        '## What the means hide',
        markdown_table(SPREAD_HEAD, spread_table(summaries)),
        '## Waypoints, tokens, cost',
        markdown_table(WAYPOINT_HEAD, waypoint_table(summaries)),
        '## The paths',
        markdown_table(PATH_HEAD, path_table(summaries)),
    ]
    for title, name in (('## Left out', 'left_out'), ('## Notes on the input', 'notes')):
        if lines := metadata.get(name):
            parts += [title, '\n'.join(f'- {line}' for line in lines)]
    if growths:
        parts += [
            '## Growth with the scale of the map',
            GROWTH_NOTE,
            markdown_table(*growth_table(growths)),
            growth_sentence(growths) or '',
        ]
    parts += [f'![{caption}]({file})\n\n{caption}' for file, caption in pictures]
    if not metadata.get('bags'):
        parts += [
            '## Table 1 of the paper, as printed',
            PAPER_NOTE,
            markdown_table(TABLE_HEAD, PAPER_TABLE),
        ]
    return '\n\n'.join(part for part in parts if part) + '\n'


def report_title(metadata: Mapping[str, Any]) -> str:
    """Return the title of a report on samples, or on bags by their names."""
    bags = metadata.get('bags')
    return f'Evaluation of bags: {", ".join(bags)}' if bags else 'Benchmark report'


def results_section(
    summaries: Sequence[VariantSummary],
    comparisons: Sequence[PairedComparison],
    metadata: Mapping[str, Any],
) -> str:
    """Return the part of a report for a README: finding, table, provenance."""
    table = markdown_table(TABLE_HEAD, main_table(summaries))
    return '\n\n'.join([headline(comparisons), table, provenance(metadata, summaries)])


def main_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the rows of the table in the paper's layout."""
    return [
        (
            method_label(summary.variant.method),
            f'{summary.variant.source} (learned, not an LLM)'
            if is_learned(summary.variant)
            else summary.variant.model or summary.variant.source,
            summary.variant.prompt or '-',
            percent(summary.operation.mean),
            percent(summary.storage.mean),
            percent(summary.length.mean),
            percent(summary.valid),
        )
        for summary in summaries
    ]


def comparison_table(comparisons: Sequence[PairedComparison]) -> Table:
    """Return the rows of the comparison with no waypoints."""
    return [
        (
            variant_label(comparison.variant),
            percent(comparison.operation),
            percent(comparison.length),
            effect_on(comparison.operation),
        )
        for comparison in comparisons
        if comparison.samples
    ]


def spread_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the rows on percentiles, maxima and times."""
    return [
        (
            variant_label(summary.variant),
            *(number(100 * value) for value in summary.operation.spread[2:]),
            percent_of(summary.operation_exact),
            worst_percent(summary.operation_exact),
            *(number(100 * value) for value in summary.length.spread[2:]),
            number(100 * summary.proven.worst),
            number(100 * summary.optimal, 1),
            *(number(1e3 * value, 3) for value in summary.seconds_source[1:3]),
            *(number(1e3 * value, 3) for value in summary.seconds_search[1:3]),
            *(number(1e3 * value, 3) for value in summary.seconds_round_trip[1:3]),
        )
        for summary in summaries
    ]


def waypoint_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the rows on waypoints, tokens and cost, for variants with a source."""
    return [
        (
            variant_label(summary.variant),
            number(summary.waypoints),
            ', '.join(f'{name} {100 * part:.1f}' for name, part in summary.verdicts.items())
            or '-',
            str(summary.prompt_tokens),
            str(summary.completion_tokens),
            '-' if summary.cost is None else f'{summary.cost:.4f}',
            str(summary.unanswered),
        )
        for summary in summaries
        if summary.variant.source != 'none'
    ]


def path_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the rows on clearance, turns and unknown cells of the paths."""
    return [
        (
            variant_label(summary.variant),
            number(summary.least_clearance),
            number(summary.clearance.mean),
            number(summary.turns.mean, 1),
            number(summary.unknown_length.mean),
            percent_of(summary.recorded),
            worst_percent(summary.recorded),
            percent(summary.instruction),
            percent(summary.recorded_instruction),
        )
        for summary in summaries
    ]


def growth_table(growths: Sequence[Growth]) -> tuple[tuple[str, ...], Table]:
    """Return the header and the rows of the growth factors."""
    scales = sorted({scale for growth in growths for scale in growth.scales})
    head = ('Variant', 'Quantity', 'Samples', *(f'x{scale}' for scale in scales), 'Slope')
    rows: Table = []
    for growth in growths:
        factors = dict(zip(growth.scales, growth.factors))
        cells = (number(factors.get(scale, math.nan)) for scale in scales)
        name, count = variant_label(growth.variant), str(growth.samples)
        rows.append((name, growth.quantity, count, *cells, number(growth.slope)))
    return head, rows


def provenance(metadata: Mapping[str, Any], summaries: Sequence[VariantSummary]) -> str:
    """Say which samples, settings, version and machine the figures come from."""
    dataset, machine = metadata.get('dataset', {}), metadata.get('machine', {})
    parameters = metadata.get('parameters', {})
    most = max(summaries, key=lambda summary: summary.samples, default=None)
    size = ''
    if most is not None:
        size = f'{counted(most.samples, "sample")} of {counted(most.maps, "map")} from '
    heuristic = parameters.get('heuristic')
    sha = f' (sha256 {str(dataset["sha256"])[:12]})' if dataset.get('sha256') else ''
    facts = [
        f'{size}`{dataset["file"]}`{sha}' if 'file' in dataset else size.removesuffix(' from '),
        f'seed {parameters["seed"]}' if 'seed' in parameters else '',
        f'heuristic {heuristic}' if heuristic else '',
        f'llm_astar_planner {metadata["version"]}' if 'version' in metadata else '',
    ]
    text = ', '.join(fact for fact in facts if fact)
    if machine:
        text += (
            f'; run in {float(metadata.get("seconds") or 0.0):.1f} s with '
            f'{parameters.get("jobs", 1)} at once on {machine.get("cores")} cores of '
            f'{machine.get("processor")}, Python {machine.get("python")}'
        )
    return f'{text}.' if text else ''


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; empty without rows."""
    if not rows:
        return ''
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table for a terminal, its columns aligned."""
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    return '\n'.join(
        '  '.join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip()
        for line in lines
    )


def percent(interval: Interval) -> str:
    """Write a ratio in percent, with its interval unless that is a point or unknown."""
    value, low, high = (100 * end for end in interval)
    if math.isnan(value):
        return '-'
    if math.isnan(low) or math.isclose(low, high):
        return f'{value:.2f}'
    return f'{value:.2f} ({low:.2f} to {high:.2f})'


def number(value: float, digits: int = 2) -> str:
    """Write a number, or `-` for NaN."""
    return '-' if math.isnan(value) else f'{value:.{digits}f}'


def percent_of(ratio: Ratio | None) -> str:
    """Write the mean of a ratio in percent, or `-` where there is none."""
    return '-' if ratio is None else percent(ratio.mean)


def worst_percent(ratio: Ratio | None) -> str:
    """Write the largest of some ratios in percent, or `-` where there are none."""
    return '-' if ratio is None else number(100 * ratio.spread.worst)


def text_report(rows: Sequence[Row], seed: int = 0) -> str:
    """Return the finding and the table for a terminal; for bags also the recorded lengths."""
    summaries = summarise(rows, seed)
    head: Sequence[str] = TABLE_HEAD
    table = main_table(summaries)
    if any(summary.recorded for summary in summaries):
        head = (*head, RECORDED_HEAD)
        recorded = [percent_of(summary.recorded) for summary in summaries]
        table = [(*line, cell) for line, cell in zip(table, recorded)]
    for title, name in zip(INSTRUCTION_HEAD, ('instruction', 'recorded_instruction')):
        shares: list[Interval] = [getattr(summary, name) for summary in summaries]
        if not all(math.isnan(share.value) for share in shares):
            head = (*head, title)
            table = [(*line, percent(share)) for line, share in zip(table, shares)]
    sentences = [recorded_sentence(rows), headline(compare_with_none(rows, seed))]
    return '\n'.join([text_table(head, table), '', *filter(None, sentences)])


def replace_section(path: Path, section: str) -> None:
    """Put `section` between the marker lines of a text file and leave the rest unchanged.

    Raises ValueError where the markers are missing or out of order, OSError where the file is.
    """
    text = path.read_text(encoding='utf-8')
    head, begin, rest = text.partition(SECTION_BEGIN)
    _, end, tail = rest.partition(SECTION_END)
    if not (begin and end):
        lines = f'{SECTION_BEGIN} and {SECTION_END}'
        raise ValueError(f'{path}: the lines {lines} are missing or out of order')
    path.write_text(
        f'{head}{SECTION_BEGIN}\n{section.strip()}\n{SECTION_END}{tail}', encoding='utf-8'
    )
