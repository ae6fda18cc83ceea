# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Writes everything that is read of a results folder: summary, figures, reports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, shortened
from llm_astar_msgs_adapter.files import naming
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.costmap.config import CostmapConfig
from matplotlib.figure import Figure

from llm_astar_lab.analysis.replies import reply_shares
from llm_astar_lab.analysis.summary import Growth, RunSummary, VariantSummary, summarise_run
from llm_astar_lab.pictures import style
from llm_astar_lab.pictures.figures import comparison_figure, on_one_window, panel_figure
from llm_astar_lab.report.pages import html_report, markdown_report
from llm_astar_lab.report.samples import browser_data, draw_median, shown_samples
from llm_astar_lab.report.sentences import headline, sentence, variant_label
from llm_astar_lab.report.table import json_of
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError, Row
from llm_astar_lab.results.stored_rows import StoredRows
from llm_astar_lab.runner.engine import SearchSettings

# Dots per inch of figures, and of the panels of a page, and inches around them.
DPI, PANEL_DPI = 140, 100
PAD, PANEL_PAD = 0.1, 0.03
Pictures = list[tuple[Path, str]]
# Figures that are lists in summary.json, and those of runs with instructions.
LISTS, INSTRUCTED = ('proven', 'operation_exact'), ('instruction', 'recorded_instruction')


def write_report(
    folder: ResultsFolder,
    metadata: Mapping[str, Any],
    maps: Sequence[ProblemMap],
    rows: StoredRows | None = None,
) -> RunSummary:
    """Write summary.json, the figures, report.md and report.html; return what they are made of.

    `maps` are the unscaled maps of the rows, with their samples; `rows` are those of the folder
    where they have been read. Raises ResultsError.
    """
    rows = folder.stored() if rows is None else rows
    shown = shown_samples(rows, maps)
    run = summarise_run(rows, metadata)
    summary = {
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
    folder.write_text('report.md', markdown_report(run, pictures))
    costmap = search_settings(metadata).costmap
    samples = browser_data(shown, maps, costmap, folder.read_places())
    has_zone = costmap is not None and costmap.robot_radius > 0.0
    page = html_report(run, pictures, samples, has_zone=has_zone)
    folder.write_text('report.html', page)
    return run


def to_json(item: Any) -> dict[str, Any]:  # noqa: ANN401 - a summary, comparison or growth
    """Return the figures of a variant by name, without those of what the run did not have.

    The keys of the file are older than the word variant: `case` is its name.
    """
    values = asdict(item)
    if isinstance(item, VariantSummary):
        # Older than the intervals and objects, and read by scripts: a number, and lists.
        older = {'optimal': item.optimal.value} | {name: values[name] for name in LISTS}
        values = json_of(item) | older | {'optimal_share': json_of(item.optimal)}
        if item.replies:
            values['reply_shares'] = json_of(reply_shares(item.replies))
        absent = [name for name in INSTRUCTED if math.isnan(getattr(item, name).value)]
        absent += () if item.families else ('families', 'family_means')
        absent += () if item.replies else ('replies', 'seconds_reply')
        values = {name: value for name, value in values.items() if name not in absent}
    del values['variant']
    return {'case': str(item.variant), **values, **item.variant._asdict()}


def draw_all(
    folder: Path, rows: Sequence[Row], maps: Sequence[ProblemMap], run: RunSummary
) -> Pictures:
    """Draw every figure that the rows allow; return the files and their captions."""
    pictures: Pictures = []

    def save(
        name: str, figure: Figure, caption: str, pad: float | None = None, dpi: int = DPI
    ) -> None:
        box = None if pad is None else 'tight'
        with naming(folder / name):
            figure.savefig(folder / name, dpi=dpi, bbox_inches=box, pad_inches=pad)
        pictures.append((folder / name, caption))

    if run.growths:
        caption = 'Growth of work and storage with the scale of the map.'
        save('growth.png', growth_figure(run.growths), caption)
    # Neither the best nor the worst sample.
    where, drawn = draw_median(rows, maps, search_settings(run.metadata))
    if drawn:
        caption = f'{where}: what each method expanded.'
        save('compare.png', comparison_figure(drawn), caption, PAD)
        for number, picture in enumerate(on_one_window(drawn), start=1):
            file, caption = f'panel_{number}.png', picture.title
            save(file, panel_figure(picture), caption, PANEL_PAD, PANEL_DPI)
    return pictures


def growth_figure(growths: Sequence[Growth]) -> Figure:
    """Draw growth over scale on log axes for operation and storage, as the paper's Figure 3.

    Dotted lines show growth proportional to the scale and to its square, the map's area.
    """
    figure = Figure(figsize=(11.0, 4.8), layout='constrained')
    for axes, quantity in zip(figure.subplots(1, 2), ('operation', 'storage')):
        chosen = [growth for growth in growths if growth.quantity == quantity]
        scales = np.array(sorted({scale for growth in chosen for scale in growth.scales}))
        for power, name in ((1, 'scale'), (2, 'scale²')):
            axes.plot(scales, scales**power, ':', color=style.BASELINE, linewidth=1)
            axes.annotate(name, (scales[-1], scales[-1] ** power), color=style.SOFT, fontsize=8)
        for index, growth in enumerate(chosen):
            axes.plot(
                growth.scales, growth.factors, marker='osD^vP*X'[index % 8], markersize=4,
                linewidth=1.4, label=f'{variant_label(growth.variant)} (slope {growth.slope:.2f})',
            )  # fmt: skip
        axes.set(xscale='log', yscale='log', xlabel='scale of the map', ylabel='growth factor')
        axes.set_xticks(scales, [str(scale) for scale in scales])
        axes.minorticks_off()
        axes.set_title(quantity)
        axes.legend(fontsize=7, frameon=False)
    return figure


def search_settings(metadata: Mapping[str, Any]) -> SearchSettings:
    """Return the search settings of a run from its metadata."""
    parameters = metadata['parameters']
    rules = parameters.get('rules')
    try:
        costmap = None if rules is None else CostmapConfig(**rules)
    except (TypeError, LlmAstarError) as error:
        raise ResultsError(f'metadata.json: parameters: rules: {shortened(str(error))}') from None
    names = {field.name for field in fields(SearchSettings)} - {'costmap', 'instruction'}
    known = {name: parameters[name] for name in names & set(parameters)}
    return SearchSettings(**known, costmap=costmap)
