"""The tables of a report as data: columns, and rows of texts, numbers and intervals.

`formats.py` writes a table as Markdown, LaTeX, CSV or text; `report_tables` lists all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from llm_astar_lab.analysis.replies import REPLIES, reply_shares
from llm_astar_lab.analysis.statistics import UNKNOWN, Interval, Ratio
from llm_astar_lab.analysis.summary import (
    Growth,
    PairedComparison,
    RunSummary,
    VariantSummary,
    is_learned,
)
from llm_astar_lab.report.dataset_tables import family_tables, map_cost_table
from llm_astar_lab.report.sentences import effect_on, method_label, variant_label
from llm_astar_lab.report.table import (
    Cell,
    Column,
    Table,
    milliseconds,
    percents,
    texts,
)
from llm_astar_lab.results.row import Variant

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
MAIN_COLUMNS = (
    *texts('Methodology', 'Base model or source', 'Prompt'),
    *percents(
        'Operation ratio ↓ (%)', 'Storage ratio ↓ (%)', 'Relative path length ↓ (%)',
        'Valid path ratio ↑ (%)', 'Optimal paths ↑ (%)',
    ),
)  # fmt: skip
SPREAD_COLUMNS = (
    *texts('Variant'),
    *percents(
        'Operation p95', 'Operation worst', 'Over exact A*', 'Over exact A*, worst',
        'Length p95', 'Length worst', 'Proven within',
    ),
    *milliseconds(
        'Source ms, median', 'Source ms, p95', 'Search ms, median', 'Search ms, p95',
        'Round trip ms, median', 'Round trip ms, p95',
    ),
)  # fmt: skip
WAYPOINT_COLUMNS = (
    *texts('Variant'),
    Column('Waypoints per sample'),
    *texts('Status (% of waypoints)'),
    Column('Tokens in', digits=0),
    Column('Tokens out', digits=0),
    Column('Cost', digits=4),
    Column('Unanswered', digits=0),
)
# The shares of a model's replies, by their names in `reply_shares`.
REPLY_SHARES = {
    'parsed': 'Parsed (%)',
    'empty': 'Empty list (%)',
    'cut': 'Cut at the token limit (%)',
    'wrong_start_or_goal': 'Wrong start or goal (%)',
    'off_map': 'Off the map (%)',
    'on_obstacle': 'On obstacles (%)',
    'crosses_barrier': 'Crossing barriers (%)',
    'example_repeated': 'Example repeated (%)',
    'none': 'Nothing wrong (%)',
    'in_prompt': 'Sample in the prompt (%)',
}
REPLY_COLUMNS = (
    *texts('Model or source', 'Prompt'),
    Column('Replies', digits=0),
    *(Column(head, 100.0, 1) for head in REPLY_SHARES.values()),
    Column('Tokens in, mean', digits=1),
    Column('Tokens out, mean', digits=1),
    Column('Seconds, median'),
    Column('Seconds, p95'),
)
RECORDED_COLUMN = Column('Length / recorded plan (%)', 100.0)
INSTRUCTION_COLUMNS = percents('Instruction satisfied (%)', 'by the recorded plan (%)')
PATH_COLUMNS = (
    *texts('Variant'),
    Column('Clearance, least (m)'),
    Column('Clearance, mean (m)'),
    Column('Turns, mean', digits=1),
    Column('Through unknown, mean (m)'),
    RECORDED_COLUMN,
    *percents('Length / recorded plan, worst (%)'),
    *INSTRUCTION_COLUMNS,
)
COMPARISON_COLUMNS = (
    *texts('Variant'),
    *percents('Operation / none (%)', 'Length / none (%)'),
    *texts('Effect'),
)
TABLE_NOTE = (
    'Geometric means of the ratios to A* on the same sample, in percent, with 95 % confidence '
    'intervals by bootstrap over maps. The rows without a model show what a model is worth.'
)
REPLY_NOTE = (
    'Shares of all replies, with 95 % Wilson intervals. A reply may have several faults; whether '
    'it crosses barriers is told between those of its points that are free. The seconds are those '
    'of the recording.'
)
GROWTH_NOTE = (
    'Mean growth factors against the same samples at scale 1. The slope is that of log growth '
    'over log scale: 1 is linear in the scale, 2 proportional to the area.'
)
PAPER_NOTE = (
    "On the paper's own 1000 samples, so it can only be compared with the rows above if they are "
    'of the same samples.'
)


def report_tables(run: RunSummary) -> list[Table]:
    """Return the tables of a report that have rows, in its order."""
    every = [
        main_table(run.variants),
        comparison_table(run.comparisons),
        spread_table(run.variants),
        waypoint_table(run.variants),
        reply_table(run.variants),
        path_table(run.variants),
        *family_tables(run.variants),
        map_cost_table(run.metadata),
        growth_table(run.growths),
        paper_table(run.metadata),
    ]
    return [table for table in every if table.rows]


def main_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table in the paper's layout."""
    rows = [
        (
            method_label(summary.variant.method),
            model_label(summary.variant),
            summary.variant.prompt or '-',
            summary.operation.mean,
            summary.storage.mean,
            summary.length.mean,
            summary.valid,
            summary.optimal,
        )
        for summary in summaries
    ]
    return Table('main', 'The table', MAIN_COLUMNS, rows, TABLE_NOTE)


def model_label(variant: Variant) -> str:
    """Return the model or source of a variant, and what tells it from one of the same name."""
    if is_learned(variant):
        return f'{variant.source} (learned, not an LLM)'
    _, _, transcript = variant.source.partition('replay:')
    name = variant.model or variant.source
    return f'{name} ({transcript})' if transcript else name


def comparison_table(comparisons: Sequence[PairedComparison]) -> Table:
    """Return the comparison with no waypoints."""
    rows = [
        (
            variant_label(comparison.variant),
            comparison.operation,
            comparison.length,
            effect_on(comparison.operation),
        )
        for comparison in comparisons
        if comparison.samples
    ]
    return Table('over_none', 'What waypoints added over none', COMPARISON_COLUMNS, rows)


def spread_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of percentiles, maxima and times."""
    rows = [
        (
            variant_label(summary.variant),
            *summary.operation.spread[2:],
            mean_of(summary.operation_exact),
            worst_of(summary.operation_exact),
            *summary.length.spread[2:],
            summary.proven.worst,
            *summary.seconds_source[1:3],
            *summary.seconds_search[1:3],
            *summary.seconds_round_trip[1:3],
        )
        for summary in summaries
    ]
    return Table('spread', 'What the means hide', SPREAD_COLUMNS, rows)


def waypoint_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of waypoints, tokens and cost, for variants with a source."""
    rows = [
        (
            variant_label(summary.variant),
            summary.waypoints,
            ', '.join(f'{name} {100 * part:.1f}' for name, part in summary.verdicts.items())
            or '-',
            summary.prompt_tokens,
            summary.completion_tokens,
            math.nan if summary.cost is None else summary.cost,
            summary.unanswered,
        )
        for summary in summaries
        if summary.variant.source != 'none'
    ]
    return Table('waypoints', 'Waypoints, tokens, cost', WAYPOINT_COLUMNS, rows)


def reply_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of what was wrong with each model's replies, once for all methods."""
    of_model = {item.variant[1:]: item for item in reversed(summaries) if item.replies}
    rows: list[tuple[Cell, ...]] = []
    for item in reversed(of_model.values()):
        count, shares = item.replies[REPLIES], reply_shares(item.replies)
        rows.append(
            (
                model_label(item.variant),
                item.variant.prompt or '-',
                count,
                *(shares[name] for name in REPLY_SHARES),
                item.prompt_tokens / count,
                item.completion_tokens / count,
                *item.seconds_reply[1:3],
            )
        )
    return Table('replies', 'What was wrong with the replies', REPLY_COLUMNS, rows, REPLY_NOTE)


def path_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of clearance, turns and unknown cells of the paths."""
    rows = [
        (
            variant_label(summary.variant),
            summary.least_clearance,
            summary.clearance.mean,
            summary.turns.mean,
            summary.unknown_length.mean,
            mean_of(summary.recorded),
            worst_of(summary.recorded),
            summary.instruction,
            summary.recorded_instruction,
        )
        for summary in summaries
    ]
    return Table('paths', 'The paths', PATH_COLUMNS, rows)


def growth_table(growths: Sequence[Growth]) -> Table:
    """Return the table of growth factors, with a column for each scale."""
    scales = sorted({scale for growth in growths for scale in growth.scales})
    columns = (
        *texts('Variant', 'Quantity'),
        Column('Samples', digits=0),
        *texts(*(f'x{scale}' for scale in scales), 'Slope'),
    )
    rows: list[tuple[Cell, ...]] = []
    for growth in growths:
        factors = dict(zip(growth.scales, growth.factors))
        cells = (factors.get(scale, math.nan) for scale in scales)
        name = variant_label(growth.variant)
        rows.append((name, growth.quantity, growth.samples, *cells, growth.slope))
    return Table('growth', 'Growth with the scale of the map', columns, rows, GROWTH_NOTE)


def paper_table(metadata: Mapping[str, Any]) -> Table:
    """Return the paper's table as printed; without rows for a run on bags."""
    rows = () if metadata.get('bags') else PAPER_TABLE
    # The paper prints no share of optimal paths.
    columns = MAIN_COLUMNS[:-1]
    return Table('paper', 'Table 1 of the paper, as printed', columns, rows, PAPER_NOTE)


def mean_of(ratio: Ratio | None) -> Interval:
    """Return the mean of a ratio, unknown where there is none."""
    return UNKNOWN if ratio is None else ratio.mean


def worst_of(ratio: Ratio | None) -> float:
    """Return the largest of some ratios, NaN where there are none."""
    return math.nan if ratio is None else ratio.spread.worst
