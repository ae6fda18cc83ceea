# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plan the samples of a dataset with every method and waypoint source.

Write a results folder: rows, summary, report.md, report.html, pictures.

usage: llm-astar bench [--map FILE] [--methods NAMES] [--source NAMES] [--limit N] [--out DIR]
                       [--fail-under LIMIT] [options]

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

import argparse
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps import problem_maps
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, format_kept_maps, load_kept_maps
from llm_astar_planner.cli.flags import option
from llm_astar_planner.cli.map_files import open_places, zones_text
from llm_astar_planner.resources import find_file

from llm_astar_lab.commands import run_options as common
from llm_astar_lab.commands.dataset import add_map_ids_option, add_map_option
from llm_astar_lab.datasets import named
from llm_astar_lab.datasets.named import SelectionError, draw, parse_ranges, select_samples
from llm_astar_lab.results.folder import MAPS_FILE, ResultsFolder, describe_run
from llm_astar_lab.results.row import ResultsError
from llm_astar_lab.runner import sources
from llm_astar_lab.runner.config import BenchmarkConfig, choose_folder
from llm_astar_lab.runner.engine import SearchSettings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_samples(parser.add_argument_group('samples'))
    common.add_variants(parser.add_argument_group('methods and sources'))
    common.add_instruction(parser.add_argument_group('an instruction for every sample'))
    common.add_running(parser.add_argument_group('running'), 'out/bench')


def add_samples(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options that choose the samples."""
    add_dataset_choice(group)
    option(
        group, '--samples',
        'with --source replay: only the samples that the transcripts hold, so that every row '
        'is over the same samples, or all (%(default)s)',
        choices=sources.SAMPLES, default=sources.RECORDED,
    )  # fmt: skip
    text = 'GeoJSON with zones on every map and rules of the road, or a nav2_route graph'
    option(group, '--zones FILE', text)
    text = 'draw N of the samples; on a yaml map N new pairs (100)'
    option(group, '--limit N', text, type=common.count)
    option(group, '--scales RANGES', 'scales of the maps, such as 1-10 (1)', default='1')
    text = 'number of samples that are run at every scale (10)'
    option(group, '--scale-samples N', text, type=common.count, default=10)
    text = 'seed of everything drawn at random (0)'
    option(group, '--seed N', text, type=common.seed, default=0)


def add_dataset_choice(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options that choose the maps of a run."""
    either = group.add_mutually_exclusive_group()
    add_map_option(either)
    option(
        either, '--dataset NAMES',
        f'instead of --map, datasets by name: {", ".join(named.GENERATED)} are generated, '
        f'{named.READ[0]} and so on are read from --path', dest='named',
    )  # fmt: skip
    text = "the folder with MovingAI's maps and scenarios"
    option(group, '--path PATH', text)
    text = f'number of maps of a generated dataset ({named.DEFAULT_MAPS})'
    option(group, '--maps N', text, dest='map_count', type=common.count)
    text = f'start-goal pairs on each of them ({named.DEFAULT_PAIRS})'
    option(group, '--pairs N', text, type=common.count)
    add_map_ids_option(group)


def run(args: argparse.Namespace) -> int:
    """Run the benchmark; return its exit code. Raises ValueError on bad input."""
    common.settle_variants(args)
    dataset = open_dataset(args)
    folder = choose_folder(args.out, args.default_out, resume=args.resume)
    config = benchmark_config(args, folder, dataset)
    common.check_thresholds(args, config.sources)
    for item in config.coverage:
        common.complain(args, item.sentence(), common.OK)
    run = common.Run(args, folder, run_metadata(args, config, dataset))
    try:
        tasks = config.tasks(run.open(config.row_count))
        keep_maps(args, folder, config, dataset.maps)
        run.execute(tasks, config.sources, 'sample')
        # Free the memory of the run: the reports of a million rows take much themselves.
        del dataset, config, tasks
        return run.close()
    except ResultsError as error:
        return run.failed(error)


def keep_maps(
    args: argparse.Namespace,
    folder: ResultsFolder,
    config: BenchmarkConfig,
    maps: Sequence[ProblemMap],
) -> None:
    """Write the maps and places of a run into its folder. Raises ResultsError."""
    ids = {sample.barrier_map.id for sample in config.samples}
    kept = [item for item in maps if item.id in ids]
    if args.resume and (folder.path / MAPS_FILE).exists():
        kept += [item for item in load_kept_maps(folder.path / MAPS_FILE) if item.id not in ids]
    folder.write_text(MAPS_FILE, format_kept_maps(kept))
    if (instruction := config.settings.request.instruction) is not None:
        folder.write_places(instruction.places)


def open_dataset(args: argparse.Namespace) -> named.Dataset:
    """Return the maps that the options choose. Raises LlmAstarError or FileNotFoundError."""
    names = () if args.named is None else named.parse_names(args.named)
    check_options(args, names)
    if not names:
        file = find_file(args.dataset, 'maps')
        return named.Dataset((), problem_maps.load_maps(file, args.limit, args.seed), file)
    path = None if args.path is None else Path(args.path).expanduser()
    rules = named.DrawRules(
        args.seed, args.map_count or named.DEFAULT_MAPS, args.pairs or named.DEFAULT_PAIRS
    )
    return named.load_named(names, path, rules)


def check_options(args: argparse.Namespace, names: Sequence[str]) -> None:
    """Raise SelectionError where an option is of another kind of dataset."""
    for flag, value, kinds in (
        ('--maps', args.map_count, named.GENERATED),
        ('--pairs', args.pairs, named.GENERATED),
        ('--path', args.path, named.READ),
    ):
        if value is not None and not set(names) & set(kinds):
            instead = '; --map-ids names maps by number' if flag == '--maps' else ''
            known = ', '.join(kinds)
            raise SelectionError(f'{flag}: needs --dataset with one of {known}{instead}')


def benchmark_config(
    args: argparse.Namespace, folder: ResultsFolder, dataset: named.Dataset
) -> BenchmarkConfig:
    """Return what the options ask for. Raises ValueError."""
    scales = parse_ranges(args.scales, '--scales')
    if scales[0] < 1:
        raise ValueError(f'--scales {args.scales}: the smallest scale is 1')
    maps, file = dataset.maps, None if dataset.file is None else str(dataset.file)
    grids = [item for item in maps if isinstance(item, GridProblem)]
    for problem in grids:
        sources.check_grid_options(problem, args.source)
    request = common.search_request(args, open_places(args.places_file or '', file))
    settings = SearchSettings(request, zones=zones_text(args.zones))
    instruction = settings.request.instruction
    for flag, is_given in (('--instruction', instruction), ('--zones', settings.zones)):
        if is_given and scales != [1]:
            raise ValueError(f'{flag} is about metres, so it needs --scales 1')
    barrier_maps = [item for item in maps if isinstance(item, BarrierMap)]
    specs = common.source_specs(
        args, folder, barrier_maps, sources.GRID_BASELINES if grids else None
    )
    samples = select_samples(maps, str(dataset), args.maps)
    recorded = sources.RecordedRun(samples, specs, [])
    if args.samples == sources.RECORDED:
        recorded = sources.keep_recorded(samples, specs, scales, args.scale_samples, args.seed)
    samples = recorded.samples
    if args.limit is not None:
        samples = draw(samples, args.limit, args.seed)
    for sample in {sample.barrier_map.id: sample for sample in samples}.values():
        sample.barrier_map.scale(scales[-1])
    rest = scales, args.scale_samples, args.seed, recorded.coverage
    return BenchmarkConfig(samples, args.methods, recorded.specs, settings, *rest)


def run_metadata(
    args: argparse.Namespace, config: BenchmarkConfig, dataset: named.Dataset
) -> dict[str, Any]:
    """Return the metadata of the run."""
    files = () if dataset.file is None else (dataset.file,)
    parameters = run_parameters(args, dataset.maps)
    metadata = describe_run(files, parameters, common.deciding_files(args))
    if dataset.identity is not None:
        metadata['dataset'] = dataset.identity
    if config.coverage:
        metadata['replays'] = [item.to_json() for item in config.coverage]
        metadata['notes'] = [item.sentence() for item in config.coverage]
    return metadata


def run_parameters(args: argparse.Namespace, maps: Sequence[ProblemMap]) -> dict[str, Any]:
    """Return the parameters for the metadata of the run."""
    parameters = common.deciding_parameters(args, 'maps', 'limit', 'scales', 'scale_samples')
    if sources.REPLAY in args.source:
        parameters['samples'] = args.samples
    # A dataset's file may only name a grid: its digest then says nothing about the cells.
    grids = [item.digest for item in maps if isinstance(item, GridProblem)]
    if len(grids) > 1:
        grids = [hashlib.sha256(' '.join(grids).encode()).hexdigest()[:12]]
    parameters |= {'zones': zones_text(args.zones)} if args.zones else {}
    return parameters | ({'grid': grids[0]} if grids else {})
