# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Generate datasets of samples, or convert them to bags.

examples:
  llm-astar dataset generate --seed 7 --maps 20 --out maps.json
  llm-astar dataset generate --family floors --scale 2 --out floors.json
  llm-astar dataset to-bag --map samples_1000.json --map-ids 50-59 --out out/samples

exit codes: 0 done, 2 bad usage or input
"""

import argparse
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, save_maps
from llm_astar_planner.cli.flags import option
from llm_astar_planner.cli.map_files import MAP_KINDS
from llm_astar_planner.resources import SAMPLES_FILE, find_file

from llm_astar_lab.bags import types as bag_messages
from llm_astar_lab.bags.types import BARRIER_MAP, GET_PLAN_EVENT, MAP, NANOSECONDS, define
from llm_astar_lab.bags.writing import LATCHED, BagWriter, OfferedTopic, qos
from llm_astar_lab.datasets import named
from llm_astar_lab.datasets.generate import GenerationError, MapRules
from llm_astar_lab.datasets.named import BenchmarkSample, load_samples

GRID = 'nav_msgs/msg/OccupancyGrid'
# The time of a bag's first map; it is fixed, so that the same samples give the same bag.
FIRST_STAMP = 1_700_000_000 * NANOSECONDS
# The time from each map or request of the bag to the next, and how long barriers come before
# their map.
STEP, LEAD = NANOSECONDS, NANOSECONDS // 1000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions `generate` and `to-bag`."""
    actions = parser.add_subparsers(dest='action', required=True, metavar='ACTION')
    text = 'generate a dataset; the same seed gives the same one'
    make = actions.add_parser('generate', help=text)
    text = f'kind of maps: {named.BARRIERS} as in the paper, or grids ({named.BARRIERS})'
    option(make, '--family', text, choices=named.GENERATED)
    option(make, '--seed', 'seed of the maps (0)', default=0)
    option(make, '--maps N', 'number of maps (default: %(default)s)', default=named.DEFAULT_MAPS)
    text = 'start-goal pairs per map (default: %(default)s)'
    option(make, '--pairs N', text, default=named.DEFAULT_PAIRS)
    text = 'largest coordinates, of barriers alone (50 30)'
    option(make, '--size', text, type=int, nargs=2, metavar=('W', 'H'))
    text = 'cells a unit of the maps, as --scales of bench makes them (1)'
    option(make, '--scale K', text, default=1)
    option(make, '--out FILE', 'the JSON file to write', required=True)
    text = 'write the samples as a bag of maps and requests, as a robot would record them'
    bag = actions.add_parser('to-bag', help=text)
    add_map_option(bag)
    add_map_ids_option(bag)
    option(bag, '--out DIR', 'the folder of the new bag', required=True)


def add_map_option(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map`, a file of maps with their start-goal pairs."""
    text = f'{MAP_KINDS} (default: %(default)s); on a yaml pairs are drawn'
    option(group, '--map FILE', text, dest='dataset', default=SAMPLES_FILE)


def add_map_ids_option(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map-ids`, which chooses maps of a dataset."""
    text = 'which maps of the dataset, such as 50-99 or 0-9,12 (default: all)'
    option(group, '--map-ids RANGES', text, dest='maps')


def run(args: argparse.Namespace) -> int:
    """Run `dataset`; return 0. Raises ValueError."""
    return ACTIONS[args.action](args)


def generate_dataset(args: argparse.Namespace) -> int:
    """Generate a dataset. Raises GenerationError."""
    maps = drawn_maps(args)
    save_maps(maps, args.out)
    print(f'{args.out}: {len(maps)} maps, {len(maps) * args.pairs} samples, seed {args.seed}')
    return 0


def drawn_maps(args: argparse.Namespace) -> list[ProblemMap]:
    """Draw the maps that the options ask for. Raises GenerationError."""
    family = args.family or named.BARRIERS
    if args.size is not None and family != named.BARRIERS:
        raise GenerationError(f'--size is of {named.BARRIERS}; --scale makes {family} larger')
    size = MapRules.size if args.size is None else tuple(args.size)
    rules = named.DrawRules(args.seed, args.maps, args.pairs, size)
    maps = named.draw_family(family, rules, args.scale)
    # Without an option the file is as the paper's is, which names no family.
    return [replace(item, family=args.family or '') for item in maps]


def write_bag(args: argparse.Namespace) -> int:
    """Write a dataset as a bag."""
    samples = load_samples(find_file(args.dataset, 'maps'), args.maps)
    counts = write_sample_bag(samples, args.out)
    print(f'{args.out}: {counts[MAP]} maps, {counts[GET_PLAN_EVENT]} requests')
    return 0


def write_sample_bag(samples: Iterable[BenchmarkSample], folder: str | Path) -> dict[str, int]:
    """Write samples, in their order, as a bag; return the number of messages by topic.

    Each map is an OccupancyGrid, with its barriers as JSON just before it if it has any; each
    sample is a request of GetPlan, a second after the one before. The same samples give the same
    bag. Raises BagWriteError where the folder exists or the disk is full, OSError where the folder
    cannot be made.
    """
    with BagWriter(folder) as bag:
        bag.add_topic(OfferedTopic(BARRIER_MAP, define('std_msgs/msg/String'), (LATCHED,)))
        bag.add_topic(OfferedTopic(MAP, define(GRID), (LATCHED,)))
        event = define(bag_messages.GET_PLAN_EVENT_TYPE)
        bag.add_topic(OfferedTopic(GET_PLAN_EVENT, event, (qos(),)))
        stamp, number = FIRST_STAMP, 0
        for _, of_map in groupby(samples, key=lambda sample: sample.barrier_map.id):
            group = list(of_map)
            problem = group[0].barrier_map
            if isinstance(problem, BarrierMap):
                whole = replace(problem, samples=tuple(sample.sample for sample in group))
                text = bag_messages.barrier_map_text(whole)
                bag.write_message(BARRIER_MAP, stamp - LEAD, text)
            grid_map = problem.to_grid()
            bag.write_message(MAP, stamp, bag_messages.occupancy_grid(grid_map, stamp))
            for sample in group:
                stamp, number = stamp + STEP, number + 1
                cells = [problem.to_cell(sample.sample.start), problem.to_cell(sample.sample.goal)]
                start, goal = (Pose2D(*point) for point in grid_map.grid_to_world(cells).tolist())
                facts = grid_map.frame_id, stamp, number
                request = bag_messages.get_plan_request(start, goal, *facts)
                bag.write_message(GET_PLAN_EVENT, stamp, request)
            stamp += STEP
    return bag.counts


ACTIONS = {'generate': generate_dataset, 'to-bag': write_bag}
