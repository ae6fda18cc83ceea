"""The samples that `bench` runs, by its options: a file of maps, or datasets by name."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.problem_maps import load_maps
from llm_astar_planner.cli.map_files import MAP_KINDS
from llm_astar_planner.resources import SAMPLES_FILE, find_file

from llm_astar_lab.commands.option_types import count
from llm_astar_lab.datasets.named import (
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
from llm_astar_lab.datasets.samples import SelectionError


def add_dataset_options(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map` and `--map-ids`, which choose maps with their start-goal pairs."""
    add_map_option(group)
    add_map_ids_option(group)


def add_map_option(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map`, a file of maps with their start-goal pairs."""
    group.add_argument(
        '--map',
        dest='dataset',
        default=SAMPLES_FILE,
        metavar='FILE',
        help=f'{MAP_KINDS} (default: %(default)s); on a yaml pairs are drawn',
    )


def add_map_ids_option(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map-ids`, which chooses maps of a dataset."""
    group.add_argument(
        '--map-ids',
        dest='maps',
        metavar='RANGES',
        help='which maps of the dataset, such as 50-99 or 0-9,12 (default: all)',
    )


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
        '--maps', dest='map_count', type=count, metavar='N',
        help=f'number of maps of a generated dataset ({DEFAULT_MAPS})',
    )  # fmt: skip
    group.add_argument(
        '--pairs', type=count, metavar='N',
        help=f'start-goal pairs on each of them ({DEFAULT_PAIRS})',
    )  # fmt: skip
    add_map_ids_option(group)


def open_dataset(args: Namespace) -> Dataset:
    """Return the maps that the options choose. Raises LlmAstarError or FileNotFoundError."""
    names = () if args.named is None else parse_names(args.named)
    check_options(args, names)
    if not names:
        file = find_file(args.dataset, 'maps')
        return Dataset((), load_maps(file, args.limit, args.seed), file)
    path = None if args.path is None else Path(args.path).expanduser()
    rules = DrawRules(args.seed, args.map_count or DEFAULT_MAPS, args.pairs or DEFAULT_PAIRS)
    return load_named(names, path, rules)


def check_options(args: Namespace, names: Sequence[str]) -> None:
    """Raise SelectionError where an option is of another kind of dataset."""
    for option, value, kinds in (
        ('--maps', args.map_count, GENERATED),
        ('--pairs', args.pairs, GENERATED),
        ('--path', args.path, READ),
    ):
        if value is not None and not set(names) & set(kinds):
            raise SelectionError(f'{option}: needs --dataset with one of {", ".join(kinds)}')
