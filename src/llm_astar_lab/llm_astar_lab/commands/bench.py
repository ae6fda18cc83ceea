"""Plan the samples of a dataset with every method and waypoint source.

Write a results folder: rows, summary, report.md, report.html, pictures.
"""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, format_kept_maps, load_kept_maps
from llm_astar_planner.cli.map_files import open_places
from llm_astar_planner.search.methods import uses_waypoints
from llm_astar_planner.waypoints.plugins import BASELINE_NAMES

from llm_astar_lab.commands import run_options as common
from llm_astar_lab.commands.dataset_options import add_dataset_choice, open_dataset
from llm_astar_lab.commands.option_types import count, seed
from llm_astar_lab.datasets.named import Dataset
from llm_astar_lab.datasets.samples import draw, parse_ranges, select_samples
from llm_astar_lab.results.folder import MAPS_FILE, ResultsFolder
from llm_astar_lab.results.row import WAYPOINTS_ONLY, ResultsError
from llm_astar_lab.runner.config import BenchmarkConfig, choose_folder, start_run
from llm_astar_lab.runner.engine import SearchSettings
from llm_astar_lab.runner.map_costs import map_costs
from llm_astar_lab.runner.recorded import (
    RECORDED,
    SAMPLES,
    RecordedRun,
    keep_recorded,
)
from llm_astar_lab.runner.sources import GRID_BASELINES, REPLAY, check_grid_options

USAGE = """\
llm-astar bench [--map FILE] [--methods NAMES] [--source NAMES] [--limit N] [--out DIR]
                       [--fail-under LIMIT] [options]"""
EPILOG = """\
examples:
  llm-astar bench                                 every method and baseline, no key needed
  llm-astar bench --source replay --transcript a.jsonl,b.jsonl    recorded models, on their samples
  llm-astar bench --source endpoint --model gpt-4o-mini --prompt few_shot,cot --limit 50
  llm-astar bench --scales 1-10 --limit 100       also how work grows with the scale
  llm-astar bench --dataset barriers,rooms,mazes,aisles,floors --maps 20 --seed 1
  llm-astar bench --dataset movingai/dao --path FOLDER --methods exact_astar,astar --limit 500
  llm-astar bench --fail-under llm_astar/oracle:operation=60 --fail-under llm_astar:valid=100

On a grid dataset paths may not cut corners, as in MovingAI's benchmarks. The optimal lengths in a
.scen file are compared with those of exact_astar and astar.

exit codes: 0 ok, 1 threshold missed, 2 bad usage or input, 3 incomplete, or a length differs from
the optimal one in the dataset, 130 interrupted
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_samples(parser.add_argument_group('samples'))
    common.add_variants(parser.add_argument_group('methods and sources'))
    common.add_instruction(parser.add_argument_group('an instruction for every sample'))
    common.add_running(parser.add_argument_group('running'), 'out/bench')


def add_samples(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options that choose the samples."""
    add_dataset_choice(group)
    group.add_argument(
        '--samples', choices=SAMPLES, default=RECORDED,
        help='with --source replay: only the samples that the transcripts hold, so that every row '
        'is over the same samples, or all (%(default)s)',
    )  # fmt: skip
    group.add_argument(
        '--limit', type=count, metavar='N',
        help='draw N of the samples; on a yaml map N new pairs (100)',
    )  # fmt: skip
    group.add_argument(
        '--scales', default='1', metavar='RANGES', help='scales of the maps, such as 1-10 (1)'
    )
    group.add_argument(
        '--scale-samples', type=count, default=10, metavar='N',
        help='number of samples that are run at every scale (10)',
    )  # fmt: skip
    group.add_argument(
        '--seed', type=seed, default=0, metavar='N', help='seed of everything drawn at random (0)'
    )


def run(args: argparse.Namespace) -> int:
    """Run the benchmark; return its exit code. Raises ValueError on bad input."""
    common.settle_variants(args)
    dataset = open_dataset(args)
    maps = dataset.maps
    folder = choose_folder(args.out, args.default_out, resume=args.resume)
    config = benchmark_config(args, folder, dataset)
    common.check_thresholds(args, config.sources)
    for item in config.coverage:
        common.complain(args, item.sentence(), common.OK)
    if omits_baselines(args, maps):
        names = ', '.join(GRID_BASELINES)
        message = f'on a grid only the baselines {names} are run; name others with --source'
        common.complain(args, message, common.OK)
    with common.make_executor(args, config.sources) as pool:
        try:
            tasks, metadata = start_run(
                folder, config, run_parameters(args, maps), resume=args.resume,
                overwrite=args.overwrite, file_format=args.format,
            )  # fmt: skip
            ids = {sample.barrier_map.id for sample in config.samples}
            kept = [item for item in maps if item.id in ids]
            if args.resume and (folder.path / MAPS_FILE).exists():
                kept += [i for i in load_kept_maps(folder.path / MAPS_FILE) if i.id not in ids]
            folder.write_text(MAPS_FILE, format_kept_maps(kept))
            if config.settings.instruction is not None:
                folder.write_places(config.settings.instruction.places)
            if dataset.map_names:
                grids = [item for item in kept if isinstance(item, GridProblem)]
                metadata['map_costs'] = list(map_costs(grids, dataset.map_names))
        except ResultsError as error:
            return common.complain(args, str(error), common.BAD_INPUT)
        try:
            code = common.run_into(args, folder, metadata, tasks, pool)
        except ResultsError as error:
            return common.complain(args, str(error), common.INCOMPLETE)
    return common.close_run(args, folder, metadata, code)


def omits_baselines(args: argparse.Namespace, maps: Sequence[ProblemMap]) -> bool:
    """Tell whether a grid is run without the baselines that are slow there."""
    has_waypoints = any(name == WAYPOINTS_ONLY or uses_waypoints(name) for name in args.methods)
    named = set(args.source) & set(BASELINE_NAMES)
    has_grids = any(isinstance(item, GridProblem) for item in maps)
    return has_grids and has_waypoints and not named


def benchmark_config(
    args: argparse.Namespace, folder: ResultsFolder, dataset: Dataset
) -> BenchmarkConfig:
    """Return what the options ask for. Raises ValueError."""
    scales = parse_ranges(args.scales, '--scales')
    if scales[0] < 1:
        raise ValueError(f'--scales {args.scales}: the smallest scale is 1')
    maps, file = dataset.maps, None if dataset.file is None else str(dataset.file)
    grids = [item for item in maps if isinstance(item, GridProblem)]
    for problem in grids:
        check_grid_options(problem, args.source)
    instruction = common.instruction_of(args, open_places(args.places_file or '', file))
    if instruction is not None and scales != [1]:
        raise ValueError('--instruction is about metres, so it needs --scales 1')
    barrier_maps = [item for item in maps if isinstance(item, BarrierMap)]
    sources = common.source_specs(args, folder, barrier_maps, GRID_BASELINES if grids else None)
    samples = select_samples(maps, str(dataset), args.maps)
    recorded = RecordedRun(samples, sources, [])
    if args.samples == RECORDED:
        recorded = keep_recorded(samples, sources, scales, args.scale_samples, args.seed)
    samples = recorded.samples
    if args.limit is not None:
        samples = draw(samples, args.limit, args.seed)
    for sample in {sample.barrier_map.id: sample for sample in samples}.values():
        sample.barrier_map.scale(scales[-1])
    return BenchmarkConfig(
        dataset.file or Path(),
        samples,
        args.methods,
        recorded.specs,
        SearchSettings(
            args.heuristic,
            args.weight,
            args.max_planning_time,
            args.max_suboptimality,
            instruction=instruction,
        ),
        scales,
        args.scale_samples,
        args.seed,
        common.deciding_files(args),
        recorded.coverage,
        dataset.identity,
    )


def run_parameters(args: argparse.Namespace, maps: Sequence[ProblemMap]) -> dict[str, Any]:
    """Return the parameters for the metadata of the run."""
    parameters = common.deciding_parameters(args, 'maps', 'limit', 'scales', 'scale_samples')
    if REPLAY in args.source:
        parameters['samples'] = args.samples
    # A dataset's file may only name a grid: its digest then says nothing about the cells.
    grids = [item.digest for item in maps if isinstance(item, GridProblem)]
    if len(grids) > 1:
        grids = [hashlib.sha256(' '.join(grids).encode()).hexdigest()[:12]]
    return parameters | ({'grid': grids[0]} if grids else {})
