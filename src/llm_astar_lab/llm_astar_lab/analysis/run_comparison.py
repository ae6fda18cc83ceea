# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compares results folders of one dataset: ratios with intervals, and the samples that changed."""
# ruff: noqa: S608 - queries are put together from the names of columns alone

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import nearest_name, shortened
from numpy.typing import NDArray

from llm_astar_lab.analysis import statistics as stats
from llm_astar_lab.analysis.statistics import LENGTH_TOLERANCE, Floats, Interval
from llm_astar_lab.analysis.summary import RATIO, report_order
from llm_astar_lab.analysis.thresholds import variants_of
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError, Variant
from llm_astar_lab.results.stored_rows import OF_VARIANT, StoredRows

# The columns of a row that are compared; of each, less is better.
METRICS = ('operation', 'storage', 'length', 'seconds_search')
# Changed samples that are kept of each variant, the largest changes first.
MAX_SAMPLES = 10_000
# Parameters of a run that do not change its rows.
IRRELEVANT = ('jobs', 'price')
# Queries of a variant: its samples, and those that are in the run of another schema too.
SAMPLES = f'SELECT map FROM rows WHERE {OF_VARIANT}'
PAIRED = f"""
    SELECT map, pair, scale,
        {', '.join(f'a.{n} AS {n}_0, b.{n} AS {n}_1' for n in ('code', *METRICS))},
        {', '.join(f'{RATIO.format(f"b.{n}", f"a.{n}")} AS {n}' for n in METRICS)}
    FROM (FROM rows WHERE {OF_VARIANT}) a JOIN (FROM {{}}.rows WHERE {OF_VARIANT}) b
    USING (map, pair, scale) ORDER BY map, pair, scale"""


class Run(NamedTuple):
    """A results folder that was read: its path, metadata and rows."""

    path: Path
    metadata: Mapping[str, Any]
    rows: StoredRows


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

    `only_first` and `only_second` count the samples that only one run has. `valid` is the change
    of the share of valid paths, second - first; `lost` and `gained` count the samples whose path
    only the first or only the second run found.
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
    """A sample whose result differs: codes, and the metric and lengths of both runs.

    The `size` of a change is |log ratio| of the metric or the length, whichever is larger, and
    infinite where the codes differ.
    """

    variant: Variant
    map: int
    pair: int
    scale: int
    codes: tuple[str, str]
    metric: tuple[float, float]
    length: tuple[float, float]
    size: float


@dataclass(frozen=True)
class RunComparison:
    """A run compared with the base: what differs in how they were run, and in their results.

    `unpaired` are the variants that only one of them has or that share no sample, `missing` those
    of them that the base has.
    """

    path: Path
    differences: Sequence[str]
    changes: Sequence[VariantChange]
    unpaired: Sequence[Variant]
    missing: Sequence[Variant]
    samples: Sequence[SampleChange]


class PairedRows:
    """The rows of one variant on the samples that two runs share, in the order of the samples.

    Columns `*_0` are of the first run, `*_1` of the second; `found` says which have a valid path.
    """

    def __init__(self, first: StoredRows, second: StoredRows, variant: Variant) -> None:
        """Pair the rows of two runs, which are in one database."""
        self.variant = variant
        self.columns = first.arrays(PAIRED.format(second.schema), *variant, *variant)
        self.found = [self.columns[f'code_{run}'] == 'NONE' for run in (0, 1)]
        self.only_first, self.only_second = (
            len(rows.arrays(SAMPLES, *variant)['map']) - len(self) for rows in (first, second)
        )

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.columns['map'])

    @property
    def groups(self) -> NDArray[np.int64]:
        """The map of each sample, or on a single map its pair, to draw the bootstrap from."""
        maps = self.columns['map']
        return maps if len(np.unique(maps)) > 1 else self.columns['pair']

    def ratios(self, metric: str) -> Floats:
        """Return second / first of a metric; NaN where either found no path or has none."""
        return np.where(self.found[0] & self.found[1], self.columns[metric], np.nan)

    def change(self, seed: int) -> VariantChange:
        """Return how the variant differs, with 95 % intervals by bootstrap over maps."""
        first, second = self.found
        return VariantChange(
            self.variant,
            len(self),
            len(np.unique(self.columns['map'])),
            self.only_first,
            self.only_second,
            stats.mean_interval(second.astype(float) - first, self.groups, seed),
            int((first & ~second).sum()),
            int((second & ~first).sum()),
            {metric: self.metric_change(metric, seed) for metric in METRICS},
        )

    def metric_change(self, metric: str, seed: int) -> MetricChange:
        """Return the change of one metric."""
        ratios, groups = stats.known(self.ratios(metric), self.groups)
        less, more = ratios < 1.0 - LENGTH_TOLERANCE, ratios > 1.0 + LENGTH_TOLERANCE
        return MetricChange(
            len(ratios),
            stats.ratio_interval(ratios, groups, seed),
            int(less.sum()),
            int((~less & ~more).sum()),
            int(more.sum()),
            *map(float, np.percentile(ratios, (5, 95)) if len(ratios) else (np.nan, np.nan)),
        )

    def sample_changes(self, metric: str) -> Iterator[SampleChange]:
        """Yield the samples that changed most, at most MAX_SAMPLES, the largest changes first."""
        logs = [np.abs(np.log(self.ratios(name))) for name in {metric, 'length'}]
        sizes = np.fmax.reduce([*logs, np.zeros(len(self))])
        sizes[self.columns['code_0'] != self.columns['code_1']] = np.inf
        order = np.argsort(-sizes, kind='stable')[:MAX_SAMPLES]
        places = order[sizes[order] > LENGTH_TOLERANCE]
        found = {name: column[places].tolist() for name, column in self.columns.items()}
        for at, size in enumerate(sizes[places].tolist()):
            codes, values, lengths = (
                (found[f'{name}_0'][at], found[f'{name}_1'][at])
                for name in ('code', metric, 'length')
            )
            place = found['map'][at], found['pair'][at], found['scale'][at]
            yield SampleChange(self.variant, *place, codes, values, lengths, size)


def load_run(path: str, base: Run | None = None) -> Run:
    """Read a results folder, to be compared with a base if that is given.

    Raises ResultsError where it is none or has no rows.
    """
    folder = ResultsFolder(path)
    metadata = folder.read_metadata()
    rows = folder.stored(None if base is None else base.rows)
    if not len(rows):
        raise ResultsError(f'{folder.results}: has no rows; run the benchmark to its end first')
    return Run(folder.path, metadata, rows)


def compare_runs(base: Run, other: Run, metric: str, name: str | None = None) -> RunComparison:
    """Compare a run with the base, all variants or those called `name`, largest changes by metric.

    Raises ResultsError where they have different datasets or share no samples.
    """
    check_datasets(base, other)
    seed = int(base.metadata['parameters'].get('seed', 0))
    of_base = base.rows.variants()
    every = sorted({*of_base, *other.rows.variants()}, key=report_order)
    chosen = chosen_variants(every, name)
    changes: list[VariantChange] = []
    samples: list[SampleChange] = []
    for variant in chosen:
        paired = PairedRows(base.rows, other.rows, variant)
        if len(paired):
            changes.append(paired.change(seed))
            samples += paired.sample_changes(metric)
    if not changes:
        message = f'{base.path} and {other.path} share no sample of {name or "any variant"}'
        raise ResultsError(message)
    compared = {change.variant for change in changes}
    unpaired = [variant for variant in chosen if variant not in compared]
    return RunComparison(
        other.path,
        list(differences(base.metadata, other.metadata)),
        changes,
        unpaired,
        [variant for variant in of_base if variant in unpaired],
        sorted(samples, key=lambda sample: -sample.size),
    )


def chosen_variants(every: Sequence[Variant], name: str | None) -> list[Variant]:
    """Return the variants that a name or its beginning means. Raises ResultsError for none."""
    names = [str(variant) for variant in every]
    found = variants_of(name or '', names)
    if not found:
        near = nearest_name(name or '', names)
        message = f'--variant {name}: no such variant{near or ";"} there are {", ".join(names)}'
        raise ResultsError(message)
    return [variant for variant in every if str(variant) in found]


def check_datasets(base: Run, other: Run) -> None:
    """Raise ResultsError where two runs are of different datasets or grids."""
    facts = [
        (run.metadata['dataset'].get('sha256'), run.metadata['parameters'].get('grid'))
        for run in (base, other)
    ]
    if facts[0] != facts[1]:
        first, second = (describe_dataset(run.metadata) for run in (base, other))
        message = (
            f'{base.path} and {other.path} cannot be compared: the first is of {first}, '
            f'the second of {second}'
        )
        raise ResultsError(message)


def describe_dataset(metadata: Mapping[str, Any]) -> str:
    """Return the name of a run's dataset with the beginning of its digest, and of its grid's."""
    dataset, grid = metadata['dataset'], metadata['parameters'].get('grid')
    text = f'{shortened(dataset.get("file", "?"))} (sha256 {str(dataset.get("sha256", "?"))[:12]}'
    return f'{text}, grid {str(grid)[:12]})' if grid else f'{text})'


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Yield what differs in how two runs were made: version, parameters, inputs, machine."""
    if before['version'] != now['version']:
        yield f'version: {before["version"]}, now {now["version"]}'
    for part in ('parameters', 'files', 'packages', 'machine'):
        first, second = before.get(part) or {}, now.get(part) or {}
        for name in dict.fromkeys((*first, *second)):
            values = first.get(name), second.get(name)
            if name not in IRRELEVANT and values[0] != values[1]:
                old, new = ('none' if value is None else shortened(str(value)) for value in values)
                if part == 'files':
                    old, new = old[:12], new[:12]
                yield f'{part}: {name}: {old}, now {new}'
