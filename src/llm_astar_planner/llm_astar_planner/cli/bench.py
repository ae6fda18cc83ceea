"""`llm-astar bench`: methods with and without waypoints over a dataset, with the truth beside."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem

from llm_astar_planner.benchmark.datasets.samples import (
    ProblemMap,
    load_maps,
    parse_ranges,
    save_kept_maps,
    select_samples,
)
from llm_astar_planner.benchmark.results import MAPS_FILE, ResultsError, ResultsFolder
from llm_astar_planner.benchmark.runner.config import Sweep, begin, carry_out
from llm_astar_planner.benchmark.runner.engine import LLM_ONLY, Settings
from llm_astar_planner.benchmark.runner.progress import progress
from llm_astar_planner.benchmark.runner.sources import GRID_ABLATIONS, check_grid_run, make_askers
from llm_astar_planner.cli.run_options import (
    BAD_INPUT,
    INCOMPLETE,
    INTERRUPTED,
    OK,
    add_cases,
    add_running,
    check_cases,
    close_run,
    complain,
    count,
    deciding_files,
    live_settings,
    make_executor,
    seed,
)
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.paper import WAYPOINT_METHODS
from llm_astar_planner.waypoints.baselines import ablation_sources

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
        description='Replay start-goal samples with every method and source of waypoints, and '
        'write a results folder: rows, summary, report.md, report.html, pictures.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run, command='bench')
    _add_samples(parser.add_argument_group('samples'))
    add_cases(parser.add_argument_group('cases'))
    add_running(parser.add_argument_group('running'), 'out/bench')


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
        type=count,
        metavar='N',
        help='draw N of the samples; on a yaml map so many new ones (100)',
    )
    group.add_argument(
        '--scales', default='1', metavar='RANGES', help='scales of the maps, such as 1-10 (1)'
    )
    group.add_argument(
        '--scale-samples',
        type=count,
        default=10,
        metavar='N',
        help='samples drawn to compare scales on (10)',
    )
    group.add_argument('--seed', type=seed, default=0, metavar='N', help='of every draw (0)')


def run(args: argparse.Namespace) -> int:
    """Run the benchmark; return its exit code. Raises ValueError on bad input."""
    check_cases(args)
    dataset = find_file(args.dataset, 'maps')
    maps = load_maps(dataset, args.limit, args.seed)
    sweep = _sweep(args, dataset, maps)
    _say_which_ablations(args, maps)
    folder = ResultsFolder(args.out)
    try:
        tasks, metadata = begin(folder, sweep, _parameters(args, maps), resume=args.resume)
        _save_maps(folder, sweep, maps)
    except ResultsError as error:
        return complain(args, str(error), BAD_INPUT)
    code = OK
    try:
        with (
            make_executor(args, sweep.askers) as (executor, at_once),
            progress(len(tasks)) as step,
        ):
            metadata['parameters']['jobs'] = args.dask or at_once // 2
            carry_out(folder, tasks, executor, at_once, metadata=metadata, step=lambda *_: step())
    except KeyboardInterrupt:
        left = 'the rows so far are kept; go on with --resume'
        code = complain(args, f'interrupted: {left}', INTERRUPTED)
    except ResultsError as error:
        return complain(args, str(error), INCOMPLETE)
    return close_run(args, folder, metadata, code)


def _say_which_ablations(args: argparse.Namespace, maps: Sequence[ProblemMap]) -> None:
    """Say that a grid is run without the ablations that take long there."""
    guided = set(args.methods) & {*WAYPOINT_METHODS, LLM_ONLY}
    if (
        isinstance(maps[0], GridProblem)
        and guided
        and not set(args.source) & ablation_sources().keys()
    ):
        names = ' and '.join(GRID_ABLATIONS)
        only = f'on a grid, {names} are the only ablations; name others with --source'
        complain(args, only, OK)


def _sweep(args: argparse.Namespace, dataset: Path, maps: Sequence[ProblemMap]) -> Sweep:
    scales = parse_ranges(args.scales, '--scales')
    if scales[0] < 1:
        message = f'--scales {args.scales}: a map is scaled by 1 or more'
        raise ValueError(message)
    grids = [item for item in maps if isinstance(item, GridProblem)]
    for problem in grids:
        check_grid_run(problem, scales, args.source)
    askers = make_askers(
        args.source,
        args.prompt,
        args.model,
        settings=live_settings(args),
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
        deciding_files(args),
    )


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
