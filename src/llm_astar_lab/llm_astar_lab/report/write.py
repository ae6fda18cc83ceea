"""Writes everything that is read of a results folder: summary, figures, reports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, shortened
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig

from llm_astar_lab.analysis.replies import reply_shares
from llm_astar_lab.analysis.statistics import Interval, Spread
from llm_astar_lab.analysis.summary import (
    Growth,
    PairedComparison,
    RunSummary,
    VariantSummary,
    summarise_run,
)
from llm_astar_lab.pictures.animation import save_animation
from llm_astar_lab.pictures.comparison import (
    comparison_figure,
    on_one_window,
    panel_figure,
)
from llm_astar_lab.report.figures import (
    growth_figure,
    ratio_figure,
    showcase_figure,
)
from llm_astar_lab.report.html import PANEL, html_report
from llm_astar_lab.report.markdown import markdown_report
from llm_astar_lab.report.median import draw_median
from llm_astar_lab.report.page_data import shown_samples
from llm_astar_lab.report.sentences import headline, recorded_sentence, sentence
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError, Row
from llm_astar_lab.results.stored_rows import StoredRows
from llm_astar_lab.runner.engine import SearchSettings

# Dots per inch of figures, and of the panels of a page.
DPI, PANEL_DPI = 140, 100
Pictures = list[tuple[Path, str]]


def write_report(
    folder: ResultsFolder,
    metadata: Mapping[str, Any],
    maps: Sequence[ProblemMap],
    rows: StoredRows | None = None,
) -> dict[str, Any]:
    """Write summary.json, the figures, report.md and report.html; return the summary as read back.

    `maps` are the unscaled maps of the rows, with their samples; `rows` are those of the folder
    where they have been read. Raises ResultsError.
    """
    rows = folder.stored() if rows is None else rows
    shown = shown_samples(rows.rows('scale = 1'), maps)
    recorded = recorded_sentence(rows.rows()) if metadata.get('bags') else None
    run = summarise_run(rows, metadata)
    summary: dict[str, Any] = {
        'headline': headline(run.comparisons),
        'sentences': [sentence(item) for item in run.comparisons if item.samples],
        'rows': len(rows),
        'cases': [to_json(item) for item in run.variants],
        'over_none': [to_json(item) for item in run.comparisons],
        'growth': [to_json(item) for item in run.growths],
        **{name: metadata[name] for name in ('version', 'dataset', 'machine')},
        **{name: metadata[name] for name in ('left_out', 'notes', 'replays') if name in metadata},
    }
    folder.write_json('summary.json', summary)
    pictures = draw_all(folder.path, shown.rows, maps, run)
    names = [(path.name, caption) for path, caption in pictures if not path.name.startswith(PANEL)]
    folder.write_text('report.md', markdown_report(run, recorded=recorded, pictures=names))
    page = html_report(
        run,
        shown=shown,
        maps=maps,
        recorded=recorded,
        costmap=search_settings(metadata).costmap,
        places=folder.read_places(),
        pictures=pictures,
    )
    folder.write_text('report.html', page)
    return folder.read_json('summary.json')


def to_json(item: VariantSummary | PairedComparison | Growth) -> dict[str, Any]:
    """Return the figures of a variant by name; named tuples become objects.

    The keys of the file are older than the word variant: `case` is its name. Shares of satisfied
    instructions are left out where nothing was asked, and what is wrong with replies without any.
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
        # Older than the interval, and read by scripts: `optimal` is a number.
        values |= {'optimal': item.optimal.value, 'optimal_share': values['optimal']}
        for name in ('instruction', 'recorded_instruction'):
            if math.isnan(values[name]['value']):
                del values[name]
        values['families'] = {name: named(asdict(part)) for name, part in item.families.items()}
        values['family_means'] = named(asdict(item.family_means))
        if not item.families:
            del values['families'], values['family_means']
        if item.replies:
            shares = reply_shares(item.replies)
            values['reply_shares'] = {name: share._asdict() for name, share in shares.items()}
        else:
            del values['replies'], values['seconds_reply']
    return {'case': str(item.variant), **values, **item.variant._asdict()}


def named(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with each interval as an object."""
    return {
        name: value._asdict()
        if isinstance(value, Interval)
        else named(value)
        if isinstance(value, Mapping)
        else value
        for name, value in values.items()
    }


def draw_all(
    folder: Path, rows: Sequence[Row], maps: Sequence[ProblemMap], run: RunSummary
) -> Pictures:
    """Draw every figure that the rows allow; return the files and their captions."""
    pictures: Pictures = []
    if run.variants:
        path = folder / 'ratios.png'
        ratio_figure(run.variants).savefig(path, dpi=DPI, bbox_inches='tight')
        pictures.append(
            (path, 'Expansions and length against A*: blue with waypoints, the rest grey.')
        )
    if run.growths:
        path = folder / 'growth.png'
        growth_figure(run.growths).savefig(path, dpi=DPI)
        pictures.append((path, 'Growth of work and storage with the scale of the map.'))
    pictures += draw_median_sample(folder, rows, maps, search_settings(run.metadata))
    if not run.metadata.get('bags'):
        path = folder / 'showcase.png'
        showcase_figure().savefig(path, dpi=DPI)
        caption = 'LLM-A* target by target on an 11 x 11 map, Chebyshev heuristic, and A*.'
        pictures.append((path, caption))
    return pictures


def draw_median_sample(
    folder: Path, rows: Sequence[Row], maps: Sequence[ProblemMap], settings: SearchSettings
) -> Pictures:
    """Draw a sample whose saving over A* is about the median: neither the best nor the worst."""
    sample = draw_median(rows, maps, settings)
    if sample is None:
        return []
    path = folder / 'compare.png'
    comparison_figure(sample.pictures).savefig(path, dpi=DPI, bbox_inches='tight')
    pictures: Pictures = [(path, f'{sample.where}: what each method expanded.')]
    for number, picture in enumerate(on_one_window(sample.pictures), start=1):
        path = folder / f'{PANEL}{number}.png'
        panel_figure(picture).savefig(path, dpi=PANEL_DPI, bbox_inches='tight', pad_inches=0.03)
        pictures.append((path, picture.title))
    if sample.searches:
        path = folder / 'search.gif'
        save_animation(path, sample.searches)
        pictures.append(
            (path, f'{sample.where}: all searches with the same number of expansions in a frame.')
        )
    return pictures


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
