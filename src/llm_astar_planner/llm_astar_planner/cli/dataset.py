"""`llm-astar dataset`: make barrier-map datasets, check them, make bags of them."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.bags.messages import GET_PLAN_EVENT, MAP
from llm_astar_msgs_adapter.maps.barrier_map import save_barrier_maps

from llm_astar_planner.benchmark.datasets.generate import GenerationError, MapRules, generate
from llm_astar_planner.benchmark.datasets.samples import load_samples
from llm_astar_planner.benchmark.datasets.validate import check_file
from llm_astar_planner.resources import find_file

OK, BAD_INPUT = 0, 2


def add_parser(subparsers: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the sub-command `dataset` with `generate`, `check` and `to-bag`."""
    parser = subparsers.add_parser(
        'dataset', description='Make, check or convert datasets of samples.'
    )
    actions = parser.add_subparsers(dest='action', required=True, metavar='ACTION')
    make = actions.add_parser('generate', help='make a dataset, the same one for the same seed')
    make.add_argument('--seed', type=int, default=0, help='what the maps are drawn from (0)')
    make.add_argument('--maps', type=int, default=100, metavar='N', help='number of maps (100)')
    make.add_argument('--pairs', type=int, default=10, metavar='N', help='pairs a map (10)')
    make.add_argument(
        '--size', type=int, nargs=2, default=(50, 30), metavar=('W', 'H'),
        help='largest coordinates (50 30)',
    )  # fmt: skip
    make.add_argument('--out', required=True, metavar='FILE', help='the JSON file to write')
    make.add_argument('--pictures', metavar='DIR', help='also draw every map into this folder')
    make.set_defaults(run=run)
    check = actions.add_parser('check', help='validate a dataset file')
    check.add_argument('file', metavar='FILE')
    check.add_argument('--json', action='store_true', help='print the findings as JSON')
    check.set_defaults(run=run)
    bag = actions.add_parser(
        'to-bag',
        help='make a bag of the samples: maps and requests, as if a robot had recorded them',
    )
    bag.add_argument(
        '--dataset', required=True, metavar='FILE',
        help='a dataset as bench reads it, or a name in maps/',
    )  # fmt: skip
    bag.add_argument('--maps', metavar='IDS', help='which maps, such as 50-59 (default: all)')
    bag.add_argument('--out', required=True, metavar='DIR', help='the bag, a new folder')
    bag.add_argument('--storage', choices=('mcap', 'sqlite3'), default='mcap')
    bag.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run `dataset`. Returns 0, or 2 where the checked dataset has errors; raises ValueError."""
    return ACTIONS[args.action](args)


def _generate(args: argparse.Namespace) -> int:
    if args.maps < 1 or args.pairs < 1:
        raise GenerationError('--maps and --pairs: 1 is the least')
    rules = MapRules(size=tuple(args.size), pairs=args.pairs)
    maps = list(generate(args.seed, args.maps, rules))
    save_barrier_maps(maps, args.out)
    print(f'{args.out}: {len(maps)} maps, {len(maps) * args.pairs} samples, seed {args.seed}')
    if args.pictures:
        # Drawing is the only thing here that needs matplotlib.
        from llm_astar_planner.benchmark.report.figures import save_map_pictures  # noqa: PLC0415

        print(f'{args.pictures}: {len(save_map_pictures(maps, args.pictures))} pictures')
    return OK


def _check(args: argparse.Namespace) -> int:
    summary, findings = check_file(args.file)
    errors = sum(finding.error for finding in findings)
    if args.json:
        found = [finding._asdict() for finding in findings]
        print(json.dumps({**summary._asdict(), 'errors': errors, 'findings': found}))
        return BAD_INPUT if errors else OK
    for finding in findings:
        print(finding)
    print(
        f'{Path(args.file)}: {summary.maps} maps, {summary.samples} samples, '
        f'{errors} errors, {len(findings) - errors} notes'
    )
    if summary.detours:
        low, middle, high = np.percentile(summary.detours, (0, 50, 100))
        print(f'mean detour of a map: {low:.2f} to {high:.2f}, median {middle:.2f}')
    return BAD_INPUT if errors else OK


def _to_bag(args: argparse.Namespace) -> int:
    # Only what makes bags needs the library of bags.
    from llm_astar_planner.benchmark.bags.sample_bag import write_sample_bag  # noqa: PLC0415

    samples = load_samples(find_file(args.dataset, 'maps'), args.maps)
    counts = write_sample_bag(samples, args.out, args.storage)
    print(f'{args.out}: {counts[MAP]} maps, {counts[GET_PLAN_EVENT]} requests')
    return OK


ACTIONS = {'generate': _generate, 'check': _check, 'to-bag': _to_bag}
