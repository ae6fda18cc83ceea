"""A window in which searches expand side by side, where there is a display."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from llm_astar_planner.benchmark.animation import FRAME_MS, FRAMES
from llm_astar_planner.benchmark.figures import GREY, PATH, PINK, cell_image, draw_points
from llm_astar_planner.benchmark.trace import Trace
from llm_astar_planner.search.result import Cell

# Matplotlib's backends that draw to files alone; it falls back to agg without a display.
WINDOWLESS = ('agg', 'cairo', 'pdf', 'pgf', 'ps', 'svg', 'template')


class NoDisplayError(RuntimeError):
    """There is no window to show anything in."""


def show(
    blocked: NDArray[np.bool_],
    traces: Sequence[tuple[str, Trace, Sequence[Cell]]],
    ends: tuple[Cell, Cell],
) -> None:
    """Open a window and expand each of `traces` (title, search, its waypoints) until it is closed.

    Raises NoDisplayError where matplotlib has no windows here.
    """
    # pyplot picks a backend when it is imported, which only a window needs.
    from matplotlib import pyplot as plt  # noqa: PLC0415

    backend = plt.get_backend().lower()
    if backend in WINDOWLESS:
        message = f'there is no display (matplotlib backend {backend}); write a .gif instead'
        raise NoDisplayError(message)
    size = (5.5 * len(traces), 5.5 * blocked.shape[0] / blocked.shape[1] + 0.4)
    figure, panels = plt.subplots(
        1, len(traces), squeeze=False, figsize=size, layout='constrained'
    )
    images: list[AxesImage] = []
    for axes, (_, _, waypoints) in zip(panels[0], traces):
        images.append(axes.imshow(cell_image(blocked), origin='lower'))
        axes.set_axis_off()
        draw_points(axes, ends, waypoints)

    def step(count: int) -> list[AxesImage]:
        for axes, image, (title, search, waypoints) in zip(panels[0], images, traces):
            seen = search.order[:count]
            image.set_data(cell_image(blocked, (seen, GREY if waypoints else PINK)))
            axes.set_title(f'{title}: {len(seen)} expansions', fontsize=9)
            if count >= len(search.order) and search.path:
                axes.plot(*zip(*search.path), color=PATH, linewidth=2)
        return images

    longest = max(len(search.order) for _, search, _ in traces)
    counts = np.unique(np.linspace(0, longest, FRAMES).astype(int)).tolist()
    # The window must hold the animation as long as it lives.
    animation = FuncAnimation(figure, step, counts, interval=FRAME_MS, repeat=False)
    plt.show()
    del animation
