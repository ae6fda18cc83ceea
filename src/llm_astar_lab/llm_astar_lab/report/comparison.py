# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a comparison of runs found, as text, Markdown, JSON and tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.errors import printable

from llm_astar_lab.analysis.run_comparison import SMALL, Run, RunComparison
from llm_astar_lab.report.pages import markdown_page
from llm_astar_lab.report.sentences import counted, say
from llm_astar_lab.report.table import Table, json_of, text_table, texts_of
from llm_astar_lab.results.row import WAYPOINTS_ONLY

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
        label = LABELS[self.metric].lower()
        words = {'title': f'Ratios of {comparison.path}', 'label': label, 'metric': self.metric}
        compared = Table.of('compared', comparison.changes, file=f'compared{end}', **words)
        changed = self.changed_samples(comparison, SHOWN_SAMPLES, f'changed{end}')
        return [table for table in (compared, changed) if table.rows]

    def changed_samples(
        self, comparison: RunComparison, limit: int | None = None, file: str = 'changed'
    ) -> Table:
        """Return the samples that changed most: lost and gained paths, then large ratios."""
        title = f'Samples that changed most in {comparison.path}'
        unit = 'seconds' if self.metric == 'seconds_search' else 'number'
        label, samples = LABELS[self.metric], comparison.samples[:limit]
        return Table.of('changed', samples, [label], file=file, title=title, unit=unit)

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
