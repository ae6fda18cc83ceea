"""Plans of one request beside each other, as the paper's Figure 2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from llm_astar_lab.pictures import raster
from llm_astar_lab.pictures.figures import WIDTH, Picture, add_legend, draw, write_labels

# Maps that are so many times as wide as high are drawn below each other.
WIDE = 2.6
MAX_PANEL_HEIGHT = 4.4
# Inches of a picture that is one of several on a page, and of its scale bar.
PANEL_WIDTH, SCALE_BAR = 4.6, 0.5


def panels_for(
    figure: Figure, pictures: Sequence[Picture], around: tuple[float, float]
) -> list[Axes]:
    """Divide a figure into panels for pictures of one part of a map, and give it their height.

    `around` is the room for titles and axes at each panel and for the legend, in inches.
    """
    window = pictures[0].window
    aspect = window.height / window.width
    rows = len(pictures) if aspect * WIDE < 1.0 else 1
    columns = len(pictures) // rows
    height = min(aspect * WIDTH / columns, MAX_PANEL_HEIGHT)
    figure.set_size_inches(WIDTH, rows * (height + around[0]) + around[1])
    return list(figure.subplots(rows, columns, squeeze=False).ravel())


def on_one_window(pictures: Sequence[Picture]) -> list[Picture]:
    """Return pictures of one map that all show the same part of it; the last has the scale."""
    window = raster.union([picture.window for picture in pictures])
    last = pictures[-1]
    return [replace(picture, shown=window, has_scale_bar=picture is last) for picture in pictures]


def comparison_figure(pictures: Sequence[Picture]) -> Figure:
    """Draw plans on one map, at least one, beside each other or below each other."""
    pictures = on_one_window(pictures)
    figure = Figure(layout='constrained')
    panels = panels_for(figure, pictures, (0.95, 0.5))
    for axes, picture in zip(panels, pictures):
        draw(axes, picture)
    add_legend(figure, panels)
    for axes, picture in zip(panels, pictures):
        write_labels(axes, picture)
    return figure


def panel_figure(picture: Picture) -> Figure:
    """Draw a plan without title, axes and legend, for a page that has its own."""
    picture = replace(picture, has_scale_bar=True)
    aspect = picture.window.height / picture.window.width
    height = min(aspect, 1.6) * PANEL_WIDTH + (SCALE_BAR if picture.in_metres else 0.0)
    figure = Figure(figsize=(PANEL_WIDTH, height), layout='constrained')
    axes = figure.add_subplot()
    draw(axes, picture)
    axes.set(xticks=[], yticks=[], xlabel='', ylabel='', title='')
    write_labels(axes, picture)
    return figure
