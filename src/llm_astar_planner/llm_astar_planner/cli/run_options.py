"""What the commands that run methods over samples share: cases, running, closing."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from llm_astar_planner.benchmark.analysis.summary import summarise
from llm_astar_planner.benchmark.analysis.thresholds import Threshold, missed, parse_threshold
from llm_astar_planner.benchmark.datasets.reference_lengths import (
    compare_published,
    published_lengths,
)
from llm_astar_planner.benchmark.datasets.samples import load_kept_maps
from llm_astar_planner.benchmark.results import MAPS_FILE, ResultsError, ResultsFolder
from llm_astar_planner.benchmark.runner.cluster import connect
from llm_astar_planner.benchmark.runner.config import unanswered
from llm_astar_planner.benchmark.runner.engine import ALL_METHODS, Asker
from llm_astar_planner.benchmark.runner.sources import GRID_ABLATIONS, embedded_askers
from llm_astar_planner.cli.parameter_flags import add_endpoint_arguments
from llm_astar_planner.search.paper import HEURISTICS
from llm_astar_planner.waypoints.baselines import ablation_sources
from llm_astar_planner.waypoints.config import DEFAULT_PROMPT, SourceSettings
from llm_astar_planner.waypoints.factory import SOURCES
from llm_astar_planner.waypoints.prompts.template import TEMPLATES, template_path

# Requests in flight unless --jobs says.
LIVE_JOBS = 8
OK, MISSED, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 1, 2, 3, 130


def add_cases(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add what to run: methods, sources, prompts, models."""
    group.add_argument(
        '--methods',
        type=names,
        default=list(ALL_METHODS),
        metavar='NAMES',
        help=f'of {", ".join(ALL_METHODS)} (default: all)',
    )
    group.add_argument(
        '--source',
        type=names,
        default=[],
        metavar='NAMES',
        help=f'of {", ".join(SOURCES)} (default: embedded, and the ablations, which also go '
        f'beside every other source; on a grid {" and ".join(GRID_ABLATIONS)} alone: the others '
        'need a visibility graph, slow there and refused on large maps)',
    )
    group.add_argument(
        '--prompt', type=names, default=[], metavar='NAMES',
        help=f"for endpoint and replay: of {', '.join(TEMPLATES)}, or templates' paths",
    )  # fmt: skip
    group.add_argument(
        '--model', type=names, default=[], metavar='NAMES', help='for endpoint and replay'
    )
    add_endpoint_arguments(group)
    group.add_argument('--heuristic', default='euclidean', choices=tuple(HEURISTICS))
    group.add_argument('--weight', type=float, default=2.0, metavar='W', help="weighted A*'s (2)")
    group.add_argument(
        '--max-suboptimality',
        type=bound,
        metavar='W',
        help='have guided prove its paths within W, 1 or more; 0: take its first path (0)',
    )
    group.add_argument(
        '--price',
        type=float,
        nargs=2,
        metavar=('IN', 'OUT'),
        help='what a million tokens cost, for the cost column',
    )


def add_running(group: Any, out: str) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add how to run, and where to: into `out` by default."""
    group.add_argument('--out', default=out, metavar='DIR', help='(default: %(default)s)')
    group.add_argument('--resume', action='store_true', help='go on with an interrupted run')
    group.add_argument(
        '--jobs',
        type=count,
        metavar='N',
        help='samples at once, so requests in flight too (default: 1, or 8 with a live source)',
    )
    group.add_argument('--time-limit', type=float, default=60.0, metavar='SECONDS', help='(60)')
    group.add_argument('--dask', metavar='ADDRESS', help='spread over this Dask cluster')
    group.add_argument(
        '--fail-under',
        type=threshold,
        action='append',
        default=[],
        metavar='LIMIT',
        help='CASE:METRIC=LIMIT in percent: exit 1 where a ratio is above or a share below it',
    )
    group.add_argument('--json', action='store_true', help='print the summary as JSON')


def check_cases(args: argparse.Namespace) -> None:
    """Raise ValueError on what argparse could not know to be wrong."""
    known = {'methods': ALL_METHODS, 'source': tuple(SOURCES)}
    for option, names in known.items():
        for name in getattr(args, option):
            if name not in names:
                message = f'--{option} {name!r} is unknown; there is {", ".join(names)}'
                raise ValueError(message)
    if not args.weight >= 1.0:
        message = f'--weight {args.weight} is not 1 or more'
        raise ValueError(message)
    if not args.time_limit > 0.0:
        message = f'--time-limit {args.time_limit} is not above 0 seconds'
        raise ValueError(message)


def live_settings(args: argparse.Namespace) -> SourceSettings:
    """Return the settings of the sources that are asked live, by the options given."""
    return SourceSettings(
        base_url=args.base_url,
        api_key_env=args.api_key_env,
        transcript=args.transcript,
        timeout_s=args.time_limit,
        repair_rounds=args.repair_rounds,
        max_concurrent=args.jobs or LIVE_JOBS,
        # The samples bound the calls.
        max_calls_per_hour=0,
        record=str(ResultsFolder(args.out).transcript),
    )


def deciding_files(args: argparse.Namespace) -> list[Path]:
    """Return the transcript and the prompts, which decide rows as the dataset does."""
    files = [Path(args.transcript)] if args.transcript else []
    if 'endpoint' in args.source:
        prompts = args.prompt or [DEFAULT_PROMPT]
        files += [template_path(p) if p in TEMPLATES else Path(p).expanduser() for p in prompts]
    return files


@contextmanager
def make_executor(
    args: argparse.Namespace, askers: Sequence[Asker]
) -> Iterator[tuple[Executor, int]]:
    """Yield what runs the tasks and how many are handed to it at once."""
    if args.dask:
        with connect(args.dask, askers) as cluster:
            yield cluster
        return
    local = {'none', 'replay', *ablation_sources(), *(asker.name for asker in embedded_askers())}
    jobs = args.jobs or (1 if all(asker.name in local for asker in askers) else LIVE_JOBS)
    executor = ThreadPoolExecutor(jobs)
    try:
        yield executor, 2 * jobs
    finally:
        # What is in flight may take long to answer, and nobody waits for it any more.
        executor.shutdown(wait=False, cancel_futures=True)


def close_run(
    args: argparse.Namespace, folder: ResultsFolder, metadata: dict[str, Any], code: int
) -> int:
    """Write what is read of a run, print it, and settle the exit code."""
    # Drawing takes most of a second to import, and bad usage should not wait for it.
    from llm_astar_planner.benchmark.report.markdown import text_report  # noqa: PLC0415
    from llm_astar_planner.benchmark.report.write import publish  # noqa: PLC0415

    maps = load_kept_maps(folder.path / MAPS_FILE)
    try:
        folder.write_json('metadata.json', metadata)
        summary = publish(folder, metadata, maps)
        rows = folder.read()
    except ResultsError as error:
        return complain(args, str(error), INCOMPLETE)
    print(json.dumps(summary) if args.json else text_report(rows, args.seed))
    print(
        f'{len(rows)} rows in {metadata["seconds"]:.1f} s: {folder.path}/report.html',
        file=sys.stderr,
    )
    for line in unanswered(rows):
        code = complain(args, line, code or INCOMPLETE)
    for agreement in compare_published(rows, published_lengths(maps), args.heuristic):
        code = complain(args, str(agreement), code or (INCOMPLETE if agreement.first else OK))
    for line in missed(summarise(rows, args.seed), args.fail_under):
        code = complain(args, line, code or MISSED)
    return code


def complain(args: argparse.Namespace, message: str, code: int) -> int:
    """Say something on stderr under the command's name; return the exit code it leads to."""
    sys.stderr.write(f'llm-astar {args.command}: {message}\n')
    return code


def names(text: str) -> list[str]:
    """Read names with commas between them, one at least."""
    found = [name for name in text.split(',') if name]
    if not found:
        raise argparse.ArgumentTypeError('names are expected, with commas between them')
    return found


def threshold(text: str) -> Threshold:
    """Read CASE:METRIC=LIMIT."""
    try:
        return parse_threshold(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def count(text: str) -> int:
    """Read a whole number, 1 or more."""
    return _whole(text, 1)


def seed(text: str) -> int:
    """Read a whole number, 0 or more."""
    return _whole(text, 0)


def bound(text: str) -> float | None:
    """Read a factor, 1 or more; 0 for none."""
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if factor and not factor >= 1.0:
        raise argparse.ArgumentTypeError(f'{text!r} is neither 0 nor a number from 1')
    return factor or None


def _whole(text: str, least: int) -> int:
    try:
        number = int(text)
    except ValueError:
        number = least - 1
    if number < least:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from {least}')
    return number
