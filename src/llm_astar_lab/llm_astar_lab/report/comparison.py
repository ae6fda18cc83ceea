# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a comparison of runs found, as text, Markdown, JSON and tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.errors import printable

from llm_astar_lab.analysis.run_comparison import METRICS, SMALL, Run, RunComparison, SampleChange
from llm_astar_lab.report.pages import bullets, markdown_page
from llm_astar_lab.report.sentences import counted
from llm_astar_lab.report.table import Table, columns, counts, json_of, percents, text, texts
from llm_astar_lab.report.tables import VARIANT
from llm_astar_lab.results.row import WAYPOINTS_ONLY

LABELS = {
    'operation': 'Operation', 'storage': 'Storage', 'length': 'Length',
    'seconds_search': 'Search time',
}  # fmt: skip
# The changed samples that are shown of each run; changes.csv has more.
SHOWN_SAMPLES = 10
NOTE = (
    'Geometric means of the ratios to the base on the samples that both solved, in percent, with '
    "95 % confidence intervals by Student's t over maps; below 100 is better. Less, equal and "
    'more count samples by the {metric}; valid is the change of the share of valid paths. The p '
    'of no regression is adjusted to the number of variants by the method of Holm: below 0.05 is '
    'a regression. Power is the probability with which a growth by 2 % would be found.'
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
            if (problem := change.regression) is not None
        ]

    def unjudged(self) -> list[str]:
        """Return a line for each of the base's variants of which nothing can be said."""
        return [
            f'{comparison.path}: {sentence}'
            for comparison in self.comparisons
            for sentence in (
                *(f'{variant}: is missing' for variant in comparison.missing),
                *(
                    f'{change.variant}: too few samples have {self.metric} in both runs'
                    for change in comparison.changes
                    if change.variant.method != WAYPOINTS_ONLY
                    and math.isnan(change.metrics[self.metric].mean.low)
                ),
            )
        ]

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

    def findings(self) -> list[str]:
        """Return the regressions, what cannot be judged, and what would be found."""
        return [*self.regressions(), *self.unjudged(), *filter(None, [self.power_sentence()])]

    def power_sentence(self) -> str:
        """Say how probably a growth by SMALL would be found where that is least probable."""
        changes = [change for item in self.comparisons for change in item.changes]
        known = [change for change in changes if not math.isnan(change.power)]
        if not known:
            return ''
        least = min(known, key=lambda change: change.power)
        percent = min(99, round(100 * least.power))
        return (
            f'A growth of {self.metric} by {100 * SMALL:g} %{" more" if self.threshold else ""} '
            f'would be found with a probability of at least {percent} %, the least for '
            f'{least.variant}.'
        )

    def tables(self) -> list[Table]:
        """Return the tables of all runs: variants, and the samples that changed most."""
        several = len(self.comparisons) > 1
        return [
            table
            for number, comparison in enumerate(self.comparisons, start=1)
            for table in self.tables_of(comparison, f'_{number}' if several else '')
        ]

    def tables_of(self, comparison: RunComparison, end: str = '') -> list[Table]:
        """Return the tables of one run that have rows; `end` makes their names distinct."""
        compared = variant_table(comparison, self, f'compared{end}')
        changed = sample_table(comparison, self, f'changed{end}')
        return [table for table in (compared, changed) if table.rows]

    def as_text(self) -> str:
        """Return the comparison for a terminal."""
        parts = []
        for comparison in self.comparisons:
            lines = [f'{comparison.path} against {self.base.path}', *remarks(comparison)]
            parts.append('\n  '.join(printable(line) for line in lines))
            parts += [f'{table.title}\n{text(table)}' for table in self.tables_of(comparison)]
        lines = [*self.findings(), self.verdict()]
        return '\n\n'.join([*parts, '\n'.join(lines)])

    def as_markdown(self, picture: str) -> str:
        """Return the comparison as a page that shows `picture`, a file beside it."""
        parts = [
            (item, bullets(map(printable, remarks(item))), self.tables_of(item))
            for item in self.comparisons
        ]
        problems = bullets(map(printable, self.findings()))
        return markdown_page(
            'comparison.md.j2', judgement=self, problems=problems, parts=parts, picture=picture
        )

    def as_json(self) -> dict[str, Any]:
        """Return the comparison as JSON values."""
        names = ('version', 'dataset', 'machine')
        run = {'folder': str(self.base.path)} | {name: self.base.metadata[name] for name in names}
        return {
            'base': run,
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
                json_of(change) | {'variant': str(change.variant)} for change in comparison.changes
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


def variant_table(comparison: RunComparison, judgement: Judgement, name: str) -> Table:
    """Return a row for each variant: ratios to the base, and how many samples changed."""
    decisive = f'metrics.{judgement.metric}'
    heads = (
        *VARIANT,
        *counts({'Samples': 'samples'}),
        *percents({f'{LABELS[name]} / base (%)': f'metrics.{name}.mean' for name in METRICS}),
        *counts({head: f'{decisive}.{head.lower()}' for head in ('Less', 'Equal', 'More')}),
        *percents({'Valid (points)': 'valid'}),
        *counts({'Lost': 'lost', 'Gained': 'gained'}),
        *columns({'p': 'p_value'}, digits=3),
        *columns({'Power (%)': 'power'}, factor=100.0, digits=0),
    )
    note = NOTE.format(metric=LABELS[judgement.metric].lower())
    return Table.of(name, f'Ratios of {comparison.path}', heads, comparison.changes, note)


def sample_table(
    comparison: RunComparison,
    judgement: Judgement,
    name: str = 'changed',
    limit: int = SHOWN_SAMPLES,
) -> Table:
    """Return the samples that changed most: lost and gained paths, then the largest ratios."""
    label = LABELS[judgement.metric]
    digits = 6 if judgement.metric == 'seconds_search' else 2
    heads = (
        *VARIANT,
        *counts({'Map': 'map', 'Pair': 'pair', 'Scale': 'scale'}),
        *texts({'Code, base': lambda item: item.codes[0], 'Code': lambda item: item.codes[1]}),
        *columns({f'{label}, base': lambda item: item.metric[0]}, digits=digits),
        *columns({label: lambda item: item.metric[1]}, digits=digits),
        *columns(
            {'Length, base': lambda item: item.length[0], 'Length': lambda item: item.length[1]}
        ),
    )
    title = f'Samples that changed most in {comparison.path}'
    return Table.of(name, title, heads, comparison.samples[:limit])


def sample_json(sample: SampleChange, metric: str) -> Mapping[str, Any]:
    """Return what became of one sample, the base's value first."""
    return {
        'variant': str(sample.variant), 'map': sample.map, 'pair': sample.pair,
        'scale': sample.scale, 'code': sample.codes, metric: sample.metric,
        'length': sample.length,
    }  # fmt: skip
