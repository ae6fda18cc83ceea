"""Draw the learning curve of a training run: `python -m llm_astar_training.curve DIR FILE.png`."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from matplotlib.figure import Figure


def draw(folder: Path, picture: Path) -> None:
    """Draw the held-out loss and the share of valid routes in `curve.csv` over the maps seen."""
    with (folder / 'curve.csv').open(encoding='utf-8') as file:
        rows = [
            {name: float(value) for name, value in row.items()} for row in csv.DictReader(file)
        ]
    maps = [row['maps'] / 1000 for row in rows]
    figure = Figure(figsize=(9, 3.6), layout='constrained')
    left, right = figure.subplots(1, 2)
    for name, label, colour in (
        ('recipe', "the paper's recipe", '#d62728'),
        ('wide', 'wider maps', '#1f77b4'),
    ):
        left.plot(maps, [row[f'loss_{name}'] for row in rows], label=label, color=colour)
        right.plot(maps, [100 * row[f'valid_{name}'] for row in rows], color=colour)
    left.set(xlabel='maps seen (thousands)', ylabel='held-out loss (nats per hop)', ylim=(0, None))
    right.set(xlabel='maps seen (thousands)', ylabel='valid greedy routes, held out (%)')
    left.legend()
    figure.savefig(picture, dpi=110)


if __name__ == '__main__':
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
