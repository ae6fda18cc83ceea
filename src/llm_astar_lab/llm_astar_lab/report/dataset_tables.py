"""The tables about a run's datasets: figures by family of maps, and what each map costs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from llm_astar_msgs_adapter.errors import shortened

from llm_astar_lab.analysis.summary import VariantSummary
from llm_astar_lab.report.sentences import variant_label
from llm_astar_lab.report.table import (
    Cell,
    Column,
    Table,
    milliseconds,
    percents,
    texts,
)
from llm_astar_lab.results.row import ResultsError

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


def family_tables(summaries: Sequence[VariantSummary]) -> list[Table]:
    """Return the tables by family of maps; without rows where there are no two families."""
    every = list(dict.fromkeys(name for item in summaries for name in item.families))
    names = every[:MAX_FAMILIES]
    note = f' The first {len(names)} of {len(every)} families.' if names != every else ''
    labels = [name or 'unknown' for name in names]
    columns = (*texts('Variant'), *percents(*(f'{label} (%)' for label in labels)))
    operation: list[tuple[Cell, ...]] = []
    valid: list[tuple[Cell, ...]] = []
    left_out: list[tuple[Cell, ...]] = []
    for item in summaries:
        label, families = variant_label(item.variant), item.families
        found = [families[name] for name in names if name in families]
        if len(found) == len(names) and any(part.valid.value < 1.0 for part in found):
            valid.append((label, *(part.valid for part in found)))
        if len(found) == len(names) and any(part.operation.value > 0 for part in found):
            operation.append((label, *(part.operation for part in found)))
        if means := item.family_means.without:
            every_mean = item.family_means.every
            left_out.append((label, every_mean, *(means[name] for name in names)))
    heads = percents('All families (%)', *(f'without {label} (%)' for label in labels))
    return [
        Table(
            'families', 'Operation ratio by family of maps', columns, operation, FAMILY_NOTE + note
        ),
        Table(
            'families_valid', 'Valid paths by family of maps', columns, valid, VALID_NOTE + note
        ),
        Table(
            'families_left_out',
            'Operation ratio without one family at a time',
            (*texts('Variant'), *heads),
            left_out,
            LEFT_OUT_NOTE + note,
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
    columns = (
        *texts('Map', 'Family'),
        Column('Cells', digits=0),
        *milliseconds('Preprocessing (ms)'),
        Column('Memory (MB)', 1e-6),
        *milliseconds(*(f'{name}, median query (ms)' for name in variants)),
        *milliseconds(*(f'{name}, slowest (ms)' for name in variants)),
    )
    note = MAP_COST_NOTE
    if len(costs) > len(rows):
        note += f' The first {len(rows)} of {len(costs)} maps; metadata.json has all.'
    return Table('map_costs', 'Preprocessing, memory and queries by map', columns, rows, note)


def cost_row(cost: Mapping[str, Any], variants: Sequence[str]) -> tuple[Cell, ...]:
    """Return the row of a map; a variant without a query there has no times."""
    queries = [cost['queries'].get(name, {}) for name in variants]
    return (
        str(cost['name']),
        str(cost['family']),
        float(cost['width'] * cost['height']),
        float(cost['seconds']),
        float(cost['bytes']),
        *(float(times.get('median', math.nan)) for times in queries),
        *(float(times.get('worst', math.nan)) for times in queries),
    )
