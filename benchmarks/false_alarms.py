"""How often `llm-astar compare` sees a regression between equal runs, and how often a real one.

Two runs of many variants are simulated whose samples differ by noise alone: each sample's work
changes by about 20 %, each map's by `--map-noise` of that, and 1 path in 50 is lost or gained. The
table has the share of simulations with any regression, which is to be at most 5 %, and the share
in which a growth by 2 % of one variant is found, beside the power that the command states.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from llm_astar_lab.report.comparison import METRICS, RunComparison, judge, variant_change
from llm_astar_lab.report.table import markdown_table
from llm_astar_lab.results.row import Variant
from numpy.typing import NDArray

NOISES = ('normal', 'laplace', 'sparse')


def noise(random: np.random.Generator, kind: str, size: int) -> NDArray[np.float64]:
    """Return numbers of mean 0 and variance 1; of the sparse ones 9 in 10 are 0."""
    if kind == 'laplace':
        return random.laplace(scale=np.sqrt(0.5), size=size)
    if kind == 'sparse':
        return random.normal(scale=np.sqrt(10.0), size=size) * (random.random(size) < 0.1)
    return random.normal(size=size)


def simulate(
    random: np.random.Generator, shape: tuple[int, int], options: argparse.Namespace, grown: float
) -> RunComparison:
    """Return two runs compared, of `shape` maps and samples a map; the first variant has grown."""
    maps, pairs = (values.ravel() for values in np.indices(shape))
    changes = []
    for number in range(options.variants):
        of_map = np.repeat(noise(random, options.noise, shape[0]), shape[1])
        of_sample = noise(random, options.noise, len(maps))
        logs = 0.2 * (of_sample + options.map_noise * of_map) + (grown if number == 0 else 0.0)
        columns = {'map': maps, 'pair': pairs, **dict.fromkeys(METRICS, np.exp(logs))}
        for run in (0, 1):
            failed = random.random(len(maps)) < 0.01
            columns[f'code_{run}'] = np.where(failed, 'NO_VALID_PATH', 'NONE')
        changes.append(variant_change(Variant('guided', f'{number}'), columns))
    compared = RunComparison(Path('run'), [], changes, [], [], [])
    return judge([compared], 'operation', 0.0)[0]


def measure(maps: int, options: argparse.Namespace) -> tuple[float, float, float]:
    """Return the shares of false alarms and of growths that were found, and the power stated."""
    random = np.random.default_rng(options.seed)
    shape = maps, max(1, options.samples // maps)
    alarms, found, powers = 0, 0, []
    for _ in range(options.times):
        equal = simulate(random, shape, options, 0.0)
        alarms += any(change.regression for change in equal.changes)
        powers.append(equal.changes[0].power)
        if options.power:
            grown = simulate(random, shape, options, np.log(1.02))
            found += grown.changes[0].regression is not None
    share = found / options.times if options.power else float('nan')
    return alarms / options.times, share, float(np.mean(powers))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--variants', type=int, default=29)
    parser.add_argument('--maps', type=int, nargs='+', default=[3, 10, 100])
    parser.add_argument('--samples', type=int, default=1000, help='of all maps together')
    parser.add_argument('--times', type=int, default=2000)
    parser.add_argument('--noise', choices=NOISES, default='normal')
    parser.add_argument('--map-noise', type=float, default=0.3)
    parser.add_argument('--power', action='store_true', help='also plant a growth by 2 %%')
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(arguments)
    rows = []
    for maps in options.maps:
        figures = (f'{100 * value:.1f}' for value in measure(maps, options))
        rows.append((str(maps), *figures))
    heads = ('maps', 'false alarms (%)', 'growth by 2 % found (%)', 'power stated (%)')
    print(markdown_table(heads, rows))


if __name__ == '__main__':
    main()
