# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Animations of searches that expand side by side at the same pace, as a GIF."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.files import naming
from llm_astar_planner.planning.types import describe_expansions
from llm_astar_planner.search.expansion_order import ExpansionOrder
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont
from PIL import Image, ImageDraw, ImageFont

from llm_astar_lab.pictures import figures, raster, style
from llm_astar_lab.pictures.figures import Picture, draw

# Dots per inch of a figure of 8 inches: 880 pixels, what a README shows.
DPI = 110
# Frames, milliseconds of each and of the last one.
FRAMES, FRAME_MS, LAST_MS = 70, 80, 3500
# The search that ends first takes at least this part of the frames.
SHORTEST = 0.3
TITLE_SIZE = 15
MIN_PIXELS = 5.0
# Colours of a GIF, and the distance at which one becomes that of a cell.
COLOURS, NEAR = 96, 24


@dataclass(frozen=True, eq=False)
class AnimatedSearch:
    """A search to animate: its picture, in which order it expanded cells, what came out of it.

    `name` is written above it with the count of expansions, and `outcome` once it has ended.
    """

    picture: Picture
    order: ExpansionOrder
    name: str
    outcome: str


def save_animation(path: str | Path, searches: Sequence[AnimatedSearch]) -> None:
    """Write a GIF of searches on one map; missing folders are created.

    All have the same number of expansions in a frame; it grows faster later where one search
    takes many more than another. Raises OSError where the file cannot be written.
    """
    figure = AnimationFigure(searches)
    counts = expansion_counts(searches)
    palette = palette_of(figure.frame(counts[-1]))
    # One at a time: a frame in all its colours takes three times the memory.
    first, *others = (
        figure.frame(count).quantize(palette=palette, dither=Image.Dither.NONE) for count in counts
    )
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with naming(path):
        first.save(
            path, format='GIF', save_all=True, append_images=others, loop=0, optimize=True,
            duration=[FRAME_MS] * len(others) + [LAST_MS],
        )  # fmt: skip


def palette_of(frame: Image.Image) -> Image.Image:
    """Return an image with the colours of a frame, those of the cells exactly as they are."""
    palette = frame.quantize(COLOURS, dither=Image.Dither.NONE)
    colours = np.array(palette.getpalette(), dtype=int).reshape(-1, 3)
    for colour in raster.PALETTE:
        apart = np.abs(colours - colour).sum(axis=1)
        colours[(apart < NEAR) | (apart == apart.min())] = colour
    palette.putpalette(colours.ravel().tolist())
    return palette


def expansion_counts(searches: Sequence[AnimatedSearch]) -> list[int]:
    """Return the number of expansions in each frame, from 0 to those of the longest search."""
    ends = [search.order.expansions for search in searches]
    longest, shortest = max(1, *ends), max(1, min(ends))
    # The power of the frame's number with which the shortest search takes its part of the frames.
    power = max(1.0, math.log(shortest / longest) / math.log(SHORTEST))
    steps = np.ceil(longest * np.linspace(0.0, 1.0, FRAMES) ** power)
    return [int(count) for count in np.unique(steps)]


class AnimationFigure:
    """The figure of an animation: what is the same in all frames, and where the rest goes."""

    def __init__(self, searches: Sequence[AnimatedSearch]) -> None:
        """Lay out the panels of the searches and draw what does not move."""
        pictures = figures.on_one_window([without_rotation(search.picture) for search in searches])
        self.searches = [replace(search, picture=own) for search, own in zip(searches, pictures)]
        self.window = pictures[0].window
        figure = Figure(dpi=DPI, layout='constrained')
        self.panels = figures.panels_for(figure, pictures, (0.58, 0.55))
        self.figure = figure
        for axes, search in zip(self.panels, self.searches):
            draw(axes, search.picture)
            axes.set(xticks=[], yticks=[], xlabel='', ylabel='')
            axes.set_title(' \n ', fontsize=TITLE_SIZE * 72 / DPI)
        figures.add_legend(figure, self.panels)
        for axes, search in zip(self.panels, self.searches):
            figures.write_labels(axes, search.picture)
            axes.images[0].set_visible(False)
            axes.patch.set_alpha(0.0)
        figure.patch.set_alpha(0.0)
        # Labels have been laid out: nothing may move any more.
        figure.set_layout_engine('none')
        self.ended = self.render()
        for line in (line for axes in self.panels for line in axes.lines):
            line.set_visible(line.get_label() != 'path')
        self.running = self.render()
        self.font = ImageFont.truetype(findfont('DejaVu Sans'), TITLE_SIZE)

    def render(self) -> Image.Image:
        """Return the figure as it is, on nothing."""
        buffer = io.BytesIO()
        self.figure.savefig(buffer, format='png', dpi=DPI)
        return Image.open(buffer).convert('RGBA')

    def frame(self, count: int) -> Image.Image:
        """Return the picture after `count` expansions of each search."""
        frame = Image.new('RGBA', self.running.size, style.FREE)
        pen = ImageDraw.Draw(frame)
        done = []
        for axes, search in zip(self.panels, self.searches):
            box = axes.get_window_extent()
            left, right = round(box.x0), round(box.x1)
            top, bottom = round(frame.height - box.y1), round(frame.height - box.y0)
            frame.paste(self.cells(search, count, (right - left, bottom - top)), (left, top))
            expansions = min(count, search.order.expansions)
            ended = count >= search.order.expansions
            text = f'{search.name}\n{describe_expansions(expansions)}'
            text += f': path of {search.outcome}' if ended else ''
            # A caption that is wider than its panel would run into the next one.
            wide = pen.multiline_textbbox((0, 0), text, font=self.font)[2]
            font = self.font.font_variant(size=TITLE_SIZE * min(1.0, (right - left) / wide))
            pen.text((left, top - 2.6 * TITLE_SIZE), text, fill=style.INK, font=font)
            if ended:
                done.append((left, top, right, bottom))
        frame.alpha_composite(self.running)
        for area in done:
            frame.alpha_composite(self.ended.crop(area), area[:2])
        return frame.convert('RGB')

    def cells(self, search: AnimatedSearch, count: int, size: tuple[int, int]) -> Image.Image:
        """Return the map with the cells that are expanded by then, `size` pixels large."""
        picture, order = search.picture, search.order
        expanded = raster.expanded_cells(order, picture.grid_map.cells.shape, count)
        codes = self.window.cut(raster.cell_codes(picture.grid_map, expanded, picture.inflated))
        codes = raster.widen_expanded(codes, math.ceil(MIN_PIXELS * self.window.width / size[0]))
        return Image.fromarray(raster.PALETTE[raster.resize(codes, *size)[::-1]])


def without_rotation(picture: Picture) -> Picture:
    """Return a picture whose map is upright, whatever the pose of the map's origin."""
    grid_map = picture.grid_map
    upright = replace(grid_map, origin=grid_map.origin._replace(yaw=0.0))
    return replace(picture, grid_map=upright)
