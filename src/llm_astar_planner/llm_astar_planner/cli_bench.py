"""`llm-astar bench`: methods with and without waypoints over a dataset, with the truth beside."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.barrier_map import BarrierMap
from llm_astar_msgs_adapter.grid_problem import GridProblem

from llm_astar_planner.benchmark.askers import (
    GRID_ABLATIONS,
    check_grid_run,
    embedded_askers,
    make_askers,
)
from llm_astar_planner.benchmark.cluster import connect
from llm_astar_planner.benchmark.engine import ALL_METHODS, LLM_ONLY, Asker, Settings
from llm_astar_planner.benchmark.progress import progress
from llm_astar_planner.benchmark.published import compare_published, published_lengths
from llm_astar_planner.benchmark.results import MAPS_FILE, ResultsError, ResultsFolder
from llm_astar_planner.benchmark.run import Sweep, begin, carry_out, unanswered
from llm_astar_planner.benchmark.samples import (
    ProblemMap,
    load_kept_maps,
    load_maps,
    parse_ranges,
    save_kept_maps,
    select_samples,
)
from llm_astar_planner.benchmark.summary import summarise
from llm_astar_planner.benchmark.thresholds import missed, parse_threshold
from llm_astar_planner.prompts.template import TEMPLATES, template_path
from llm_astar_planner.search.methods import HEURISTICS, WAYPOINT_METHODS
from llm_astar_planner.share import find_file
from llm_astar_planner.waypoint_source.ablation import ablation_sources
from llm_astar_planner.waypoint_source.factory import SOURCES
from llm_astar_planner.waypoint_source.settings import DEFAULT_PROMPT, SourceSettings

# Requests in flight unless --jobs says.
LIVE_JOBS = 8
OK, MISSED, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 1, 2, 3, 130
EPILOG = """\
examples:
  llm-astar bench                                 every method and ablation, no key needed
  llm-astar bench --source replay --transcript replies.jsonl --out out/replies
  llm-astar bench --source endpoint --model gpt-4o-mini --prompt few_shot,cot --limit 50
  llm-astar bench --scales 1-10 --limit 100       with the growth of work over the scale
  llm-astar bench --dataset x.map.scen --methods exact_astar,astar    a MovingAI benchmark
  llm-astar bench --fail-under llm_astar/oracle:operation=60 --fail-under llm_astar:valid=100

A grid dataset is planned on without cutting corners, as MovingAI does. Lengths that a .scen file
publishes are held against those of exact_astar and astar.

exit codes: 0 ok, 1 threshold missed, 2 bad usage or input, 3 incomplete or off a published
length, 130 interrupted
"""


def add_parser(subparsers: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the sub-command `bench`."""
    parser = subparsers.add_parser(
        'bench',
        help='run methods with and without waypoints over a dataset',
        description='Replay start-goal samples with every method and source of waypoints, and '
        'write a results folder: rows, summary, report.md, report.html, pictures.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    _add_samples(parser.add_argument_group('samples'))
    _add_cases(parser.add_argument_group('cases'))
    _add_running(parser.add_argument_group('running'))


def _add_samples(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    group.add_argument(
        '--dataset',
        default='samples_1000.json',
        metavar='FILE',
        help='barrier-map JSON, a path or a name in maps/ (default: %(default)s); or a grid: '
        "MovingAI's x.map.scen beside its map, or a map_server yaml, on which pairs are drawn",
    )
    group.add_argument('--maps', metavar='RANGES', help='map ids, such as 50-99 or 0-9,12')
    group.add_argument(
        '--limit',
        type=_count,
        metavar='N',
        help='draw N of the samples; on a yaml map so many new ones (100)',
    )
    group.add_argument(
        '--scales', default='1', metavar='RANGES', help='scales of the maps, such as 1-10 (1)'
    )
    group.add_argument(
        '--scale-samples',
        type=_count,
        default=10,
        metavar='N',
        help='samples drawn to compare scales on (10)',
    )
    group.add_argument('--seed', type=int, default=0, help='of every draw (0)')


def _add_cases(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    group.add_argument(
        '--methods',
        type=_names,
        default=list(ALL_METHODS),
        metavar='NAMES',
        help=f'of {", ".join(ALL_METHODS)} (default: all)',
    )
    group.add_argument(
        '--source',
        type=_names,
        default=[],
        metavar='NAMES',
        help=f'of {", ".join(SOURCES)} (default: embedded, and the ablations, which also go '
        f'beside every other source; on a grid {" and ".join(GRID_ABLATIONS)} alone: the others '
        'need a visibility graph, slow there and refused on large maps)',
    )
    group.add_argument('--prompt', type=_names, default=[], metavar='NAMES')
    group.add_argument('--model', type=_names, default=[], metavar='NAMES')
    group.add_argument(
        '--transcript', default='', metavar='FILE', help='what the source replay answers from'
    )
    group.add_argument(
        '--base-url',
        default=SourceSettings.base_url,
        metavar='URL',
        help="endpoint's (OpenAI)",
    )
    group.add_argument(
        '--api-key-env', default='', metavar='NAME', help='the variable that holds its key'
    )
    group.add_argument(
        '--repair-rounds',
        type=int,
        default=0,
        metavar='N',
        help='how often a live model is told what collides and asked again (0)',
    )
    group.add_argument('--heuristic', default='euclidean', choices=tuple(HEURISTICS))
    group.add_argument('--weight', type=float, default=2.0, metavar='W', help="weighted A*'s (2)")
    group.add_argument(
        '--max-suboptimality',
        type=float,
        metavar='W',
        help='have guided prove its paths within W, 1 or more (default: its first path)',
    )
    group.add_argument(
        '--price',
        type=float,
        nargs=2,
        metavar=('IN', 'OUT'),
        help='what a million tokens cost, for the cost column',
    )


def _add_running(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    group.add_argument('--out', default='out/bench', metavar='DIR', help='(default: %(default)s)')
    group.add_argument('--resume', action='store_true', help='go on with an interrupted run')
    group.add_argument(
        '--jobs',
        type=_count,
        metavar='N',
        help='samples at once, so requests in flight too (default: 1, or 8 with a live source)',
    )
    group.add_argument('--time-limit', type=float, default=60.0, metavar='SECONDS', help='(60)')
    group.add_argument(
        '--dask', metavar='ADDRESS', help='spread over this Dask cluster (extra: cluster)'
    )
    group.add_argument(
        '--fail-under',
        type=parse_threshold,
        action='append',
        default=[],
        metavar='LIMIT',
        help='CASE:METRIC=LIMIT in percent: exit 1 where a ratio is above or a share below it',
    )
    group.add_argument('--json', action='store_true', help='print the summary as JSON')


def run(args: argparse.Namespace) -> int:
    """Run the benchmark; return its exit code. Raises ValueError on bad input."""
    _check(args)
    dataset = find_file(args.dataset, 'maps')
    maps = load_maps(dataset, args.limit, args.seed)
    sweep = _sweep(args, dataset, maps)
    _say_which_ablations(args, maps)
    folder = ResultsFolder(args.out)
    try:
        tasks, metadata = begin(folder, sweep, _parameters(args, maps), resume=args.resume)
        _save_maps(folder, sweep, maps)
    except ResultsError as error:
        return _complain(str(error), BAD_INPUT)
    code = OK
    try:
        with _executor(args, sweep.askers) as (executor, at_once), progress(len(tasks)) as step:
            metadata['parameters']['jobs'] = args.dask or at_once // 2
            carry_out(folder, tasks, executor, at_once, metadata=metadata, step=step)
    except KeyboardInterrupt:
        left = 'the rows so far are kept; go on with --resume'
        code = _complain(f'interrupted: {left}', INTERRUPTED)
    except ResultsError as error:
        return _complain(str(error), INCOMPLETE)
    return _close(args, folder, metadata, code)


def _close(
    args: argparse.Namespace, folder: ResultsFolder, metadata: dict[str, Any], code: int
) -> int:
    """Write what is read of a run, print it, and settle the exit code."""
    # Drawing takes most of a second to import, and bad usage should not wait for it.
    from llm_astar_planner.benchmark.publish import publish  # noqa: PLC0415
    from llm_astar_planner.benchmark.report_md import text_report  # noqa: PLC0415

    maps = load_kept_maps(folder.path / MAPS_FILE)
    try:
        folder.write_json('metadata.json', metadata)
        summary = publish(folder, metadata, maps)
        rows = folder.read()
    except ResultsError as error:
        return _complain(str(error), INCOMPLETE)
    print(json.dumps(summary) if args.json else text_report(rows, args.seed))
    print(
        f'{len(rows)} rows in {metadata["seconds"]:.1f} s: {folder.path}/report.html',
        file=sys.stderr,
    )
    for line in unanswered(rows):
        code = _complain(line, code or INCOMPLETE)
    for agreement in compare_published(rows, published_lengths(maps), args.heuristic):
        code = _complain(str(agreement), code or (INCOMPLETE if agreement.first else OK))
    for line in missed(summarise(rows, args.seed), args.fail_under):
        code = _complain(line, code or MISSED)
    return code


def _say_which_ablations(args: argparse.Namespace, maps: Sequence[ProblemMap]) -> None:
    """Say that a grid is run without the ablations that take long there."""
    guided = set(args.methods) & {*WAYPOINT_METHODS, LLM_ONLY}
    if (
        isinstance(maps[0], GridProblem)
        and guided
        and not set(args.source) & ablation_sources().keys()
    ):
        names = ' and '.join(GRID_ABLATIONS)
        _complain(f'on a grid, {names} are the only ablations; name others with --source', OK)


def _complain(message: str, code: int) -> int:
    sys.stderr.write(f'llm-astar bench: {message}\n')
    return code


def _check(args: argparse.Namespace) -> None:
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
    if args.max_suboptimality is not None and not args.max_suboptimality >= 1.0:
        message = f'--max-suboptimality {args.max_suboptimality} is not 1 or more'
        raise ValueError(message)
    if not args.time_limit > 0.0:
        message = f'--time-limit {args.time_limit} is not above 0 seconds'
        raise ValueError(message)


def _sweep(args: argparse.Namespace, dataset: Path, maps: Sequence[ProblemMap]) -> Sweep:
    scales = parse_ranges(args.scales, '--scales')
    grids = [item for item in maps if isinstance(item, GridProblem)]
    for problem in grids:
        check_grid_run(problem, scales, args.source)
    settings = SourceSettings(
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
    askers = make_askers(
        args.source,
        args.prompt,
        args.model,
        settings=settings,
        dataset=[item for item in maps if isinstance(item, BarrierMap)],
        seed=args.seed,
        default=GRID_ABLATIONS if grids else None,
    )
    return Sweep(
        dataset,
        select_samples(maps, str(dataset), args.maps, args.limit, args.seed),
        args.methods,
        askers,
        Settings(args.heuristic, args.weight, args.time_limit, args.max_suboptimality),
        scales,
        args.scale_samples,
        args.seed,
        _deciding_files(args),
    )


def _deciding_files(args: argparse.Namespace) -> list[Path]:
    """Return the transcript and the prompts, which decide rows as the dataset does."""
    files = [Path(args.transcript)] if args.transcript else []
    if 'endpoint' in args.source:
        prompts = args.prompt or [DEFAULT_PROMPT]
        files += [template_path(p) if p in TEMPLATES else Path(p).expanduser() for p in prompts]
    return files


def _parameters(args: argparse.Namespace, maps: Sequence[ProblemMap]) -> dict[str, Any]:
    names = (
        'maps', 'limit', 'scales', 'scale_samples', 'seed', 'methods', 'source', 'prompt', 'model',
        'base_url', 'repair_rounds', 'heuristic', 'weight', 'time_limit', 'max_suboptimality',
        'price', 'jobs',
    )  # fmt: skip
    parameters = {name: getattr(args, name) for name in names}
    # The dataset's own digest is that of a file that only names the grid.
    grids = [item.digest for item in maps if isinstance(item, GridProblem)]
    return parameters | ({'grid': grids[0]} if grids else {})


def _save_maps(folder: ResultsFolder, sweep: Sweep, maps: Sequence[ProblemMap]) -> None:
    """Keep the maps with the rows, so that a folder can be reported on by itself."""
    ids = {sample.barrier_map.id for sample in sweep.samples}
    try:
        save_kept_maps([item for item in maps if item.id in ids], folder.path / MAPS_FILE)
    except OSError as error:
        message = f'{folder.path / MAPS_FILE}: {error.strerror or error}'
        raise ResultsError(message) from None


@contextmanager
def _executor(args: argparse.Namespace, askers: Sequence[Asker]) -> Iterator[tuple[Executor, int]]:
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


def _names(text: str) -> list[str]:
    return [name for name in text.split(',') if name]


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f'{number} is not 1 or more')
    return number
