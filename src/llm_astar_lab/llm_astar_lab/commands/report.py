# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Rewrite summary, figures and reports of a results folder from its rows.

With --latex, only write its tables; with --readme, only replace the results section of a
README.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.problem_maps import load_kept_maps
from llm_astar_planner.cli.flags import option

from llm_astar_lab.analysis.summary import summarise_run
from llm_astar_lab.report.pages import replace_section, results_section, write_report
from llm_astar_lab.report.sentences import headline
from llm_astar_lab.report.table import report_tables, write_tables
from llm_astar_lab.results.folder import MAPS_FILE, ResultsFolder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    option(parser, 'folder DIR', 'a folder written by `llm-astar bench --out`')
    option(
        parser, '--readme FILE',
        'put finding, table and provenance between the lines <!-- results:begin --> and '
        '<!-- results:end --> of FILE',
    )  # fmt: skip
    option(
        parser, '--latex',
        'write every table to DIR/tables/NAME.tex, for \\input with the packages booktabs '
        'and adjustbox',
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Write the reports, the tables or the section; return 0.

    Raises ResultsError or ValueError.
    """
    folder = ResultsFolder(args.folder)
    metadata = folder.read_metadata()
    if args.readme or args.latex:
        return write_parts(args, folder, metadata)

    run = write_report(folder, metadata, load_kept_maps(folder.path / MAPS_FILE))
    print(f'{headline(run.comparisons)}\n{folder.path}/report.html')
    return 0


def write_parts(
    args: argparse.Namespace, folder: ResultsFolder, metadata: Mapping[str, Any]
) -> int:
    """Write the section and the tables that are asked for, and print their files; return 0."""
    summary = summarise_run(folder.stored(), metadata)
    if args.readme:
        replace_section(Path(args.readme), results_section(summary))
        print(args.readme)
    if args.latex:
        print(*write_tables(folder, report_tables(summary)), sep='\n')
    return 0
