"""From the rows of a results folder to everything that is read: summary, figures, reports."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.benchmark.analysis.scalability import Growth, growth
from llm_astar_planner.benchmark.analysis.summary import (
    CaseSummary,
    Price,
    by_case,
    contrasts,
    is_ablation,
    summarise,
)
from llm_astar_planner.benchmark.analysis.trace import trace
from llm_astar_planner.benchmark.datasets.samples import ProblemMap
from llm_astar_planner.benchmark.points import parse_points
from llm_astar_planner.benchmark.report.animation import save_animation
from llm_astar_planner.benchmark.report.figures import (
    case_label,
    compare_figure,
    growth_figure,
    ratio_figure,
    showcase_figure,
    walled,
)
from llm_astar_planner.benchmark.report.html import html_report
from llm_astar_planner.benchmark.report.markdown import report
from llm_astar_planner.benchmark.report.sentences import headline, sentence
from llm_astar_planner.benchmark.results import Case, ResultsFolder, Row
from llm_astar_planner.benchmark.runner.engine import Settings, plan_again
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.waypoint_filter import target_list

DPI = 90
Pictures = list[tuple[Path, str]]


def publish(
    folder: ResultsFolder,
    metadata: Mapping[str, Any],
    maps: Sequence[ProblemMap],
) -> dict[str, Any]:
    """Write summary.json, the figures, report.md and report.html; return the summary as read back.

    `maps` are the unscaled maps of the rows, with their samples. Raises ResultsError.
    """
    rows = folder.read()
    seed = int(metadata['parameters'].get('seed', 0))
    price = metadata['parameters'].get('price')
    summaries = summarise(rows, seed, None if price is None else Price(*price))
    added = contrasts(rows, seed)
    growths = growth(rows)
    summary: dict[str, Any] = {
        'headline': headline(added),
        'sentences': [sentence(contrast) for contrast in added if contrast.samples],
        'rows': len(rows),
        'cases': [_case_json(item) for item in summaries],
        'over_none': [{**asdict(item), **_names(item.case)} for item in added],
        'growth': [{**asdict(item), **_names(item.case)} for item in growths],
        **{name: metadata[name] for name in ('version', 'dataset', 'machine')},
        **{name: metadata[name] for name in ('left_out', 'notes') if name in metadata},
    }
    folder.write_json('summary.json', summary)
    pictures = draw_all(folder.path, rows, maps, (summaries, growths), metadata)
    beside = [(path.name, caption) for path, caption in pictures]
    text = report(summaries, added, growths, metadata, rows=rows, pictures=beside)
    folder.write_text('report.md', text)
    page = html_report(
        summaries,
        added,
        growths,
        metadata,
        rows=rows,
        maps=maps,
        rules=_settings(metadata).rules,
        pictures=pictures,
    )
    folder.write_text('report.html', page)
    return folder.read_json('summary.json')


def draw_all(
    folder: Path,
    rows: Sequence[Row],
    maps: Sequence[ProblemMap],
    figures: tuple[Sequence[CaseSummary], Sequence[Growth]],
    metadata: Mapping[str, Any],
) -> Pictures:
    """Draw every figure there are rows for, and beside samples what the paper's search does."""
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
    pictures += _draw_sample(folder, rows, maps, _settings(metadata))
    if not metadata.get('bags'):
        path = folder / 'showcase.png'
        showcase_figure().savefig(path, dpi=DPI)
        caption = 'LLM-A* target by target on an 11 x 11 map, Chebyshev heuristic, and A* (pink).'
        pictures.append((path, caption))
    return pictures


def _draw_sample(
    folder: Path, rows: Sequence[Row], maps: Sequence[ProblemMap], settings: Settings
) -> Pictures:
    """Draw the sample whose saving over A* is the median: neither the best nor the worst."""
    held = {item.id: len(item.samples) for item in maps}
    chosen = _middle([row for row in rows if row.pair < held.get(row.map, 0)])
    if chosen is None:
        return []
    base, row = chosen
    barrier_map = next(item for item in maps if item.id == row.map)
    sample = barrier_map.samples[row.pair]
    ends = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
    grid_map = walled(barrier_map.to_grid(), settings.rules)
    plans = [plan_again(barrier_map, sample, item, settings) for item in (base, row)]
    titles = [case_label(item.case) for item in (base, row)]
    where = f'Map {row.map}, pair {row.pair}, the sample of median saving'
    path = folder / 'compare.png'
    compare_figure(grid_map, plans, titles, ends).savefig(path, dpi=DPI)
    pictures: Pictures = [(path, f'{where}: what {titles[0]} and {titles[1]} expanded.')]
    if not isinstance(barrier_map, BarrierMap):
        # The animation replays the paper's rules, which are not a grid's.
        return pictures
    waypoints = [(int(x), int(y)) for x, y in parse_points(row.waypoints)]
    targets = target_list(plans[1].waypoints, *ends)[1:]
    blocked = grid_map.blocked()
    plain, guided = trace(blocked, *ends), trace(blocked, *ends, targets)
    path = folder / 'search.gif'
    save_animation(path, blocked, [(titles[0], plain, ()), (titles[1], guided, waypoints)], ends)
    pictures.append((path, f'{where}: both searches at the same pace.'))
    return pictures


def _middle(rows: Sequence[Row]) -> tuple[Row, Row] | None:
    """Pick A*'s and LLM-A*'s rows of the sample with the median ratio of operations."""
    cases = by_case(rows)
    guided = [case for case in cases if case.method == 'llm_astar' and case.source != 'none']
    if not guided:
        return None
    case = min(guided, key=lambda item: (is_ablation(item), item.source != 'oracle'))
    base = cases.get(Case('astar'), {})
    ratios = {
        sample: row.operation / base[sample].operation
        for sample, row in cases[case].items()
        if row.found and row.waypoints and sample in base and base[sample].found
    }
    if not ratios:
        return None
    middle = statistics.median_low(ratios.values())
    sample = next(sample for sample, ratio in ratios.items() if ratio == middle)
    return base[sample], cases[case][sample]


def _settings(metadata: Mapping[str, Any]) -> Settings:
    names = (
        'heuristic', 'weight', 'time_limit', 'max_suboptimality', 'tolerance', 'start_tolerance',
        'paper_corners',
    )  # fmt: skip
    parameters = metadata['parameters']
    rules = parameters.get('rules')
    return Settings(
        **{name: parameters[name] for name in names if name in parameters},
        rules=None if rules is None else CostmapConfig(**rules),
    )


def _names(case: Case) -> dict[str, Any]:
    return {'case': str(case), **case._asdict()}


def _case_json(summary: CaseSummary) -> dict[str, Any]:
    """Write a case's figures under their names; named tuples become objects."""
    values = asdict(summary)
    values.update(_names(summary.case))
    for name in ('operation', 'storage', 'length', 'recorded'):
        ratio = getattr(summary, name)
        if ratio is None:
            continue
        values[name] = {**ratio.mean._asdict(), 'spread': ratio.spread._asdict()}
    for name in (
        'valid', 'seconds_source', 'seconds_search', 'seconds_round_trip', 'clearance', 'turns',
        'unknown_length',
    ):  # fmt: skip
        values[name] = getattr(summary, name)._asdict()
    return values
