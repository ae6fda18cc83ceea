# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compare results folders of one dataset with the first of them, sample by sample.

Print the ratios to the base with intervals, and the samples that changed most. Say whether there
is a regression.

usage: llm-astar compare BASE RUN [RUN ...] [--metric NAME] [--variant NAME] [--threshold PERCENT]
                         [--json] [--out DIR]

examples:
  llm-astar compare out/before out/after                   does any variant expand more nodes?
  llm-astar compare out/before out/after --threshold 2     by more than 2 %?
  llm-astar compare out/a out/b out/c --variant guided/oracle --out out/compared
  llm-astar compare out/before out/after --metric seconds_search --threshold 5 --json

A regression is a variant whose ratio to the base is above the threshold, or that lost valid
paths, by a test over maps. The tests are adjusted to their number: however many variants there
are, equal runs have a regression with a probability of at most 5 %. The runs must be of the same
dataset; other versions, settings and machines are listed.

exit codes: 0 no regression, 1 a regression, 2 bad usage or input, 3 no regression, but a variant
of the base is missing or has too few samples to be judged, 130 interrupted
"""

import argparse
import json

from llm_astar_planner.cli.flags import at_least, option

from llm_astar_lab.report import comparison as runs
from llm_astar_lab.report.comparison import MAX_SAMPLES, METRICS, Judgement, load_run
from llm_astar_lab.results.folder import ResultsFolder, format_csv, without_nan

OK, REGRESSION, UNJUDGED = 0, 1, 3
# Percent by which a metric may grow where nothing else is asked for. Counts repeat exactly; the
# times of equal runs on a machine with other work differed by up to 43 %.
TOLERATED = {'seconds_search': 50.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    option(parser, 'base BASE', 'the results folder to compare with')
    option(parser, 'runs RUN', 'results folders of the same dataset', nargs='+')
    text = 'what decides about a regression (default: %(default)s, the expansions)'
    option(parser, '--metric', text, choices=METRICS, default='operation')
    option(
        parser, '--variant NAME',
        'only this variant, METHOD/SOURCE/PROMPT/MODEL without its empty parts, or all that '
        'begin so; a method alone is the one without waypoints',
    )  # fmt: skip
    text = 'how much the metric may grow (default: 0; 50 for seconds_search)'
    option(parser, '--threshold PERCENT', text, type=at_least(0))
    option(parser, '--json', 'print one JSON object')
    option(
        parser, '--out DIR',
        'write comparison.md and .json, and changes.csv with all changed samples (at most '
        f'{MAX_SAMPLES} of a variant)',
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Compare, print and write what is asked for; return the exit code. Raises ResultsError."""
    base = load_run(args.base)
    comparisons = [
        runs.compare_runs(base, load_run(path, base), args.metric, args.variant)
        for path in args.runs
    ]
    threshold = TOLERATED.get(args.metric, 0.0) if args.threshold is None else args.threshold
    comparisons = runs.judge(comparisons, args.metric, threshold / 100.0)
    judgement = Judgement(base, comparisons, args.metric, threshold / 100.0)
    if args.out:
        write_comparison(ResultsFolder(args.out), judgement)
    if args.json:
        print(json.dumps(without_nan(judgement.as_json())))
    else:
        print(judgement.as_text())
    if judgement.regressions():
        return REGRESSION
    return UNJUDGED if judgement.unjudged() else OK


def write_comparison(folder: ResultsFolder, judgement: Judgement) -> None:
    """Write everything about a comparison into a folder. Raises ResultsError."""
    folder.write_json('comparison.json', judgement.as_json())
    folder.write_text('comparison.md', judgement.as_markdown())
    for number, comparison in enumerate(judgement.comparisons, start=1):
        end = f'_{number}' if len(judgement.comparisons) > 1 else ''
        table = judgement.changed_samples(comparison)
        if table.rows:
            heads = [column.head for column in table.columns]
            lines = format_csv(without_nan([heads, *table.rows]))
            folder.write_text(f'changes{end}.csv', lines)
