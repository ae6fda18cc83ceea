"""What a comparison of runs found, as text, Markdown, JSON and tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from llm_astar_msgs_adapter.errors import printable

from llm_astar_lab.analysis.run_comparison import (
    METRICS,
    Run,
    RunComparison,
    SampleChange,
    VariantChange,
)
from llm_astar_lab.report.formats import markdown, text
from llm_astar_lab.report.sentences import counted, variant_label
from llm_astar_lab.report.table import Column, Table, percents, texts
from llm_astar_lab.results.row import WAYPOINTS_ONLY

LABELS = {
    'operation': 'Operation', 'storage': 'Storage', 'length': 'Length',
    'seconds_search': 'Search time',
}  # fmt: skip
# The changed samples that are shown of each run; changes.csv has more.
SHOWN_SAMPLES = 10
NOTE = (
    'Geometric means of the ratios to the base on the samples that both solved, in percent, with '
    '95 % confidence intervals by bootstrap over maps; below 100 is better. Less, equal and more '
    'count samples by the {metric}; valid is the change of the share of valid paths.'
)
ONE_MAP = 'All samples are of one map: the intervals say nothing about other maps.'


@dataclass(frozen=True)
class Judgement:
    """Runs compared with a base, and what counts as a regression.

    `threshold` is the part by which the `metric` may grow, 0.02 for 2 %.
    """

    base: Run
    comparisons: Sequence[RunComparison]
    metric: str
    threshold: float

    def regressions(self) -> list[str]:
        """Return a line for each variant of a run that is worse than the base's."""
        return [
            f'{comparison.path}: {change.variant}: {problem}'
            for comparison in self.comparisons
            for change in comparison.changes
            if (problem := change.regression(self.metric, self.threshold)) is not None
        ]

    def unjudged(self) -> list[str]:
        """Return a line for each of the base's variants of which nothing can be said."""
        lines = []
        for comparison in self.comparisons:
            names = [f'{variant}: is missing' for variant in comparison.missing]
            names += [
                f'{change.variant}: too few samples have {self.metric} in both runs'
                for change in comparison.changes
                if change.variant.method != WAYPOINTS_ONLY
                and math.isnan(change.metrics[self.metric].mean.low)
            ]
            lines += [f'{comparison.path}: {name}' for name in names]
        return lines

    def verdict(self) -> str:
        """Say whether there is a regression, and whether all could be judged."""
        found, unjudged = len(self.regressions()), len(self.unjudged())
        allowed = f' by more than {100 * self.threshold:g} %' if self.threshold else ''
        text = f'No variant is worse in {self.metric} than {self.base.path}{allowed}.'
        if found:
            text = f'{counted(found, "regression")} against {self.base.path}.'
        elif unjudged:
            text = f'No variant that can be judged is worse than {self.base.path}{allowed}.'
        return f'{text} {counted(unjudged, "variant")} cannot be judged.' if unjudged else text

    def tables(self) -> list[Table]:
        """Return the tables of all runs: variants, and the samples that changed most."""
        tables: list[Table] = []
        for number, comparison in enumerate(self.comparisons, start=1):
            end = f'_{number}' if len(self.comparisons) > 1 else ''
            tables += self.tables_of(comparison, end)
        return tables

    def tables_of(self, comparison: RunComparison, end: str = '') -> list[Table]:
        """Return the tables of one run that have rows; `end` makes their names distinct."""
        made = (
            variant_table(comparison, self, f'compared{end}'),
            sample_table(comparison, self, f'changed{end}'),
        )
        return [table for table in made if table.rows]

    def as_text(self) -> str:
        """Return the comparison for a terminal."""
        parts = []
        for comparison in self.comparisons:
            lines = [f'{comparison.path} against {self.base.path}', *remarks(comparison)]
            parts.append('\n  '.join(printable(line) for line in lines))
            parts += [f'{table.title}\n{text(table)}' for table in self.tables_of(comparison)]
        lines = [*self.regressions(), *self.unjudged(), self.verdict()]
        return '\n\n'.join([*parts, '\n'.join(lines)])

    def as_markdown(self, picture: str) -> str:
        """Return the comparison as a page that shows `picture`, a file beside it."""
        lines = [*self.regressions(), *self.unjudged()]
        parts = ['# Comparison of runs', self.verdict(), bullets(lines)]
        for comparison in self.comparisons:
            parts += [
                f'## {comparison.path} against {self.base.path}',
                bullets(remarks(comparison)),
            ]
            for table in self.tables_of(comparison):
                parts += [f'### {table.title}', table.note, markdown(table)]
        parts.append(f'![ratios to the base]({picture})')
        return '\n\n'.join(part for part in parts if part) + '\n'

    def as_json(self) -> dict[str, Any]:
        """Return the comparison as JSON values."""
        return {
            'base': run_json(self.base),
            'metric': self.metric,
            'threshold_percent': 100.0 * self.threshold,
            'regressions': self.regressions(),
            'unjudged': self.unjudged(),
            'comparisons': [self.comparison_json(item) for item in self.comparisons],
        }

    def comparison_json(self, comparison: RunComparison) -> dict[str, Any]:
        """Return one run's part of the JSON values."""
        return {
            'folder': str(comparison.path),
            'differences': list(comparison.differences),
            'unpaired': [str(variant) for variant in comparison.unpaired],
            'variants': [
                change_json(change)
                | {'regression': change.regression(self.metric, self.threshold)}
                for change in comparison.changes
            ],
            'samples': [
                sample_json(sample, self.metric) for sample in comparison.samples[:SHOWN_SAMPLES]
            ],
        }


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
        yield ONE_MAP


def variant_table(
    comparison: RunComparison, judgement: Judgement, name: str = 'compared'
) -> Table:
    """Return a row for each variant: ratios to the base, and how many samples changed."""
    metric = judgement.metric
    columns = (
        *texts('Variant'),
        Column('Samples', digits=0),
        *percents(*(f'{LABELS[name]} / base (%)' for name in METRICS)),
        *(Column(head, digits=0) for head in ('Less', 'Equal', 'More')),
        Column('Valid (points)', 100.0),
        *(Column(head, digits=0) for head in ('Lost', 'Gained')),
    )
    rows = [
        (
            variant_label(change.variant),
            change.samples,
            *(change.metrics[name].mean for name in METRICS),
            *(getattr(change.metrics[metric], name) for name in ('less', 'equal', 'more')),
            change.valid,
            change.lost,
            change.gained,
        )
        for change in comparison.changes
    ]
    note = NOTE.format(metric=LABELS[metric].lower())
    return Table(name, f'Ratios of {comparison.path}', columns, rows, note)


def sample_table(
    comparison: RunComparison,
    judgement: Judgement,
    name: str = 'changed',
    limit: int = SHOWN_SAMPLES,
) -> Table:
    """Return the samples that changed most: lost and gained paths, then the largest ratios."""
    label = LABELS[judgement.metric]
    digits = 6 if judgement.metric == 'seconds_search' else 2
    columns = (
        *texts('Variant'),
        *(Column(head, digits=0) for head in ('Map', 'Pair', 'Scale')),
        *texts('Code, base', 'Code'),
        *(Column(head, digits=digits) for head in (f'{label}, base', label)),
        *(Column(head) for head in ('Length, base', 'Length')),
    )
    rows = [
        (
            variant_label(sample.variant), sample.map, sample.pair, sample.scale, *sample.codes,
            *sample.metric, *sample.length,
        )
        for sample in comparison.samples[:limit]
    ]  # fmt: skip
    title = f'Samples that changed most in {comparison.path}'
    return Table(name, title, columns, rows)


def run_json(run: Run) -> dict[str, Any]:
    """Return which run a folder holds."""
    names = ('version', 'dataset', 'machine')
    return {'folder': str(run.path), **{name: run.metadata[name] for name in names}}


def change_json(change: VariantChange) -> dict[str, Any]:
    """Return the figures of a variant by name."""
    values = asdict(change)
    values |= {'variant': str(change.variant), 'valid': change.valid._asdict()}
    for metric in METRICS:
        values['metrics'][metric]['mean'] = change.metrics[metric].mean._asdict()
    return values


def sample_json(sample: SampleChange, metric: str) -> Mapping[str, Any]:
    """Return what became of one sample, the base's value first."""
    return {
        'variant': str(sample.variant), 'map': sample.map, 'pair': sample.pair,
        'scale': sample.scale, 'code': sample.codes, metric: sample.metric,
        'length': sample.length,
    }  # fmt: skip


def bullets(lines: Sequence[str] | Iterator[str]) -> str:
    """Return lines as a Markdown list."""
    return '\n'.join(f'- {printable(line)}' for line in lines)
