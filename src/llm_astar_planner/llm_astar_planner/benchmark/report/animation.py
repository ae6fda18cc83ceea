"""An animated GIF of searches expanding side by side, at the same pace."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from llm_astar_planner.benchmark.analysis.trace import Trace
from llm_astar_planner.benchmark.report.figures import (
    GOAL,
    GREY,
    PATH,
    PINK,
    STAR,
    START,
    cell_image,
)
from llm_astar_planner.search.result import Cell

FRAMES, FRAME_MS, LAST_MS = 60, 80, 2500
GAP, HEADING = 12, 18


def save_animation(
    path: str | Path,
    blocked: NDArray[np.bool_],
    traces: Sequence[tuple[str, Trace, Sequence[Cell]]],
    ends: tuple[Cell, Cell],
) -> None:
    """Write a GIF; `traces` are (title, search, its waypoints). All run at the same pace."""
    longest = max(len(search.order) for _, search, _ in traces)
    counts = np.unique(np.linspace(0, longest, FRAMES).astype(int))
    frames = [_frame(blocked, traces, ends, int(count)) for count in counts]
    pause = [FRAME_MS] * (len(frames) - 1) + [LAST_MS]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=pause, loop=0, optimize=True
    )


def _frame(
    blocked: NDArray[np.bool_],
    traces: Sequence[tuple[str, Trace, Sequence[Cell]]],
    ends: tuple[Cell, Cell],
    count: int,
) -> Image.Image:
    """Draw every search after `count` expansions."""
    height, width = blocked.shape
    size = max(4, 480 // width)
    canvas = Image.new(
        'RGB', ((width * size + GAP) * len(traces) - GAP, height * size + HEADING), 'white'
    )
    pen = ImageDraw.Draw(canvas)
    for number, (title, search, waypoints) in enumerate(traces):
        left = number * (width * size + GAP)
        seen = search.order[:count]
        done = count >= len(search.order)
        cells = cell_image(blocked, (seen, GREY if waypoints else PINK))[::-1]
        large = np.kron((cells * 255).astype(np.uint8), np.ones((size, size, 1), dtype=np.uint8))
        canvas.paste(Image.fromarray(large), (left, HEADING))
        pen.text((left + 2, 3), f'{title}: {len(seen)} expansions', fill='black')
        _draw_marks(pen, search, waypoints, ends, (left, height, size, done))
    return canvas.convert('P', palette=Image.Palette.ADAPTIVE, colors=32)


def _draw_marks(
    pen: ImageDraw.ImageDraw,
    search: Trace,
    waypoints: Sequence[Cell],
    ends: tuple[Cell, Cell],
    place: tuple[int, int, int, bool],
) -> None:
    left, height, size, done = place

    def centre(cell: Cell) -> tuple[float, float]:
        return left + (cell[0] + 0.5) * size, HEADING + (height - cell[1] - 0.5) * size

    if done and search.path:
        pen.line([centre(cell) for cell in search.path], fill=PATH, width=3)
    radius = 0.6 * size
    for point in waypoints:
        x, y = centre(point)
        corners = [(x, y - radius), (x + radius, y), (x, y + radius), (x - radius, y)]
        pen.polygon(corners, fill=STAR, outline='black')
    for cell, colour in zip(ends, (START, GOAL)):
        x, y = centre(cell)
        pen.rectangle((x - radius, y - radius, x + radius, y + radius), fill=colour)
