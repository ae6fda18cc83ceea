"""Pairs the rows of two runs by variant and sample: ratios with intervals, and what changed."""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_lab.analysis.statistics import (
    LENGTH_TOLERANCE,
    UNKNOWN,
    Interval,
    mean_interval,
    ratio_interval,
)
from llm_astar_lab.results.row import Row, Variant

# The columns of a row that are compared; of each, less is better.
METRICS = ('operation', 'storage', 'length', 'seconds_search')
# The code of a row with a valid path.
FOUND = 'NONE'
# How many numbers identify a sample: map, pair and scale.
KEYS = 3


@dataclass(frozen=True)
class RunRows:
    """What a comparison takes of the rows of a run: 64 bytes a row.

    `values` [n, 8] of a variant are map, pair, scale, the number of its code in `codes`, METRICS.
    """

    values: Mapping[Variant, NDArray[np.float64]]
    codes: tuple[str, ...]


@dataclass(frozen=True)
class PairedRows:
    """The rows of one variant on the n samples that two runs share, in the same order.

    `samples` [n, 3] are map, pair and scale; `codes` [2, n] are the result codes of the first run
    and the second by their places in `names`, `values` [2, n, 4] their METRICS. `only_first` and
    `only_second` count the samples that only one run has.
    """

    variant: Variant
    samples: NDArray[np.int64]
    codes: NDArray[np.int64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    only_first: int
    only_second: int

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which samples [2, n] have a valid path."""
        return np.array([name == FOUND for name in self.names])[self.codes]

    @property
    def groups(self) -> NDArray[np.int64]:
        """The map of each sample, or on a single map its pair, to draw the bootstrap from."""
        maps = self.samples[:, 0]
        return maps if len(np.unique(maps)) > 1 else self.samples[:, 1]

    def ratios(self, metric: str) -> NDArray[np.float64]:
        """Return second / first [n] of a metric; NaN where either found no path or has none."""
        first, second = self.values[:, :, METRICS.index(metric)]
        usable = self.found.all(axis=0) & (first > 0) & (second > 0)
        ratios = np.full(len(first), np.nan)
        ratios[usable] = second[usable] / first[usable]
        return ratios


@dataclass(frozen=True)
class MetricChange:
    """The ratios second / first of a metric over the `samples` that both runs solved.

    `mean` is the geometric mean; `less`, `equal` and `more` count the samples, `p5` and `p95` are
    percentiles of their ratios.
    """

    samples: int
    mean: Interval
    less: int
    equal: int
    more: int
    p5: float
    p95: float


@dataclass(frozen=True)
class VariantChange:
    """How one variant differs between two runs, over the `samples` that both have.

    `valid` is the change of the share of valid paths, second - first; `lost` and `gained` count
    the samples whose path only the first or only the second run found.
    """

    variant: Variant
    samples: int
    maps: int
    only_first: int
    only_second: int
    valid: Interval
    lost: int
    gained: int
    metrics: Mapping[str, MetricChange]

    def regression(self, metric: str, threshold: float) -> str | None:
        """Say how the second run is worse, or return None.

        It is where the whole interval of the metric's ratio is above 1 + `threshold`, or that of
        the valid paths below 0, whatever the threshold.
        """
        mean = self.metrics[metric].mean
        if mean.low > 1.0 + threshold + LENGTH_TOLERANCE:
            low, high = (100.0 * end for end in mean[1:])
            return f'{metric} is {100 * mean.value:.2f} % ({low:.2f} to {high:.2f})'
        if self.valid.high < 0.0:
            return f'valid paths changed by {100 * self.valid.value:.2f} points'
        return None


class SampleChange(NamedTuple):
    """A sample whose result differs: codes, and the metric and lengths of both runs."""

    variant: Variant
    map: int
    pair: int
    scale: int
    codes: tuple[str, str]
    metric: tuple[float, float]
    length: tuple[float, float]
    size: float


def run_rows(rows: Iterable[Row]) -> RunRows:
    """Read rows once and keep what a comparison takes of them. Raises what reading them raises."""
    codes: dict[str, int] = {}
    columns: dict[Variant, array[float]] = defaultdict(lambda: array('d'))
    for row in rows:
        code = codes.setdefault(row.code, len(codes))
        numbers = (getattr(row, metric) for metric in METRICS)
        columns[row.variant].extend((row.map, row.pair, row.scale, code, *numbers))
    width = KEYS + 1 + len(METRICS)
    values = {name: np.frombuffer(found).reshape(-1, width) for name, found in columns.items()}
    return RunRows(values, tuple(codes))


def pair_rows(first: RunRows, second: RunRows, variant: Variant) -> PairedRows | None:
    """Return the rows of a variant on the samples that both runs have, None without any."""
    if variant not in first.values or variant not in second.values:
        return None
    runs = first.values[variant], second.values[variant]
    keys = np.concatenate([values[:, :KEYS] for values in runs]).astype(np.int64)
    _, numbers = np.unique(keys, axis=0, return_inverse=True)
    numbers = numbers.reshape(-1)
    sizes = [len(values) for values in runs]
    _, *places = np.intersect1d(numbers[: sizes[0]], numbers[sizes[0] :], return_indices=True)
    count = len(places[0])
    if not count:
        return None
    shared = [values[place] for values, place in zip(runs, places)]
    names = {name: number for number, name in enumerate({*first.codes, *second.codes})}
    codes = [
        np.array([names[name] for name in run.codes])[values[:, KEYS].astype(int)]
        for run, values in zip((first, second), shared)
    ]
    return PairedRows(
        variant,
        shared[0][:, :KEYS].astype(np.int64),
        np.array(codes),
        tuple(names),
        np.stack([values[:, KEYS + 1 :] for values in shared]),
        sizes[0] - count,
        sizes[1] - count,
    )


def variant_change(paired: PairedRows, seed: int = 0) -> VariantChange:
    """Return how a variant differs, with 95 % intervals by bootstrap over maps."""
    first, second = paired.found
    difference = second.astype(float) - first
    return VariantChange(
        paired.variant,
        len(paired.samples),
        len(np.unique(paired.samples[:, 0])),
        paired.only_first,
        paired.only_second,
        mean_interval(difference, paired.groups, seed),
        int((first & ~second).sum()),
        int((second & ~first).sum()),
        {metric: metric_change(paired, metric, seed) for metric in METRICS},
    )


def metric_change(paired: PairedRows, metric: str, seed: int) -> MetricChange:
    """Return the change of one metric."""
    every = paired.ratios(metric)
    known = ~np.isnan(every)
    ratios, groups = every[known], paired.groups[known]
    if not len(ratios):
        return MetricChange(0, UNKNOWN, 0, 0, 0, np.nan, np.nan)
    less, more = ratios < 1.0 - LENGTH_TOLERANCE, ratios > 1.0 + LENGTH_TOLERANCE
    p5, p95 = np.percentile(ratios, (5, 95))
    return MetricChange(
        len(ratios),
        ratio_interval(ratios, groups, seed),
        int(less.sum()),
        int((~less & ~more).sum()),
        int(more.sum()),
        float(p5),
        float(p95),
    )


def sample_changes(paired: PairedRows, metric: str, limit: int) -> list[SampleChange]:
    """Return the samples of a variant that changed most, at most `limit`, the largest first.

    The size of a change is |log ratio| of the metric or the length, whichever is larger, and
    infinite where the codes differ.
    """
    logs = [np.abs(np.log(paired.ratios(name))) for name in {metric, 'length'}]
    sizes = np.fmax.reduce([*logs, np.zeros(len(paired.samples))])
    sizes[paired.codes[0] != paired.codes[1]] = np.inf
    order = np.argsort(-sizes, kind='stable')[:limit]
    return [
        sample_change(paired, int(place), metric, float(sizes[place]))
        for place in order
        if sizes[place] > LENGTH_TOLERANCE
    ]


def sample_change(paired: PairedRows, place: int, metric: str, size: float) -> SampleChange:
    """Return how one sample, by its place in `paired`, changed."""
    map_id, pair, scale = paired.samples[place].tolist()
    first, second = paired.values[:, place].tolist()
    before, now = (paired.names[code] for code in paired.codes[:, place])
    column, length = METRICS.index(metric), METRICS.index('length')
    return SampleChange(
        paired.variant,
        map_id,
        pair,
        scale,
        (before, now),
        (first[column], second[column]),
        (first[length], second[length]),
        size,
    )
