# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The tables of a report; `tables.yaml` says which columns they have."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from llm_astar_lab.analysis.replies import reply_shares
from llm_astar_lab.analysis.summary import Growth, RunSummary, VariantSummary
from llm_astar_lab.report.table import Table, descriptions

# Families that the tables show; summary.json has all.
MAX_FAMILIES = 12


def report_tables(run: RunSummary) -> list[Table]:
    """Return the tables of a report that have rows, in its order."""
    guided = [item for item in run.variants if item.variant.source != 'none']
    every = [
        main_table(run.variants),
        Table.of('over_none', [item for item in run.comparisons if item.samples]),
        Table.of('spread', run.variants), Table.of('waypoints', guided), reply_table(run.variants),
        Table.of('paths', run.variants), *family_tables(run.variants),
        growth_table(run.growths),
        Table.of('paper', () if run.metadata.get('bags') else descriptions()['paper']['items']),
    ]  # fmt: skip
    return [table for table in every if table.rows]


def main_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table in the paper's layout."""
    return Table.of('main', summaries)


def reply_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of what was wrong with each model's replies, once for all methods."""
    of_model = {item.variant[1:]: item for item in reversed(summaries) if item.replies}
    chosen = reversed(of_model.values())
    return Table.of(
        'replies', [vars(item) | {'reply_shares': reply_shares(item.replies)} for item in chosen]
    )


def family_tables(summaries: Sequence[VariantSummary]) -> Iterator[Table]:
    """Yield the tables by family of maps; without rows where there are no two families."""
    every = list(dict.fromkeys(name for item in summaries for name in item.families))
    names = every[:MAX_FAMILIES]
    note = f' The first {len(names)} of {len(every)} families.' if names != every else ''
    complete = [
        vars(item) | {'families': [item.families[name] for name in names]}
        for item in summaries
        if names and all(name in item.families for name in names)
    ]
    left_out = [
        vars(item) | {'without': [means.without[name] for name in names]}
        for item in summaries
        if (means := item.family_means).without
    ]
    shown = {
        'families': [
            item for item in complete if any(f.operation.value > 0 for f in item['families'])
        ],
        'families_valid': [
            item for item in complete if any(f.valid.value < 1.0 for f in item['families'])
        ],
        'families_left_out': left_out,
    }
    for name, items in shown.items():
        yield Table.of(name, items, [label or 'unknown' for label in names], more=note)


def growth_table(growths: Sequence[Growth]) -> Table:
    """Return the table of growth factors, with a column for each scale."""
    scales = sorted({scale for growth in growths for scale in growth.scales})
    items = []
    for growth in growths:
        factors = dict(zip(growth.scales, growth.factors))
        known = [factors.get(scale, math.nan) for scale in scales]
        items.append(vars(growth) | {'factors': known})
    return Table.of('growth', items, [str(scale) for scale in scales])
