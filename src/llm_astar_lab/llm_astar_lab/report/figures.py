"""The benchmark's figures, drawn without pyplot: headless and thread-safe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.planning.types import describe_expansions
from llm_astar_planner.search.expansion_order import ExpansionOrder, ExpansionRecorder
from llm_astar_planner.search.paper import SearchOptions, astar, llm_astar
from llm_astar_planner.search.result import Cell, SearchResult
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from llm_astar_lab.analysis.run_comparison import RunComparison, VariantChange
from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.analysis.summary import Growth, VariantSummary
from llm_astar_lab.pictures import style
from llm_astar_lab.report.sentences import has_waypoints, variant_label

# What A* expanded where LLM-A* did not.
BEYOND = style.LINE
# A small map in the manner of the paper's Figure 4, whose own map is not published: a pocket in
# front of the goal.
SHOWCASE = BarrierMap(
    0, (0, 11), (0, 11), (Barrier(3, 3, 7), Barrier(7, 3, 7)), (Barrier(7, 3, 7),)
)
# Ratios that differ by more than this factor are drawn on a log axis.
WIDE = 5.0
SHOWCASE_ENDPOINTS: tuple[Cell, Cell] = (2, 5), (9, 5)
SHOWCASE_WAYPOINTS: tuple[Cell, ...] = ((2, 8), (7, 8))


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
    for axes, quantity in zip(panels, ('operation', 'length')):
        for position, summary in enumerate(shown):
            mean = getattr(summary, quantity).mean
            colour = style.CHART if has_waypoints(summary.variant) else style.SOFT
            draw_interval(axes, position, mean, colour)
        axes.axvline(100.0, color=style.BASELINE, linewidth=1, linestyle=':')
        name = {'operation': 'expansions', 'length': 'path length'}[quantity]
        axes.set_xlabel(f'{name}, % of A* (95 % interval)')
        axes.grid(axis='x', alpha=0.25)
    panels[0].set_yticks(range(len(shown)), [variant_label(summary.variant) for summary in shown])
    return figure


def change_figure(comparisons: Sequence[RunComparison], metric: str, threshold: float) -> Figure:
    """Draw each variant's ratio to the base, in the metric and the length, for each run.

    A point is the mean with its interval, orange for a regression; the grey line goes from the
    5th to the 95th percentile of the samples.
    """
    rows = [(item, change) for item in comparisons for change in item.changes][::-1]
    figure = Figure(figsize=(9.0, 0.3 * len(rows) + 1.2), layout='constrained')
    metrics = list(dict.fromkeys((metric, 'length')))
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axes, name in zip(panels, metrics):
        draw_changes(axes, [change for _, change in rows], name, (metric, threshold))
    several = len(comparisons) > 1
    names = [
        variant_label(change.variant) + (f' ({item.path.name})' if several else '')
        for item, change in rows
    ]
    panels[0].set_yticks(range(len(rows)), names)
    return figure


def draw_changes(
    axes: Axes, changes: Sequence[VariantChange], metric: str, decisive: tuple[str, float]
) -> None:
    """Draw the ratios of a metric; `decisive` are the metric and threshold of a regression."""
    for position, change in enumerate(changes):
        found = change.metrics[metric]
        is_worse = metric == decisive[0] and change.regression(*decisive) is not None
        percentiles = [100.0 * found.p5, 100.0 * found.p95]
        axes.plot(percentiles, [position] * 2, color=style.LINE, linewidth=5, zorder=1)
        draw_interval(axes, position, found.mean, style.WORSE if is_worse else style.CHART)
    axes.axvline(100.0, color=style.BASELINE, linewidth=1, linestyle=':')
    axes.set_xlabel(f'{metric}, % of the base (95 % interval; wide: 90 % of samples)')
    axes.grid(axis='x', alpha=0.25)
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


def showcase_figure() -> Figure:
    """Draw LLM-A* target by target and against A*, chebyshev, as the paper's Figure 4."""
    blocked, goal = SHOWCASE.to_grid().blocked(), SHOWCASE_ENDPOINTS[1]
    guided, path = traced(llm_astar, blocked, [*SHOWCASE_WAYPOINTS, goal])
    plain, shortest = traced(astar, blocked, ())
    expanded = cells_of(guided, blocked)
    # The next waypoint becomes the target where the one before is a neighbour of a cell.
    stages: list[int] = []
    for number, cell in enumerate(expanded, start=1):
        for waypoint in SHOWCASE_WAYPOINTS[len(stages) :]:
            if max(abs(cell[0] - waypoint[0]), abs(cell[1] - waypoint[1])) > 1:
                break
            stages.append(int(guided.steps[np.searchsorted(guided.steps[:, 1], number), 0]))
    stages.append(guided.expansions)
    figure = Figure(figsize=(3.3 * (len(stages) + 1), 3.9), layout='constrained')
    *panels, beyond = figure.subplots(1, len(stages) + 1)
    for number, (axes, count) in enumerate(zip(panels, stages), start=1):
        aim = 'the goal' if axes is panels[-1] else f'waypoint {number}'
        draw_cells(axes, blocked, (expanded[: guided.cells_after(count)], style.EXPANDED))
        mark_points(axes, SHOWCASE_ENDPOINTS, SHOWCASE_WAYPOINTS)
        axes.set_title(f'LLM-A* towards {aim}:\n{describe_expansions(count)}', fontsize=9)
    draw_cells(beyond, blocked, (expanded, style.EXPANDED), (cells_of(plain, blocked), BEYOND))
    mark_points(beyond, SHOWCASE_ENDPOINTS, ())
    all_of_astar = describe_expansions(plain.expansions)
    beyond.set_title(f'A* (grey: not by LLM-A*):\n{all_of_astar}', fontsize=9)
    for axes, cells in ((panels[-1], path), (beyond, shortest)):
        axes.plot(*zip(*cells), color=style.PATH, linewidth=2, zorder=1.99)
    return figure


def traced(
    method: Callable[..., SearchResult], blocked: NDArray[np.bool_], targets: Sequence[Cell]
) -> tuple[ExpansionOrder, NDArray[np.int32]]:
    """Search on the showcase, chebyshev; return the order of expansion and the path [n, 2]."""
    recorder = ExpansionRecorder(blocked.shape, blocked.size)
    options = SearchOptions('chebyshev', recorder=recorder)
    path = method(blocked, *SHOWCASE_ENDPOINTS, targets, options).path
    return recorder.order(), path


def cells_of(order: ExpansionOrder, blocked: NDArray[np.bool_]) -> list[Cell]:
    """Return the cells (x, y) in the order of their expansion."""
    y, x = np.divmod(order.order, blocked.shape[1])
    return list(zip(x.tolist(), y.tolist()))


def save_map_pictures(maps: Sequence[ProblemMap], folder: str | Path) -> list[Path]:
    """Write one PNG per map with its start-goal pairs numbered; return the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for barrier_map in maps:
        path = folder / f'map_{barrier_map.id:03d}.png'
        map_figure(barrier_map).savefig(path, dpi=90)
        paths.append(path)
    return paths


def map_figure(barrier_map: ProblemMap) -> Figure:
    """Draw a map with its start-goal pairs numbered, starts blue and goals pink."""
    blocked = barrier_map.to_grid().blocked()
    height, width = blocked.shape
    figure = Figure(figsize=(6.0, 6.0 * height / width + 0.4), layout='constrained')
    axes = figure.subplots()
    draw_cells(axes, blocked)
    for pair, sample in enumerate(barrier_map.samples):
        start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
        axes.plot(*zip(start, goal), color=style.BASELINE, linewidth=0.6, linestyle=':')
        mark_points(axes, (start, goal), ())
        axes.annotate(str(pair), start, textcoords='offset points', xytext=(4, 3), fontsize=7)
    axes.set_title(f'map {barrier_map.id}', fontsize=9)
    return figure


def cell_image(
    blocked: NDArray[np.bool_], *layers: tuple[Sequence[Cell], str]
) -> NDArray[np.float64]:
    """Colour cells; return an image [height, width, 3] from 0 to 1.

    Obstacles cover the first layer, which covers the second, and so on.
    """
    image = np.ones((*blocked.shape, 3))
    for cells, colour in reversed(layers):
        if len(cells):
            xs, ys = np.array(cells).T
            image[ys, xs] = to_rgb(colour)
    image[blocked] = to_rgb(style.OBSTACLE)
    return image


def draw_cells(
    axes: Axes, blocked: NDArray[np.bool_], *layers: tuple[Sequence[Cell], str]
) -> None:
    """Draw a `cell_image` without ticks."""
    axes.imshow(cell_image(blocked, *layers), origin='lower', interpolation='nearest')
    axes.set(xticks=[], yticks=[])


def mark_points(axes: Axes, endpoints: tuple[Cell, Cell], waypoints: Sequence[Cell]) -> None:
    """Mark waypoints, start and goal as in all pictures."""
    marks = [(point, style.WAYPOINTS['accepted'], 13) for point in waypoints]
    marks += [(endpoints[0], style.START, 7), (endpoints[1], style.GOAL, 7)]
    for point, mark, size in marks:
        axes.plot(*point, mark.marker, color=mark.colour, markersize=size, mec=style.MARK_EDGE)
