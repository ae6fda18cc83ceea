# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compares results folders of one dataset: ratios with intervals, and the samples that changed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import nearest_name, shortened
from numpy.typing import NDArray

from llm_astar_lab.analysis import statistics as stats
from llm_astar_lab.analysis.statistics import LENGTH_TOLERANCE, Estimate, Floats, Interval
from llm_astar_lab.analysis.thresholds import variants_of
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError, Variant
from llm_astar_lab.results.stored_rows import StoredRows

# The columns of a row that are compared; of each, less is better.
METRICS = ('operation', 'storage', 'length', 'seconds_search')
# Changed samples that are kept of each variant, the largest changes first.
MAX_SAMPLES = 10_000
# The probability that equal runs have any regression, over all variants of all runs.
LEVEL = 0.05
# The growth of a metric whose probability to be found is said.
SMALL = 0.02
# Parameters of a run that do not change its rows.
IRRELEVANT = ('jobs', 'price')


class Run(NamedTuple):
    """A results folder that was read: its path, metadata and rows."""

    path: Path
    metadata: Mapping[str, Any]
    rows: StoredRows


@dataclass(frozen=True)
class MetricChange:
    """The ratios second / first of a metric over the `samples` that both runs solved.

    `mean` is the geometric mean, `error` the standard error of its logarithm and `degrees` one
    less than the maps; `less`, `equal` and `more` count the samples, `p5` and `p95` are
    percentiles of their ratios.
    """

    samples: int
    mean: Interval
    less: int
    equal: int
    more: int
    p5: float
    p95: float
    error: float = math.nan
    degrees: int = 0

    @property
    def estimate(self) -> Estimate:
        """The mean logarithm of the ratios, and how exact it is."""
        return Estimate(math.log(self.mean.value), self.error, self.degrees)


@dataclass(frozen=True)
class VariantChange:
    """How one variant differs between two runs, over the `samples` that both have.

    `only_first` and `only_second` count the samples that only one run has. `valid` is the change
    of the share of valid paths, second - first; `lost` and `gained` count the samples whose path
    only the first or only the second run found. `lost_p` is the p-value of no lower share, NaN
    where no path was lost. `judge` fills in the rest: the p-value among all variants, the
    `power` to find a growth by SMALL, and a sentence for a `regression`.
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
    lost_p: float
    p_value: float = math.nan
    power: float = math.nan
    regression: str | None = None

    def p_grown(self, metric: str, threshold: float) -> float:
        """Return the p-value of a ratio of at most 1 + `threshold`."""
        return self.metrics[metric].estimate.p_above(math.log1p(threshold) + LENGTH_TOLERANCE)

    def problem(self, metric: str, grown: float, lost: float) -> str | None:
        """Say how the second run is worse by two adjusted p-values, or return None."""
        if grown < LEVEL:
            mean = self.metrics[metric].mean
            low, high = (100.0 * end for end in mean[1:])
            text = f'{metric} is {100 * mean.value:.2f} % ({low:.2f} to {high:.2f})'
            return f'{text}, p = {grown:.2g}'
        if lost < LEVEL:
            return f'valid paths changed by {100 * self.valid.value:.2f} points, p = {lost:.2g}'
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

    Columns `*_0` are of the first run, `*_1` of the second, and those of METRICS the ratios.
    """

    def __init__(self, variant: Variant, columns: Mapping[str, NDArray[Any]]) -> None:
        """Take the columns; a map's samples, or on a single map each pair, are a group."""
        self.variant, self.columns, self.maps = variant, columns, columns['map']
        self.groups = self.maps if len(np.unique(self.maps)) > 1 else columns['pair']
        self.first, self.second = (columns[f'code_{run}'] == 'NONE' for run in (0, 1))

    def ratios(self, metric: str) -> Floats:
        """Return second / first of a metric; NaN where either found no path or has none."""
        return np.where(self.first & self.second, self.columns[metric], np.nan)

    def change(self, only_first: int = 0, only_second: int = 0) -> VariantChange:
        """Return how the variant differs, with 95 % intervals of Student's t over maps."""
        first, second = self.first, self.second
        valid = stats.estimate(second.astype(float) - first, self.groups)
        lost, gained = int((first & ~second).sum()), int((second & ~first).sum())
        # Of k maps with a change all have lost paths by chance with a probability of 1 / 2^k,
        # which Student's t does not know of.
        changed = len(np.unique(self.groups[first != second]))
        p_fewer = max(Estimate(-valid.value, *valid[1:]).p_above(0.0), 0.5**changed)
        return VariantChange(
            self.variant, len(self.maps), len(np.unique(self.maps)), only_first, only_second,
            valid.interval(), lost, gained,
            {metric: self.metric_change(metric) for metric in METRICS},
            p_fewer if lost else math.nan,
        )  # fmt: skip

    def metric_change(self, metric: str) -> MetricChange:
        """Return the change of one metric."""
        ratios, groups = stats.known(self.ratios(metric), self.groups)
        found = stats.estimate(np.log(ratios), groups)
        p5, p95 = np.percentile(ratios, (5, 95)) if len(ratios) else (np.nan, np.nan)
        less = int((ratios < 1.0 - LENGTH_TOLERANCE).sum())
        more = int((ratios > 1.0 + LENGTH_TOLERANCE).sum())
        return MetricChange(
            len(ratios), Interval(*map(float, np.exp(found.interval()))),
            less, len(ratios) - less - more, more, float(p5), float(p95), *found[1:],
        )  # fmt: skip

    def sample_changes(self, metric: str) -> Iterator[SampleChange]:
        """Yield the samples that changed most, at most MAX_SAMPLES, the largest changes first."""
        logs = [np.abs(np.log(self.ratios(name))) for name in {metric, 'length'}]
        sizes = np.fmax.reduce([*logs, np.zeros(len(self.maps))])
        sizes[self.columns['code_0'] != self.columns['code_1']] = np.inf
        order = np.argsort(-sizes, kind='stable')[:MAX_SAMPLES]
        for at in order[sizes[order] > LENGTH_TOLERANCE].tolist():
            found = {name: column[at] for name, column in self.columns.items()}
            place = int(found['map']), int(found['pair']), int(found['scale'])
            codes = found['code_0'], found['code_1']
            values, lengths = (
                (float(found[f'{name}_0']), float(found[f'{name}_1']))
                for name in (metric, 'length')
            )
            yield SampleChange(self.variant, *place, codes, values, lengths, float(sizes[at]))


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
    of_base = base.rows.variants()
    every = sorted({*of_base, *other.rows.variants()}, key=lambda variant: variant.report_order)
    changes: list[VariantChange] = []
    samples: list[SampleChange] = []
    unpaired = []
    for variant in chosen_variants(every, name):
        columns = base.rows.arrays('paired', *variant, *variant, schema=other.rows.schema)
        paired, count = PairedRows(variant, columns), len(columns['map'])
        if not count:
            unpaired.append(variant)
            continue
        lone = (len(run.rows.arrays('samples', *variant)['map']) - count for run in (base, other))
        changes.append(paired.change(*lone))
        samples += paired.sample_changes(metric)
    if not changes:
        message = f'{base.path} and {other.path} share no sample of {name or "any variant"}'
        raise ResultsError(message)
    return RunComparison(
        other.path, list(differences(base.metadata, other.metadata)), changes, unpaired,
        [variant for variant in of_base if variant in unpaired],
        sorted(samples, key=lambda sample: -sample.size),
    )  # fmt: skip


def judge(
    comparisons: Sequence[RunComparison], metric: str, threshold: float
) -> list[RunComparison]:
    """Return comparisons with p-values, power and regressions of all their variants.

    A regression is a growth of the metric by more than `threshold`, or fewer valid paths
    whatever the threshold, with a p-value below LEVEL after Holm's adjustment over everything
    that is tested.
    """
    changes = [change for item in comparisons for change in item.changes]
    grown = [change.p_grown(metric, threshold) for change in changes]
    adjusted = stats.holm([*grown, *(change.lost_p for change in changes)])
    tests = sum(not math.isnan(p) for p in adjusted)
    judged = iter([
        replace(
            change, p_value=float(np.fmin(grown, lost)),
            power=change.metrics[metric].estimate.power(math.log1p(SMALL), LEVEL / max(tests, 1)),
            regression=change.problem(metric, grown, lost),
        )
        for change, grown, lost in zip(changes, adjusted, adjusted[len(changes):])
    ])  # fmt: skip
    return [replace(item, changes=[next(judged) for _ in item.changes]) for item in comparisons]


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
