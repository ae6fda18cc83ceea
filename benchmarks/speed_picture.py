"""Draw the results of `benchmarks.speed`: time a query over the size of the map, log-log.

`python -m benchmarks.speed_picture out/speed docs/images/performance.png`
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.ours import EXACT
from benchmarks.tables import geometric_mean, load

# Colour and marker of each line; ours are blue and thick.
LINES = {
    EXACT: ('#08306b', 'o'),
    'guided': ('#2171b5', 's'),
    'guided, coarse, best effort': ('#6baed6', '^'),
    'Planner.plan': ('#00a0a0', 'D'),
    'nano-astar': ('#d95f02', 'o'),
    'pyastar2d': ('#e6ab02', 's'),
    'w9-pathfinding': ('#7a5230', '^'),
    'tcod': ('#e7298a', 'D'),
    'cstar-pathfinding': ('#7f7f7f', 'v'),
    'networkx': ('#b2182b', 'P'),
}
OURS = 4


def draw(folder: Path) -> Figure:
    """Return the figure of a folder of results: uniform costs left, graded ones right."""
    search = load(folder, 'search')
    figure = Figure(figsize=(10.0, 5.2), layout='constrained')
    panels = figure.subplots(1, 2, sharey=True)
    for panel, graded in zip(panels, (False, True)):
        cases = [one for one in search.values() if one['graded'] is graded]
        for number, (planner, (colour, marker)) in enumerate(LINES.items()):
            ours = number < OURS
            cells, times = points(cases, planner)
            panel.plot(
                cells,
                times,
                color=colour,
                marker=marker,
                markersize=5,
                linewidth=2.4 if ours else 1.2,
                linestyle='-' if ours else '--',
                label=planner,
                zorder=3 if ours else 2,
            )
        label(panel, 'graded costs' if graded else 'uniform costs')
    panels[0].set_ylabel('milliseconds of CPU a query')
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc='outside lower center', ncols=5, frameon=False)
    return figure


def points(cases: Sequence[dict[str, Any]], planner: str) -> tuple[list[float], list[float]]:
    """Return cells and milliseconds, geometric means over the cases of about the same size."""
    groups: dict[int, list[tuple[float, float]]] = {}
    for case in cases:
        for row in case['rows']:
            if row['planner'] == planner:
                pair = case['cells'], row['milliseconds']
                groups.setdefault(round(math.log2(case['cells']) / 2), []).append(pair)
    pairs = [[geometric_mean(values) for values in zip(*groups[key])] for key in sorted(groups)]
    return [cells for cells, _ in pairs], [time for _, time in pairs]


def label(panel: Axes, title: str) -> None:
    """Set the axes of a panel."""
    panel.set(xscale='log', yscale='log', title=title, xlabel='cells of the map')
    sides = {1581: '51x31', 512**2: '512²', 1024**2: '1024²', 4096**2: '4096²', 8192**2: '8192²'}
    panel.set_xticks(list(sides), list(sides.values()))
    panel.set_xticks([], minor=True)
    panel.yaxis.set_major_formatter('{x:g}')
    panel.grid(alpha=0.3)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw time a query over the size of the map."""
    parser = argparse.ArgumentParser('benchmarks.speed_picture', description=main.__doc__)
    parser.add_argument('folder', type=Path, help='results of benchmarks.speed')
    parser.add_argument('picture', type=Path, help='file to write')
    options = parser.parse_args(arguments)
    mpl.rcParams['font.size'] = 11
    draw(options.folder).savefig(options.picture, dpi=100)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
