"""Rewrite summary, figures and reports of a results folder from its rows.

With --readme, only replace the results section of a README.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from llm_astar_planner.benchmark.analysis.summary import compare_with_none, summarise
from llm_astar_planner.benchmark.datasets.samples import load_kept_maps
from llm_astar_planner.benchmark.report.markdown import replace_section, results_section
from llm_astar_planner.benchmark.results import MAPS_FILE, ResultsFolder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        'folder', metavar='DIR', help='a folder written by `llm-astar bench --out`'
    )
    parser.add_argument(
        '--readme', metavar='FILE',
        help='put finding, table and provenance between the lines <!-- results:begin --> and '
        '<!-- results:end --> of FILE',
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Write the reports or the section; return 0. Raises ResultsError or ValueError."""
    folder = ResultsFolder(args.folder)
    metadata = folder.read_metadata()
    if args.readme:
        rows, seed = folder.read(), int(metadata['parameters'].get('seed', 0))
        section = results_section(summarise(rows, seed), compare_with_none(rows, seed), metadata)
        replace_section(Path(args.readme), section)
        print(args.readme)
        return 0
    # Importing matplotlib takes most of a second, and a README section needs no figures.
    from llm_astar_planner.benchmark.report.write import write_report  # noqa: PLC0415

    summary = write_report(folder, metadata, load_kept_maps(folder.path / MAPS_FILE))
    print(f'{summary["headline"]}\n{folder.path}/report.html')
    return 0
