# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The benchmark's figures, drawn without pyplot: headless and thread-safe."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.files import naming
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from llm_astar_lab.analysis.run_comparison import RunComparison, VariantChange
from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.analysis.summary import Growth, VariantSummary
from llm_astar_lab.pictures import raster, style
from llm_astar_lab.report.sentences import has_waypoints, variant_label

# Ratios that differ by more than this factor are drawn on a log axis.
WIDE = 5.0


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


def ratio_figure(summaries: Sequence[VariantSummary]) -> Figure:
    """Draw each variant's operation and length ratio with its interval; A* is the line at 100."""
    shown = [summary for summary in summaries if summary.operation.mean.value > 0][::-1]
    labels = [variant_label(summary.variant) for summary in shown]
    figure, panels = interval_panels(labels, (8.0, 1.0), 2)
    quantities = {'operation': 'expansions', 'length': 'path length'}
    for axes, (quantity, name) in zip(panels, quantities.items()):
        for position, summary in enumerate(shown):
            colour = style.CHART if has_waypoints(summary.variant) else style.SOFT
            draw_interval(axes, position, getattr(summary, quantity).mean, colour)
        end_panel(axes, f'{name}, % of A* (95 % interval)')
    for colour, name in ((style.CHART, 'with waypoints'), (style.SOFT, 'without')):
        panels[0].plot([], [], 'o', color=colour, label=name)
    figure.legend(loc='outside lower right', ncols=2, fontsize=8, frameon=False)
    return figure


def change_figure(comparisons: Sequence[RunComparison], metric: str) -> Figure:
    """Draw each variant's ratio to the base, in the metric and the length, for each run.

    A point is the mean with its interval, orange for a regression; the grey line goes from the
    5th to the 95th percentile of the samples.
    """
    rows = [(item, change) for item in comparisons for change in item.changes][::-1]
    metrics = list(dict.fromkeys((metric, 'length')))
    several = len(comparisons) > 1
    labels = [
        variant_label(change.variant) + (f' ({item.path.name})' if several else '')
        for item, change in rows
    ]
    figure, panels = interval_panels(labels, (9.0, 1.2), len(metrics))
    for axes, name in zip(panels, metrics):
        draw_changes(axes, [change for _, change in rows], name, metric)
    return figure


def interval_panels(
    labels: Sequence[str], size: tuple[float, float], count: int
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels beside each other, with a row for each of the labels.

    `size` is its width, and its height without the rows, in inches.
    """
    figure = Figure(figsize=(size[0], 0.3 * len(labels) + size[1]), layout='constrained')
    panels = list(figure.subplots(1, count, sharey=True, squeeze=False)[0])
    panels[0].set_yticks(range(len(labels)), labels)
    return figure, panels


def end_panel(axes: Axes, name: str) -> None:
    """Write what the ratios of a panel are below it, and draw the line at 100 %."""
    axes.axvline(100.0, color=style.BASELINE, linewidth=1, linestyle=':')
    axes.set_xlabel(name)
    axes.grid(axis='x', alpha=0.25)


def draw_changes(axes: Axes, changes: Sequence[VariantChange], metric: str, decisive: str) -> None:
    """Draw the ratios of a metric; `decisive` is the metric of a regression."""
    for position, change in enumerate(changes):
        found = change.metrics[metric]
        is_worse = metric == decisive and change.regression is not None
        percentiles = [100.0 * found.p5, 100.0 * found.p95]
        axes.plot(percentiles, [position] * 2, color=style.LINE, linewidth=5, zorder=1)
        draw_interval(axes, position, found.mean, style.WORSE if is_worse else style.CHART)
    end_panel(axes, f'{metric}, % of the base (95 % interval; wide: 90 % of samples)')
    low, high = axes.get_xlim()
    if high > WIDE * max(low, 1.0):
        axes.set_xscale('log')
        axes.xaxis.set_major_formatter('{x:g}')


def draw_interval(axes: Axes, position: float, interval: Interval, colour: str) -> None:
    """Draw a ratio in percent with its interval at a height."""
    value, low, high = (100 * end for end in interval)
    # Without an interval there are no arms; rounding may put the ends of a point past it.
    arms = np.maximum(np.nan_to_num([[value - low], [high - value]]), 0.0)
    axes.errorbar(value, position, xerr=arms, fmt='o', color=colour, markersize=5, capsize=3)


def save_map_pictures(maps: Sequence[ProblemMap], folder: str | Path) -> list[Path]:
    """Write one PNG per map with its start-goal pairs numbered; return the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for barrier_map in maps:
        path = folder / f'map_{barrier_map.id:03d}.png'
        with naming(path):
            map_figure(barrier_map).savefig(path, dpi=90)
        paths.append(path)
    return paths


def map_figure(barrier_map: ProblemMap) -> Figure:
    """Draw a map with its start-goal pairs numbered, starts blue and goals pink."""
    codes = raster.cell_codes(barrier_map.to_grid())
    height, width = codes.shape
    figure = Figure(figsize=(6.0, 6.0 * height / width + 0.4), layout='constrained')
    axes = figure.subplots()
    axes.imshow(raster.PALETTE[codes], origin='lower', interpolation='nearest')
    axes.set(xticks=[], yticks=[])
    for pair, sample in enumerate(barrier_map.samples):
        start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
        axes.plot(*zip(start, goal), color=style.BASELINE, linewidth=0.6, linestyle=':')
        for point, mark in ((start, style.START), (goal, style.GOAL)):
            axes.plot(*point, mark.marker, color=mark.colour, markersize=7, mec=style.MARK_EDGE)
        axes.annotate(str(pair), start, textcoords='offset points', xytext=(4, 3), fontsize=7)
    axes.set_title(f'map {barrier_map.id}', fontsize=9)
    return figure
