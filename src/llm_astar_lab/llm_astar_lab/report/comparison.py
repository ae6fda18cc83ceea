# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compares results folders of one dataset: ratios with intervals, and the samples that changed.

What was found is told as text, Markdown, JSON and tables.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import nearest_name, printable, shortened
from numpy.typing import NDArray

from llm_astar_lab.analysis import statistics as stats
from llm_astar_lab.analysis.statistics import LENGTH_TOLERANCE, Estimate, Floats, Interval
from llm_astar_lab.analysis.thresholds import variants_of
from llm_astar_lab.report.pages import markdown_page
from llm_astar_lab.report.sentences import counted, say
from llm_astar_lab.report.table import Table, json_of, text_table, texts_of
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import WAYPOINTS_ONLY, ResultsError, Variant
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
Arrays = Mapping[str, NDArray[Any]]


class PastRun(NamedTuple):
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

    def problem(self, metric: str, grown: float, lost: float) -> str | None:
        """Say how the second run is worse by two adjusted p-values, or return None."""
        if grown < LEVEL:
            mean, low, high = (100.0 * end for end in self.metrics[metric].mean)
            return f'{metric} is {mean:.2f} % ({low:.2f} to {high:.2f}), p = {grown:.2g}'
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


def variant_change(
    variant: Variant, columns: Arrays, only_first: int = 0, only_second: int = 0
) -> VariantChange:
    """Return how a variant differs, with 95 % intervals of Student's t over maps.

    `columns` are those of the samples that two runs share: `*_0` of the first run, `*_1` of the
    second, and by the names of METRICS the ratios second / first. On a single map each of its
    pairs takes the place of a map.
    """
    maps = columns['map']
    groups = maps if len(np.unique(maps)) > 1 else columns['pair']
    first, second = (columns[f'code_{run}'] == 'NONE' for run in (0, 1))
    valid = stats.estimate(second.astype(float) - first, groups)
    lost, gained = int((first & ~second).sum()), int((second & ~first).sum())
    # Of k maps with a change all have lost paths by chance with a probability of 1 / 2^k, which
    # Student's t does not know of.
    changed = len(np.unique(groups[first != second]))
    p_fewer = max(Estimate(-valid.value, *valid[1:]).p_above(0.0), 0.5**changed)
    metrics = {name: metric_change(solved_ratios(columns, name), groups) for name in METRICS}
    return VariantChange(
        variant, len(maps), len(np.unique(maps)), only_first, only_second, valid.interval(), lost,
        gained, metrics, p_fewer if lost else math.nan,
    )  # fmt: skip


def solved_ratios(columns: Arrays, metric: str) -> Floats:
    """Return second / first of a metric; NaN where either found no path or has none."""
    solved = (columns['code_0'] == 'NONE') & (columns['code_1'] == 'NONE')
    return np.where(solved, columns[metric], np.nan)


def metric_change(every: Floats, every_group: NDArray[Any]) -> MetricChange:
    """Return the change of a metric by its ratios and the map of each."""
    ratios, groups = stats.known(every, every_group)
    found = stats.estimate(np.log(ratios), groups)
    p5, p95 = np.percentile(ratios, (5, 95)) if len(ratios) else (np.nan, np.nan)
    less = int((ratios < 1.0 - LENGTH_TOLERANCE).sum())
    more = int((ratios > 1.0 + LENGTH_TOLERANCE).sum())
    return MetricChange(
        len(ratios), Interval(*map(float, np.exp(found.interval()))),
        less, len(ratios) - less - more, more, float(p5), float(p95), *found[1:],
    )  # fmt: skip


def sample_changes(variant: Variant, columns: Arrays, metric: str) -> Iterator[SampleChange]:
    """Yield the samples that changed most, at most MAX_SAMPLES, the largest changes first."""
    logs = [np.abs(np.log(solved_ratios(columns, name))) for name in {metric, 'length'}]
    sizes = np.fmax.reduce([*logs, np.zeros(len(columns['map']))])
    sizes[columns['code_0'] != columns['code_1']] = np.inf
    order = np.argsort(-sizes, kind='stable')[:MAX_SAMPLES]
    for at in order[sizes[order] > LENGTH_TOLERANCE].tolist():
        found = {name: column[at] for name, column in columns.items()}
        place = int(found['map']), int(found['pair']), int(found['scale'])
        values, lengths = (
            (float(found[f'{name}_0']), float(found[f'{name}_1'])) for name in (metric, 'length')
        )
        codes = found['code_0'], found['code_1']
        yield SampleChange(variant, *place, codes, values, lengths, float(sizes[at]))


def load_run(path: str, base: PastRun | None = None) -> PastRun:
    """Read a results folder, to be compared with a base if that is given.

    Raises ResultsError where it is none or has no rows.
    """
    folder = ResultsFolder(path)
    metadata = folder.read_metadata()
    rows = folder.stored(None if base is None else base.rows)
    if not len(rows):
        raise ResultsError(f'{folder.results}: has no rows; run the benchmark to its end first')
    return PastRun(folder.path, metadata, rows)


def compare_runs(
    base: PastRun, other: PastRun, metric: str, name: str | None = None
) -> RunComparison:
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
        count = len(columns['map'])
        if not count:
            unpaired.append(variant)
            continue
        lone = (len(run.rows.arrays('samples', *variant)['map']) - count for run in (base, other))
        changes.append(variant_change(variant, columns, *lone))
        samples += sample_changes(variant, columns, metric)
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
    estimates = [change.metrics[metric].estimate for change in changes]
    limit = math.log1p(threshold) + LENGTH_TOLERANCE
    p_values = [*(one.p_above(limit) for one in estimates), *(one.lost_p for one in changes)]
    adjusted = stats.holm(p_values)
    tests = max(1, sum(not math.isnan(p) for p in adjusted))
    judged = iter([
        replace(
            change, p_value=float(np.fmin(grown, lost)),
            power=estimate.power(math.log1p(SMALL), LEVEL / tests),
            regression=change.problem(metric, grown, lost),
        )
        for change, estimate, grown, lost in zip(
            changes, estimates, adjusted, adjusted[len(changes):]
        )
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


def check_datasets(base: PastRun, other: PastRun) -> None:
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


LABELS = {
    'operation': 'Operation', 'storage': 'Storage', 'length': 'Length',
    'seconds_search': 'Search time',
}  # fmt: skip
# The changed samples that are shown of each run; changes.csv has more.
SHOWN_SAMPLES = 10


@dataclass(frozen=True)
class Judgement:
    """Runs compared with a base, and what counts as a regression.

    `threshold` is the part by which the `metric` may grow, 0.02 for 2 %.
    """

    base: PastRun
    comparisons: Sequence[RunComparison]
    metric: str
    threshold: float

    def regressions(self) -> list[str]:
        """Return a line for each variant of a run that is worse than the base's."""
        return [
            f'{comparison.path}: {change.variant}: {problem}'
            for comparison in self.comparisons
            for change in comparison.changes
            if (problem := change.regression) is not None
        ]

    def unjudged(self) -> list[str]:
        """Return a line for each of the base's variants of which nothing can be said."""
        lines = []
        for item in self.comparisons:
            lines += [f'{item.path}: {variant}: is missing' for variant in item.missing]
            lines += [
                f'{item.path}: {change.variant}: too few samples have {self.metric} in both runs'
                for change in item.changes
                if change.variant.method != WAYPOINTS_ONLY
                and math.isnan(change.metrics[self.metric].mean.low)
            ]
        return lines

    def verdict(self) -> str:
        """Say whether there is a regression, and whether all could be judged."""
        return say('verdict', self, len(self.regressions()), len(self.unjudged()))

    def findings(self) -> list[str]:
        """Return the regressions, what cannot be judged, and what would be found."""
        lines = [*self.regressions(), *self.unjudged()]
        changes = [change for item in self.comparisons for change in item.changes]
        known = [change for change in changes if not math.isnan(change.power)]
        if known:
            least = min(known, key=lambda change: change.power)
            percent = min(99, round(100 * least.power))
            lines.append(say('power', self, SMALL, percent, least.variant))
        return lines

    def tables_of(self, comparison: RunComparison) -> list[Table]:
        """Return the tables of one run that have rows: variants, and what changed most."""
        label = LABELS[self.metric].lower()
        words = {'title': f'Ratios of {comparison.path}', 'label': label, 'metric': self.metric}
        compared = Table.of('compared', comparison.changes, **words)
        changed = self.changed_samples(comparison, SHOWN_SAMPLES)
        return [table for table in (compared, changed) if table.rows]

    def changed_samples(self, comparison: RunComparison, limit: int | None = None) -> Table:
        """Return the samples that changed most: lost and gained paths, then large ratios."""
        title = f'Samples that changed most in {comparison.path}'
        unit = 'seconds' if self.metric == 'seconds_search' else 'number'
        samples = comparison.samples[:limit]
        return Table.of('changed', samples, [LABELS[self.metric]], title=title, unit=unit)

    def as_text(self) -> str:
        """Return the comparison for a terminal."""
        parts = []
        for comparison in self.comparisons:
            lines = [f'{comparison.path} against {self.base.path}', *remarks(comparison)]
            parts.append('\n  '.join(printable(line) for line in lines))
            parts += [
                f'{table.title}\n{text_table(*texts_of(table))}'
                for table in self.tables_of(comparison)
            ]
        lines = [*self.findings(), self.verdict()]
        return '\n\n'.join([*parts, '\n'.join(lines)])

    def as_markdown(self) -> str:
        """Return the comparison as a page."""
        return markdown_page('report/comparison.md.j2', judgement=self, remarks=remarks)

    def as_json(self) -> dict[str, Any]:
        """Return the comparison as JSON values."""
        names = ('version', 'dataset', 'machine')
        run = {'folder': str(self.base.path)} | {name: self.base.metadata[name] for name in names}
        return {
            'base': run, 'metric': self.metric, 'threshold_percent': 100.0 * self.threshold,
            'regressions': self.regressions(), 'unjudged': self.unjudged(),
            'comparisons': [self.comparison_json(item) for item in self.comparisons],
        }  # fmt: skip

    def comparison_json(self, comparison: RunComparison) -> dict[str, Any]:
        """Return one run's part of the JSON values."""
        return {
            'folder': str(comparison.path),
            'differences': list(comparison.differences),
            'unpaired': [str(variant) for variant in comparison.unpaired],
            'variants': [
                json_of(change) | {'variant': str(change.variant)} for change in comparison.changes
            ],
            'samples': [
                {
                    'variant': str(sample.variant), 'map': sample.map, 'pair': sample.pair,
                    'scale': sample.scale, 'code': sample.codes, self.metric: sample.metric,
                    'length': sample.length,
                }
                for sample in comparison.samples[:SHOWN_SAMPLES]
            ],
        }  # fmt: skip


def remarks(comparison: RunComparison) -> Iterator[str]:
    """Yield what a reader must know about a comparison: differences, and what is left out."""
    yield from comparison.differences
    if comparison.unpaired:
        names = ', '.join(str(variant) for variant in comparison.unpaired)
        yield f'not compared, because only one run has them: {names}'
    for which, name in (('only the base has', 'only_first'), ('the base lacks', 'only_second')):
        left_out = max(getattr(change, name) for change in comparison.changes)
        if left_out:
            yield f'{counted(left_out, "sample")} of a variant left out: {which} them'
    if all(change.maps == 1 for change in comparison.changes):
        yield 'All samples are of one map: the intervals say nothing about other maps.'
