# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The benchmark's figures, drawn without pyplot: headless and thread-safe."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.analysis.summary import Growth, VariantSummary
from llm_astar_lab.pictures import style
from llm_astar_lab.report.sentences import has_waypoints, variant_label


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
    figure = Figure(figsize=(8.0, 0.3 * len(shown) + 1.0), layout='constrained')
    panels = figure.subplots(1, 2, sharey=True)
    panels[0].set_yticks(range(len(shown)), [variant_label(item.variant) for item in shown])
    quantities = {'operation': 'expansions', 'length': 'path length'}
    for axes, (quantity, name) in zip(panels, quantities.items()):
        for position, summary in enumerate(shown):
            colour = style.CHART if has_waypoints(summary.variant) else style.SOFT
            draw_interval(axes, position, getattr(summary, quantity).mean, colour)
        axes.axvline(100.0, color=style.BASELINE, linewidth=1, linestyle=':')
        axes.set_xlabel(f'{name}, % of A* (95 % interval)')
        axes.grid(axis='x', alpha=0.25)
    for colour, name in ((style.CHART, 'with waypoints'), (style.SOFT, 'without')):
        panels[0].plot([], [], 'o', color=colour, label=name)
    figure.legend(loc='outside lower right', ncols=2, fontsize=8, frameon=False)
    return figure


def draw_interval(axes: Axes, position: float, interval: Interval, colour: str) -> None:
    """Draw a ratio in percent with its interval at a height."""
    value, low, high = (100 * end for end in interval)
    # Without an interval there are no arms; rounding may put the ends of a point past it.
    arms = np.maximum(np.nan_to_num([[value - low], [high - value]]), 0.0)
    axes.errorbar(value, position, xerr=arms, fmt='o', color=colour, markersize=5, capsize=3)
