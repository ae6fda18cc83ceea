"""Writes everything that is read of a results folder: summary, figures, reports."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, shortened
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.benchmark.analysis.statistics import Interval, Spread
from llm_astar_planner.benchmark.analysis.summary import (
    Growth,
    PairedComparison,
    Price,
    VariantSummary,
    by_variant,
    compare_with_none,
    growth,
    is_baseline,
    summarise,
)
from llm_astar_planner.benchmark.analysis.trace import trace
from llm_astar_planner.benchmark.datasets.samples import ProblemMap
from llm_astar_planner.benchmark.report.figures import (
    comparison_figure,
    growth_figure,
    ratio_figure,
    save_animation,
    showcase_figure,
    variant_label,
)
from llm_astar_planner.benchmark.report.html import html_report
from llm_astar_planner.benchmark.report.markdown import markdown_report
from llm_astar_planner.benchmark.report.sentences import headline, sentence
from llm_astar_planner.benchmark.results import (
    PAPER_ASTAR,
    ResultsError,
    ResultsFolder,
    Row,
    parse_points,
)
from llm_astar_planner.benchmark.runner.engine import SearchSettings, plan_again
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.waypoint_filter import target_list
from llm_astar_planner.visualization.figures import drawable_map

DPI = 90
Pictures = list[tuple[Path, str]]


def write_report(
    folder: ResultsFolder, metadata: Mapping[str, Any], maps: Sequence[ProblemMap]
) -> dict[str, Any]:
    """Write summary.json, the figures, report.md and report.html; return the summary as read back.

    `maps` are the unscaled maps of the rows, with their samples. Raises ResultsError.
    """
    rows = folder.read()
    seed = int(metadata['parameters'].get('seed', 0))
    price = metadata['parameters'].get('price')
    summaries = summarise(rows, seed, None if price is None else Price(*price))
    comparisons = compare_with_none(rows, seed)
    growths = growth(rows)
    summary: dict[str, Any] = {
        'headline': headline(comparisons),
        'sentences': [sentence(comparison) for comparison in comparisons if comparison.samples],
        'rows': len(rows),
        'cases': [to_json(item) for item in summaries],
        'over_none': [to_json(item) for item in comparisons],
        'growth': [to_json(item) for item in growths],
        **{name: metadata[name] for name in ('version', 'dataset', 'machine')},
        **{name: metadata[name] for name in ('left_out', 'notes') if name in metadata},
    }
    folder.write_json('summary.json', summary)
    pictures = draw_all(folder.path, rows, maps, (summaries, growths), metadata)
    names = [(path.name, caption) for path, caption in pictures]
    text = markdown_report(summaries, comparisons, growths, metadata, rows=rows, pictures=names)
    folder.write_text('report.md', text)
    page = html_report(
        summaries,
        comparisons,
        growths,
        metadata,
        rows=rows,
        maps=maps,
        costmap=search_settings(metadata).costmap,
        places=folder.read_places(),
        pictures=pictures,
    )
    folder.write_text('report.html', page)
    return folder.read_json('summary.json')


def to_json(item: VariantSummary | PairedComparison | Growth) -> dict[str, Any]:
    """Return the figures of a variant by name; named tuples become objects.

    The keys of the file are older than the word variant: `case` is its name. Shares of satisfied
    instructions are left out where nothing was asked.
    """
    values = asdict(item)
    del values['variant']
    if isinstance(item, VariantSummary):
        for name in values:
            value = getattr(item, name)
            if name in ('operation', 'storage', 'length', 'recorded') and value is not None:
                values[name] = {**value.mean._asdict(), 'spread': value.spread._asdict()}
            elif isinstance(value, (Interval, Spread)) and name != 'proven':
                values[name] = value._asdict()
        for name in ('instruction', 'recorded_instruction'):
            if math.isnan(values[name]['value']):
                del values[name]
    return {'case': str(item.variant), **values, **item.variant._asdict()}


def draw_all(
    folder: Path,
    rows: Sequence[Row],
    maps: Sequence[ProblemMap],
    figures: tuple[Sequence[VariantSummary], Sequence[Growth]],
    metadata: Mapping[str, Any],
) -> Pictures:
    """Draw every figure that the rows allow; return the files and their captions."""
    summaries, growths = figures
    pictures: Pictures = []
    if summaries:
        path = folder / 'ratios.png'
        ratio_figure(summaries).savefig(path, dpi=DPI)
        pictures.append((path, 'Operation and length against A*: models red, the rest grey.'))
    if growths:
        path = folder / 'growth.png'
        growth_figure(growths).savefig(path, dpi=DPI)
        pictures.append((path, 'Growth of work and storage with the scale of the map.'))
    pictures += draw_median_sample(folder, rows, maps, search_settings(metadata))
    if not metadata.get('bags'):
        path = folder / 'showcase.png'
        showcase_figure().savefig(path, dpi=DPI)
        caption = 'LLM-A* target by target on an 11 x 11 map, Chebyshev heuristic, and A* (pink).'
        pictures.append((path, caption))
    return pictures


def draw_median_sample(
    folder: Path, rows: Sequence[Row], maps: Sequence[ProblemMap], settings: SearchSettings
) -> Pictures:
    """Draw the sample whose saving over A* is the median: neither the best nor the worst."""
    stored = {item.id: len(item.samples) for item in maps}
    # A plan is drawn by planning again, without an instruction.
    drawable = [row for row in rows if row.pair < stored.get(row.map, 0) and not row.instruction]
    chosen = median_sample(drawable)
    if chosen is None:
        return []
    base, row = chosen
    barrier_map = next(item for item in maps if item.id == row.map)
    sample = barrier_map.samples[row.pair]
    endpoints = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
    grid_map = drawable_map(barrier_map.to_grid(), settings.costmap)
    plans = [plan_again(barrier_map, sample, item, settings) for item in (base, row)]
    titles = [variant_label(item.variant) for item in (base, row)]
    where = f'Map {row.map}, pair {row.pair}, the sample of median saving'
    path = folder / 'compare.png'
    comparison_figure(grid_map, plans, titles, endpoints).savefig(path, dpi=DPI)
    pictures: Pictures = [(path, f'{where}: what {titles[0]} and {titles[1]} expanded.')]
    if not isinstance(barrier_map, BarrierMap):
        # The animation replays the paper's rules, which do not hold on a grid.
        return pictures
    waypoints = [(int(x), int(y)) for x, y in parse_points(row.waypoints)]
    targets = target_list(plans[1].checked_waypoints, *endpoints)[1:]
    blocked = grid_map.blocked()
    plain, guided = trace(blocked, *endpoints), trace(blocked, *endpoints, targets)
    path = folder / 'search.gif'
    searches = [(titles[0], plain, ()), (titles[1], guided, waypoints)]
    save_animation(path, blocked, searches, endpoints)
    pictures.append((path, f'{where}: both searches at the same pace.'))
    return pictures


def median_sample(rows: Sequence[Row]) -> tuple[Row, Row] | None:
    """Return the rows of A* and LLM-A* for the sample with the median ratio of expansions."""
    variants = by_variant(rows)
    guided = [
        variant
        for variant in variants
        if variant.method == 'llm_astar' and variant.source != 'none'
    ]
    if not guided:
        return None
    chosen = min(guided, key=lambda variant: (is_baseline(variant), variant.source != 'oracle'))
    base = variants.get(PAPER_ASTAR, {})
    ratios = {
        sample: row.operation / base[sample].operation
        for sample, row in variants[chosen].items()
        if row.found and row.waypoints and sample in base and base[sample].found
    }
    if not ratios:
        return None
    median = statistics.median_low(ratios.values())
    sample = next(sample for sample, ratio in ratios.items() if ratio == median)
    return base[sample], variants[chosen][sample]


def search_settings(metadata: Mapping[str, Any]) -> SearchSettings:
    """Return the search settings of a run from its metadata."""
    names = (
        'heuristic', 'weight', 'time_limit', 'max_suboptimality', 'tolerance', 'start_tolerance',
        'paper_corners',
    )  # fmt: skip
    parameters = metadata['parameters']
    rules = parameters.get('rules')
    try:
        costmap = None if rules is None else CostmapConfig(**rules)
    except (TypeError, LlmAstarError) as error:
        raise ResultsError(f'metadata.json: parameters: rules: {shortened(str(error))}') from None
    return SearchSettings(
        **{name: parameters[name] for name in names if name in parameters}, costmap=costmap
    )
