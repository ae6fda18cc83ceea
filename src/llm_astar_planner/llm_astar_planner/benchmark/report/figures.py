"""The benchmark's figures and animations, drawn without pyplot: headless and thread-safe."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from llm_astar_planner.benchmark.analysis.summary import Growth, VariantSummary, is_baseline
from llm_astar_planner.benchmark.analysis.trace import Trace, trace
from llm_astar_planner.benchmark.report.sentences import method_label
from llm_astar_planner.benchmark.results import Variant
from llm_astar_planner.planning.types import Plan
from llm_astar_planner.search.result import Cell
from llm_astar_planner.visualization import style
from llm_astar_planner.visualization.figures import draw, picture_of
from llm_astar_planner.visualization.style import OBSTACLE, PATH

START, GOAL, STAR = style.START.colour, style.GOAL.colour, style.WAYPOINTS['accepted'].colour
# The paper's colours: grey for what LLM-A* expanded, pink for A*.
GREY, PINK = '#b9bdc6', '#f7b6cb'
# A small map in the manner of the paper's Figure 4, whose own map is not published: a pocket in
# front of the goal.
SHOWCASE = BarrierMap(
    0, (0, 11), (0, 11), (Barrier(3, 3, 7), Barrier(7, 3, 7)), (Barrier(7, 3, 7),)
)
SHOWCASE_ENDPOINTS: tuple[Cell, Cell] = (2, 5), (9, 5)
SHOWCASE_WAYPOINTS: tuple[Cell, ...] = ((2, 8), (7, 8))
# Of animations: frames, milliseconds per frame and of the last one; pixels between two searches
# and of the headline.
FRAMES, FRAME_MS, LAST_MS = 60, 80, 2500
GAP, HEADING = 12, 18


def comparison_figure(
    grid_map: GridMap, plans: Sequence[Plan], titles: Sequence[str], endpoints: tuple[Cell, Cell]
) -> Figure:
    """Draw plans of one sample and their expanded cells side by side, as the paper's Figure 2."""
    panel, aspect = 6.2, grid_map.height / grid_map.width
    height = panel * aspect + 1.4
    figure = Figure(figsize=(panel * len(plans), height))
    # Room for the legend below; legends outside the axes came with matplotlib 3.7.
    legend = 0.7 / height
    figure.set_layout_engine('constrained', rect=(0.0, legend, 1.0, 1.0 - legend))
    panels = np.atleast_1d(figure.subplots(1, len(plans)))
    for axes, plan, title in zip(panels, plans, titles):
        draw(axes, picture_of(plan, grid_map, *endpoints))
        found = f'length {plan.length:.2f}' if len(plan.path) else plan.code.name
        axes.set_title(f'{title}\noperation {plan.expansions}, storage {plan.storage}, {found}')
    marks = {
        text: handle for axes in panels for handle, text in zip(*axes.get_legend_handles_labels())
    }
    figure.legend(list(marks.values()), list(marks), loc='lower center', ncol=6, frameon=False)
    return figure


def growth_figure(growths: Sequence[Growth]) -> Figure:
    """Draw growth over scale on log axes for operation and storage, as the paper's Figure 3.

    Dotted lines show growth proportional to the scale and to its square, the map's area.
    """
    figure = Figure(figsize=(11.0, 4.8), layout='constrained')
    for axes, quantity in zip(figure.subplots(1, 2), ('operation', 'storage')):
        chosen = [growth for growth in growths if growth.quantity == quantity]
        scales = np.array(sorted({scale for growth in chosen for scale in growth.scales}))
        for power, name in ((1, 'scale'), (2, 'scale²')):
            axes.plot(scales, scales**power, ':', color='#9aa0ac', linewidth=1)
            axes.annotate(name, (scales[-1], scales[-1] ** power), color='#6b7280', fontsize=8)
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
    figure = Figure(figsize=(11.0, 0.34 * len(shown) + 1.3), layout='constrained')
    panels = figure.subplots(1, 2, sharey=True)
    for axes, quantity in zip(panels, ('operation', 'length')):
        for position, summary in enumerate(shown):
            mean = getattr(summary, quantity).mean
            value, low, high = (100 * end for end in mean)
            # Without an interval there are no arms; rounding may put the ends of a point past it.
            arms = np.maximum(np.nan_to_num([[value - low], [high - value]]), 0.0)
            colour = '#6b7280' if is_baseline(summary.variant) else PATH
            axes.errorbar(
                value, position, xerr=arms, fmt='o', color=colour, markersize=5, capsize=3
            )
        axes.axvline(100.0, color='#9aa0ac', linewidth=1, linestyle=':')
        axes.set_xlabel(f'{quantity} ratio to A* (%), 95 % interval')
        axes.grid(axis='x', alpha=0.25)
    panels[0].set_yticks(range(len(shown)), [variant_label(summary.variant) for summary in shown])
    return figure


def showcase_figure(
    barrier_map: BarrierMap = SHOWCASE,
    endpoints: tuple[Cell, Cell] = SHOWCASE_ENDPOINTS,
    waypoints: Sequence[Cell] = SHOWCASE_WAYPOINTS,
) -> Figure:
    """Draw LLM-A* target by target and against A*, chebyshev, as the paper's Figure 4."""
    blocked = barrier_map.to_grid().blocked()
    guided = trace(blocked, *endpoints, [*waypoints, endpoints[1]], 'chebyshev')
    plain = trace(blocked, *endpoints, (), 'chebyshev')
    stages = [*guided.switches, len(guided.order)]
    figure = Figure(figsize=(3.3 * (len(stages) + 1), 3.9), layout='constrained')
    panels = figure.subplots(1, len(stages) + 1)
    for number, (axes, count) in enumerate(zip(panels, stages), start=1):
        last = number == len(stages)
        aim = 'the goal' if last else f'waypoint {number}'
        draw_cells(axes, blocked, (guided.order[:count], GREY))
        if last:
            axes.plot(*zip(*guided.path), color=PATH, linewidth=2)
        mark_points(axes, endpoints, waypoints)
        axes.set_title(f'LLM-A* towards {aim}:\n{count} expansions', fontsize=9)
    draw_cells(panels[-1], blocked, (guided.order, GREY), (plain.order, PINK))
    panels[-1].plot(*zip(*plain.path), color=PATH, linewidth=2)
    mark_points(panels[-1], endpoints, ())
    panels[-1].set_title(f'A* (pink beyond grey):\n{len(plain.order)} expansions', fontsize=9)
    return figure


def save_map_pictures(maps: Sequence[BarrierMap], folder: str | Path) -> list[Path]:
    """Write one PNG per map with its start-goal pairs numbered; return the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for barrier_map in maps:
        path = folder / f'map_{barrier_map.id:03d}.png'
        map_figure(barrier_map).savefig(path, dpi=90)
        paths.append(path)
    return paths


def map_figure(barrier_map: BarrierMap) -> Figure:
    """Draw a map with its start-goal pairs numbered, starts blue and goals green."""
    blocked = barrier_map.to_grid().blocked()
    height, width = blocked.shape
    figure = Figure(figsize=(6.0, 6.0 * height / width + 0.4), layout='constrained')
    axes = figure.subplots()
    draw_cells(axes, blocked)
    for pair, sample in enumerate(barrier_map.samples):
        start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
        axes.plot(*zip(start, goal), color='#9aa0ac', linewidth=0.6, linestyle=':')
        mark_points(axes, (start, goal), ())
        axes.annotate(str(pair), start, textcoords='offset points', xytext=(4, 3), fontsize=7)
    axes.set_title(f'map {barrier_map.id}', fontsize=9)
    return figure


def variant_label(variant: Variant) -> str:
    """Return a variant's name for a legend."""
    guide = ', '.join(part for part in variant[1:] if part and part != 'none')
    alone = variant.method == 'llm_astar' and variant.source == 'none'
    name = method_label(variant.method) + (', no waypoints' if alone else '')
    return f'{name}, {guide}' if guide else name


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
    image[blocked] = to_rgb(OBSTACLE)
    return image


def draw_cells(
    axes: Axes, blocked: NDArray[np.bool_], *layers: tuple[Sequence[Cell], str]
) -> None:
    """Draw a `cell_image` without ticks."""
    axes.imshow(cell_image(blocked, *layers), origin='lower', interpolation='nearest')
    axes.set_xticks([])
    axes.set_yticks([])


def mark_points(axes: Axes, endpoints: tuple[Cell, Cell], waypoints: Sequence[Cell]) -> None:
    """Mark waypoints with stars, the start in blue and the goal in green."""
    for point in waypoints:
        axes.plot(*point, '*', color=STAR, markersize=13, markeredgecolor='black')
    for cell, colour in zip(endpoints, (START, GOAL)):
        axes.plot(*cell, 's', color=colour, markersize=6, markeredgecolor='white')


def save_animation(
    path: str | Path,
    blocked: NDArray[np.bool_],
    searches: Sequence[tuple[str, Trace, Sequence[Cell]]],
    endpoints: tuple[Cell, Cell],
) -> None:
    """Write a GIF of searches that expand side by side at the same pace.

    `searches` are (title, trace, waypoints).
    """
    longest = max(len(traced.order) for _, traced, _ in searches)
    counts = np.unique(np.linspace(0, longest, FRAMES).astype(int))
    frames = [animation_frame(blocked, searches, endpoints, int(count)) for count in counts]
    durations = [FRAME_MS] * (len(frames) - 1) + [LAST_MS]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=True
    )


def animation_frame(
    blocked: NDArray[np.bool_],
    searches: Sequence[tuple[str, Trace, Sequence[Cell]]],
    endpoints: tuple[Cell, Cell],
    count: int,
) -> Image.Image:
    """Draw every search after `count` expansions."""
    height, width = blocked.shape
    size = max(4, 480 // width)
    canvas = Image.new(
        'RGB', ((width * size + GAP) * len(searches) - GAP, height * size + HEADING), 'white'
    )
    pen = ImageDraw.Draw(canvas)
    radius = 0.6 * size
    for number, (title, traced, waypoints) in enumerate(searches):
        left = number * (width * size + GAP)
        expanded = traced.order[:count]
        cells = cell_image(blocked, (expanded, GREY if waypoints else PINK))[::-1]
        large = np.kron((cells * 255).astype(np.uint8), np.ones((size, size, 1), dtype=np.uint8))
        canvas.paste(Image.fromarray(large), (left, HEADING))
        pen.text((left + 2, 3), f'{title}: {len(expanded)} expansions', fill='black')

        def centre(cell: Cell, left: int = left) -> tuple[float, float]:
            return left + (cell[0] + 0.5) * size, HEADING + (height - cell[1] - 0.5) * size

        if count >= len(traced.order) and traced.path:
            pen.line([centre(cell) for cell in traced.path], fill=PATH, width=3)
        for point in waypoints:
            x, y = centre(point)
            diamond = [(x, y - radius), (x + radius, y), (x, y + radius), (x - radius, y)]
            pen.polygon(diamond, fill=STAR, outline='black')
        for cell, colour in zip(endpoints, (START, GOAL)):
            x, y = centre(cell)
            pen.rectangle((x - radius, y - radius, x + radius, y + radius), fill=colour)
    return canvas.convert('P', palette=Image.Palette.ADAPTIVE, colors=32)
