"""Pairs the rows of two runs by variant and sample: ratios with intervals, and what changed."""
# ruff: noqa: S608 - queries are put together from the names of columns alone

from __future__ import annotations

from collections.abc import Mapping
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
from llm_astar_lab.results.row import Variant
from llm_astar_lab.results.stored_rows import OF_VARIANT, StoredRows

# The columns of a row that are compared; of each, less is better.
METRICS = ('operation', 'storage', 'length', 'seconds_search')
# The code of a row with a valid path.
FOUND = 'NONE'
# Queries of a variant: its samples, and those that are in the run of another schema too.
SAMPLES = f'SELECT map FROM rows WHERE {OF_VARIANT}'
PAIRED = f"""
    SELECT map, pair, scale,
        {', '.join(f'a.{n} AS {n}_1, b.{n} AS {n}_2' for n in ('code', *METRICS))}
    FROM (FROM rows WHERE {OF_VARIANT}) a JOIN (FROM {{}}.rows WHERE {OF_VARIANT}) b
    USING (map, pair, scale) ORDER BY map, pair, scale"""


@dataclass(frozen=True)
class PairedRows:
    """The rows of one variant on the n samples that two runs share, in the order of the samples.

    `samples` [n, 3] are map, pair and scale; `codes` [2, n] are the result codes of the first run
    and the second, `values` [2, n, 4] their METRICS. `only_first` and `only_second` count the
    samples that only one run has.
    """

    variant: Variant
    samples: NDArray[np.int64]
    codes: NDArray[np.object_]
    values: NDArray[np.float64]
    only_first: int
    only_second: int

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which samples [2, n] have a valid path."""
        return np.asarray(self.codes == FOUND)

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


def pair_rows(first: StoredRows, second: StoredRows, variant: Variant) -> PairedRows | None:
    """Return the rows of a variant on the samples that both runs have, None without any.

    Both are in one database. Raises what reading them raises.
    """
    sizes = [len(rows.arrays(SAMPLES, *variant)['map']) for rows in (first, second)]
    found = first.arrays(PAIRED.format(second.schema), *variant, *variant)
    count = len(found['map'])
    if not count:
        return None
    of_runs = [[found[f'{name}_{run}'] for name in METRICS] for run in (1, 2)]
    return PairedRows(
        variant,
        np.stack([found[name] for name in ('map', 'pair', 'scale')], axis=1),
        np.stack([found['code_1'], found['code_2']]),
        np.stack(of_runs).transpose(0, 2, 1),
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
    before, now = paired.codes[:, place]
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
