"""The samples that `bench` runs, by its options: a file of maps, or datasets by name."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr

from llm_astar_planner.benchmark.datasets.named import (
    DEFAULT_MAPS,
    DEFAULT_PAIRS,
    GENERATED,
    PAPER,
    READ,
    Dataset,
    DrawRules,
    load_named,
    parse_names,
)
from llm_astar_planner.benchmark.datasets.samples import SelectionError, load_maps
from llm_astar_planner.cli.flags import warn_renamed
from llm_astar_planner.cli.map_files import add_map_ids_option, add_map_option
from llm_astar_planner.cli.option_types import count
from llm_astar_planner.resources import find_file


def add_dataset_choice(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options that choose the maps of a run."""
    either = group.add_mutually_exclusive_group()
    add_map_option(either)
    either.add_argument(
        '--dataset', dest='named', metavar='NAMES',
        help=f'instead of --map, datasets by name: {", ".join(GENERATED)} are generated, '
        f'{PAPER} and {READ[1]} and so on are read from --path',
    )  # fmt: skip
    group.add_argument(
        '--path', metavar='PATH',
        help="the paper's file, or the folder with MovingAI's maps and scenarios",
    )  # fmt: skip
    group.add_argument(
        '--maps', dest='map_count', metavar='N',
        help=f'number of maps of a generated dataset ({DEFAULT_MAPS})',
    )  # fmt: skip
    group.add_argument(
        '--pairs', type=count, metavar='N',
        help=f'start-goal pairs on each of them ({DEFAULT_PAIRS})',
    )  # fmt: skip
    add_map_ids_option(group)


def open_dataset(args: Namespace) -> Dataset:
    """Return the maps that the options choose. Raises LlmAstarError or FileNotFoundError."""
    names = None if args.named is None else parse_names(args.named)
    if args.named is not None and names is None:
        warn_renamed('--dataset', '--map')
        args.dataset = args.named
    settle_options(args, names or ())
    if names is None:
        file = find_file(args.dataset, 'maps')
        return Dataset((), load_maps(file, args.limit, args.seed), file)
    path = None if args.path is None else Path(args.path).expanduser()
    rules = DrawRules(args.seed, int(args.map_count or DEFAULT_MAPS), args.pairs or DEFAULT_PAIRS)
    return load_named(names, path, rules)


def settle_options(args: Namespace, names: Sequence[str]) -> None:
    """Take `--maps` for `--map-ids`, which it was up to version 0.2.0, where nothing is generated.

    Raises SelectionError where an option is of another kind of dataset.
    """
    is_generated = bool(set(names) & set(GENERATED))
    if args.map_count is not None and not is_generated:
        if args.maps is not None:
            raise SelectionError('--maps: needs --dataset with a generated one beside --map-ids')
        warn_renamed('--maps', '--map-ids')
        args.maps, args.map_count = args.map_count, None
    if args.map_count is not None and not args.map_count.isdecimal():
        text = short_repr(args.map_count)
        raise SelectionError(f'--maps: {text} is not a number of maps; --map-ids chooses maps')
    if args.pairs is not None and not is_generated:
        raise SelectionError(f'--pairs: needs --dataset with one of {", ".join(GENERATED)}')
    if args.path is not None and not set(names) & set(READ):
        raise SelectionError(f'--path: needs --dataset with one of {", ".join(READ)}')
