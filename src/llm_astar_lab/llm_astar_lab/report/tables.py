# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The tables of a report as data; `table.py` writes them as Markdown, LaTeX, CSV or text."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from llm_astar_msgs_adapter.errors import shortened

from llm_astar_lab.analysis.replies import REPLIES, reply_shares
from llm_astar_lab.analysis.summary import (
    FamilySummary,
    Growth,
    PairedComparison,
    RunSummary,
    VariantSummary,
    is_learned,
)
from llm_astar_lab.report.sentences import effect_on, method_label, variant_label
from llm_astar_lab.report.table import (
    Cell,
    Column,
    Table,
    columns,
    counts,
    milliseconds,
    percents,
    texts,
)
from llm_astar_lab.results.row import ResultsError, Variant

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
VARIANT = texts({'Variant': lambda item: variant_label(item.variant)})
MAIN_COLUMNS = (
    *texts({
        'Methodology': lambda item: method_label(item.variant.method),
        'Base model or source': lambda item: model_label(item.variant),
        'Prompt': lambda item: item.variant.prompt or '-',
    }),
    *percents({
        'Operation ratio ↓ (%)': 'operation.mean',
        'Storage ratio ↓ (%)': 'storage.mean',
        'Relative path length ↓ (%)': 'length.mean',
        'Valid path ratio ↑ (%)': 'valid',
        'Optimal paths ↑ (%)': 'optimal',
    }),
)  # fmt: skip
COMPARISON_COLUMNS = (
    *VARIANT,
    *percents({'Operation / none (%)': 'operation', 'Length / none (%)': 'length'}),
    *texts({'Effect': lambda item: effect_on(item.operation)}),
)
SPREAD_COLUMNS = (
    *VARIANT,
    *percents({
        'Operation p95': 'operation.spread.p95',
        'Operation worst': 'operation.spread.worst',
        'Over exact A*': 'operation_exact.mean',
        'Over exact A*, worst': 'operation_exact.spread.worst',
        'Length p95': 'length.spread.p95',
        'Length worst': 'length.spread.worst',
        'Proven within': 'proven.worst',
    }),
    *milliseconds({
        'Source ms, median': 'seconds_source.median',
        'Source ms, p95': 'seconds_source.p95',
        'Search ms, median': 'seconds_search.median',
        'Search ms, p95': 'seconds_search.p95',
        'Round trip ms, median': 'seconds_round_trip.median',
        'Round trip ms, p95': 'seconds_round_trip.p95',
    }),
)  # fmt: skip
WAYPOINT_COLUMNS = (
    *VARIANT,
    Column('Waypoints per sample', value='waypoints'),
    *texts({'Status (% of waypoints)': lambda item: shares_text(item.verdicts)}),
    *counts({'Tokens in': 'prompt_tokens', 'Tokens out': 'completion_tokens'}),
    Column('Cost', digits=4, value='cost'),
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
    *counts('Replies'),
    *columns(*REPLY_SHARES.values(), factor=100.0, digits=1),
    *columns('Tokens in, mean', 'Tokens out, mean', digits=1),
    *columns('Seconds, median', 'Seconds, p95'),
)
GROWTH_COLUMNS = (*texts({'Quantity': 'quantity'}), *counts({'Samples': 'samples'}))
RECORDED_COLUMN, *INSTRUCTION_COLUMNS = percents({
    'Length / recorded plan (%)': 'recorded.mean',
    'Instruction kept (%)': 'instruction',
    'by the recorded plan (%)': 'recorded_instruction',
})  # fmt: skip
PATH_COLUMNS = (
    *VARIANT,
    *columns({'Clearance, least (m)': 'least_clearance', 'Clearance, mean (m)': 'clearance.mean'}),
    Column('Turns, mean', digits=1, value='turns.mean'),
    Column('Through unknown, mean (m)', value='unknown_length.mean'),
    RECORDED_COLUMN,
    *percents({'Length / recorded plan, worst (%)': 'recorded.spread.worst'}),
    *INSTRUCTION_COLUMNS,
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
FAMILY_NOTE = 'Geometric means of the ratios to A* on the same sample, in percent.'
VALID_NOTE = 'Shares of the samples in percent, of the variants that miss some.'
LEFT_OUT_NOTE = (
    "Geometric means of the families' operation ratios, in which each family weighs the same: of "
    'all of them, and without one at a time. A figure that changes much hangs on that family. '
    'Intervals are by bootstrap over the maps of each family.'
)
# Families that the tables show; summary.json has all.
MAX_FAMILIES = 12
MAP_COST_NOTE = (
    "As in the Grid-Based Path Planning Competition: the time to prepare a map's planner, the "
    "memory that it then holds without the map's own cells, and the times of the searches."
)
# Maps that this table shows.
MAX_MAP_COSTS = 200


def report_tables(run: RunSummary) -> list[Table]:
    """Return the tables of a report that have rows, in its order."""
    compared = [item for item in run.comparisons if item.samples]
    guided = [item for item in run.variants if item.variant.source != 'none']
    every = [
        main_table(run.variants),
        comparison_table(compared),
        Table.of('spread', 'What the means hide', SPREAD_COLUMNS, run.variants),
        Table.of('waypoints', 'Waypoints, tokens, cost', WAYPOINT_COLUMNS, guided),
        reply_table(run.variants),
        Table.of('paths', 'The paths', PATH_COLUMNS, run.variants),
        *family_tables(run.variants),
        map_cost_table(run.metadata),
        growth_table(run.growths),
        paper_table(run.metadata),
    ]
    return [table for table in every if table.rows]


def main_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table in the paper's layout."""
    table = Table.of('main', 'The table', MAIN_COLUMNS, summaries, TABLE_NOTE)
    return table.with_column(*failure_column(summaries))


def comparison_table(comparisons: Sequence[PairedComparison]) -> Table:
    """Return what waypoints added over none, also without the failures of the source."""
    title = 'What waypoints added over none'
    table = Table.of('over_none', title, COMPARISON_COLUMNS, comparisons)
    table = table.with_column(*failure_column(comparisons))
    without = [item.answered[0] if item.failures else '-' for item in comparisons]
    return table.with_column(percents('Operation / none without them (%)')[0], without)


def failure_column(items: Sequence[Any]) -> tuple[Column, list[Cell]]:
    """Return the column of a source's failures, with how many samples each status has."""
    counts_of = (map('{0[0]} {0[1]}'.format, item.failures.items()) for item in items)
    return Column('Failed'), [', '.join(texts) or '-' for texts in counts_of]


def terminal_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table in the paper's layout, with what is known of bags and instructions."""
    table = main_table(summaries)
    for column in (RECORDED_COLUMN, *INSTRUCTION_COLUMNS):
        table = table.with_column(column, [column.cell(item) for item in summaries])
    return table


def model_label(variant: Variant) -> str:
    """Return the model or source of a variant, and what tells it from one of the same name."""
    if is_learned(variant):
        return f'{variant.source} (learned, not an LLM)'
    _, _, transcript = variant.source.partition('replay:')
    name = variant.model or variant.source
    return f'{name} ({transcript})' if transcript else name


def shares_text(shares: Mapping[str, float]) -> str:
    """Write named shares in percent, a dash for none."""
    return ', '.join(f'{name} {100 * part:.1f}' for name, part in shares.items()) or '-'


def reply_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of what was wrong with each model's replies, once for all methods."""
    of_model = {item.variant[1:]: item for item in reversed(summaries) if item.replies}
    rows: list[tuple[Cell, ...]] = []
    for item in reversed(of_model.values()):
        count, shares = item.replies[REPLIES], reply_shares(item.replies)
        rows.append((
            model_label(item.variant), item.variant.prompt or '-', count,
            *(shares[name] for name in REPLY_SHARES),
            item.prompt_tokens / count, item.completion_tokens / count, *item.seconds_reply[1:3],
        ))  # fmt: skip
    return Table('replies', 'What was wrong with the replies', REPLY_COLUMNS, rows, REPLY_NOTE)


def family_tables(summaries: Sequence[VariantSummary]) -> list[Table]:
    """Return the tables by family of maps; without rows where there are no two families."""
    every = list(dict.fromkeys(name for item in summaries for name in item.families))
    names = every[:MAX_FAMILIES]
    note = f' The first {len(names)} of {len(every)} families.' if names != every else ''
    complete = [
        (variant_label(item.variant), [item.families[name] for name in names])
        for item in summaries
        if names and all(name in item.families for name in names)
    ]

    def rows_of(figure: str, is_shown: Callable[[FamilySummary], bool]) -> list[tuple[Cell, ...]]:
        return [
            (label, *(getattr(part, figure) for part in parts))
            for label, parts in complete
            if any(map(is_shown, parts))
        ]

    operation = rows_of('operation', lambda part: part.operation.value > 0)
    valid = rows_of('valid', lambda part: part.valid.value < 1.0)
    left_out: list[tuple[Cell, ...]] = [
        (variant_label(item.variant), means.every, *(means.without[name] for name in names))
        for item in summaries
        if (means := item.family_means).without
    ]
    labels = [name or 'unknown' for name in names]
    heads = (*texts('Variant'), *percents(*(f'{label} (%)' for label in labels)))
    without = percents('All families (%)', *(f'without {label} (%)' for label in labels))
    left_title = 'Operation ratio without one family at a time'
    return [
        Table(
            'families', 'Operation ratio by family of maps', heads, operation, FAMILY_NOTE + note
        ),
        Table('families_valid', 'Valid paths by family of maps', heads, valid, VALID_NOTE + note),
        Table(
            'families_left_out', left_title, (heads[0], *without), left_out, LEFT_OUT_NOTE + note
        ),
    ]


def map_cost_table(metadata: Mapping[str, Any]) -> Table:
    """Return preprocessing, memory and query times by map, where they were measured.

    Raises ResultsError where the metadata has something else there.
    """
    costs = metadata.get('map_costs', ())
    try:
        variants = list(dict.fromkeys(name for cost in costs for name in cost['queries']))
        rows = [cost_row(cost, variants) for cost in costs[:MAX_MAP_COSTS]]
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ResultsError(f'metadata.json: map_costs: {shortened(str(error))}') from None
    heads = (
        *texts('Map', 'Family'),
        *counts('Cells'),
        *milliseconds('Preprocessing (ms)'),
        Column('Memory (MB)', 1e-6),
        *milliseconds(*(f'{name}, median query (ms)' for name in variants)),
        *milliseconds(*(f'{name}, slowest (ms)' for name in variants)),
    )
    note = MAP_COST_NOTE
    if len(costs) > len(rows):
        note += f' The first {len(rows)} of {len(costs)} maps; metadata.json has all.'
    return Table('map_costs', 'Preprocessing, memory and queries by map', heads, rows, note)


def cost_row(cost: Mapping[str, Any], variants: Sequence[str]) -> tuple[Cell, ...]:
    """Return the row of a map; a variant without a query there has no times."""
    queries = [cost['queries'].get(name, {}) for name in variants]
    cells = cost['width'] * cost['height']
    times = [query.get(name, math.nan) for name in ('median', 'worst') for query in queries]
    numbers = map(float, (cells, cost['seconds'], cost['bytes'], *times))
    return str(cost['name']), str(cost['family']), *numbers


def growth_table(growths: Sequence[Growth]) -> Table:
    """Return the table of growth factors, with a column for each scale."""
    scales = sorted({scale for growth in growths for scale in growth.scales})
    factors = {f'x{scale}': partial(factor_at, scale=scale) for scale in scales}
    heads = (*VARIANT, *GROWTH_COLUMNS, *columns({**factors, 'Slope': 'slope'}))
    return Table.of('growth', 'Growth with the scale of the map', heads, growths, GROWTH_NOTE)


def factor_at(growth: Growth, scale: int) -> float:
    """Return the growth from scale 1 to another, NaN where that was not run."""
    return dict(zip(growth.scales, growth.factors)).get(scale, math.nan)


def paper_table(metadata: Mapping[str, Any]) -> Table:
    """Return the paper's table as printed; without rows for a run on bags."""
    rows = () if metadata.get('bags') else PAPER_TABLE
    # The paper prints no share of optimal paths.
    heads = MAIN_COLUMNS[:-1]
    return Table('paper', 'Table 1 of the paper, as printed', heads, rows, PAPER_NOTE)
