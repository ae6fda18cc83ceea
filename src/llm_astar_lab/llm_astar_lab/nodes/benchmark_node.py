# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plan samples through a running graph and write a results folder.

One GetPlan each. The results are those of `llm-astar bench`, plus the round-trip time of every
call.

Start planner_node and llm_client_node first, but no map_node: this node publishes the maps. It
sets the planner's parameters `method`, `use_waypoints` and `corner_cutting` and restores them at
the end.

exit codes: 0 ok, 2 bad usage or input, 3 the graph stopped answering, 130 interrupted
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, printable
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.problem_maps import format_kept_maps, load_kept_maps, load_maps
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from llm_astar_planner.cli.flags import at_least, option
from llm_astar_planner.nodes.common.entities import LATCHED
from llm_astar_planner.nodes.common.spin import joined
from llm_astar_planner.nodes.tools.planner_client import PlannerClient, PlannerClientError
from llm_astar_planner.resources import SAMPLES_FILE, find_file
from llm_astar_planner.search.methods import METHODS, WAYPOINT_METHODS
from nav_msgs.msg import OccupancyGrid
from rclpy.utilities import remove_ros_args

from llm_astar_lab.datasets.named import BenchmarkSample, SelectionError, select_samples
from llm_astar_lab.report.pages import text_report, write_report
from llm_astar_lab.results import row as of_rows
from llm_astar_lab.results.folder import MAPS_FILE, ResultsFolder, describe_run
from llm_astar_lab.results.row import PAPER_ASTAR, ResultsError, Row, Variant
from llm_astar_lab.results.stored_rows import Finished
from llm_astar_lab.runner.config import add_folder, choose_folder, open_folder, progress, timing

# Parameters of the planner that a run sets and restores; the paper's paths may cut corners.
RULES = {'corner_cutting': True}
TOUCHED = ('method', 'use_waypoints', *RULES)
OK, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 2, 3, 130


def main(args: Sequence[str] | None = None) -> int:
    """Run benchmark_node and return its exit code."""
    arguments = parse_arguments(remove_ros_args(sys.argv if args is None else args)[1:])
    code = BAD_INPUT
    try:
        folder, metadata, samples, done = prepare(arguments)
        code = INCOMPLETE
        try:
            with timing(metadata):
                plan_samples(args, arguments, folder, samples, done)
            code = OK
        except (PlannerClientError, ResultsError) as error:
            report_error(error)
        except KeyboardInterrupt:
            sys.stderr.write('interrupted: the rows so far are kept; continue with --resume\n')
            code = INTERRUPTED
        close_run(folder, metadata)
    except (LlmAstarError, FileNotFoundError) as error:
        report_error(error)
        return code or INCOMPLETE
    return code


def prepare(
    arguments: argparse.Namespace,
) -> tuple[ResultsFolder, dict[str, Any], list[BenchmarkSample], Finished]:
    """Return the results folder, the run's metadata, its samples, and the rows that are done.

    Raises LlmAstarError, FileNotFoundError.
    """
    dataset = find_file(arguments.dataset, 'maps')
    maps = load_maps(dataset)
    samples = select_samples(maps, str(dataset), arguments.maps, arguments.limit, arguments.seed)
    if any(isinstance(sample.barrier_map, GridProblem) for sample in samples):
        what = 'a grid dataset cannot be run through the graph; use llm-astar bench'
        raise SelectionError(f'{dataset}: {what}')
    folder = choose_folder(arguments.out, arguments.default_out, resume=arguments.resume)
    named = {name: getattr(arguments, name) for name in ('methods', 'limit', 'maps', 'seed')}
    metadata = describe_run([dataset], named | {'live': True})
    done = open_folder(folder, metadata, resume=arguments.resume, overwrite=arguments.overwrite)
    folder.write_text(MAPS_FILE, format_kept_maps(maps))
    return folder, metadata, samples, done


def parse_arguments(argv: Sequence[str]) -> argparse.Namespace:
    """Parse the command line without the ROS arguments."""
    description, _, epilog = str(__doc__).partition('\n')
    words: dict[str, Any] = {'description': description, 'epilog': epilog}
    layout = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser('benchmark_node', formatter_class=layout, **words)
    text = 'barrier maps: a path, or a name in maps/ (default: %(default)s)'
    option(parser, '--map --dataset FILE', text, dest='dataset', default=SAMPLES_FILE)
    option(parser, '--map-ids RANGES', 'such as 50-99 or 0-9,12', dest='maps')
    option(parser, '--limit N', 'draw N of the samples', type=at_least(1, int))
    option(parser, '--seed N', 'seed of the draw (0)', default=0)
    text = f'run besides astar; of {", ".join(METHODS)} (default: llm_astar)'
    option(parser, '--methods NAMES', text, default='llm_astar')
    add_folder(parser, 'out/live')
    option(parser, '--planner NAME', 'name of the planner node', default='planner_node')
    text = "name of the waypoint client; '' for none"
    option(parser, '--client NAME', text, default='llm_client_node')
    arguments = parser.parse_args(argv)
    arguments.methods = arguments.methods.split(',')
    for name in arguments.methods:
        if name not in METHODS:
            parser.error(f'--methods {name!r} is unknown; available are {", ".join(METHODS)}')
    return arguments


def plan_samples(
    args: Sequence[str] | None,
    arguments: argparse.Namespace,
    folder: ResultsFolder,
    samples: Sequence[BenchmarkSample],
    done: Finished,
) -> None:
    """Plan the samples; every row is written as soon as it arrives.

    Raises PlannerClientError, ResultsError, KeyboardInterrupt.
    """
    # Python must get Ctrl-C, so that the planner's parameters are restored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with (
        joined('benchmark_node', args=args) as node,
        PlannerClient(node, arguments.planner) as caller,
    ):
        caller.wait_for_planner()
        with LiveRun(caller, arguments.client) as run:
            variants = run.variants(arguments.methods)
            finished = sum(map(len, done.values()))
            with progress(len(samples) * len(variants) - finished, 'plan') as step:
                for row in run.rows(samples, variants, done):
                    folder.append([row])
                    step()


def close_run(folder: ResultsFolder, metadata: dict[str, Any]) -> None:
    """Write the reports of a run and print the table. Raises ResultsError."""
    rows = folder.stored()
    if len(rows):
        folder.write_json('metadata.json', metadata)
        run = write_report(folder, metadata, load_kept_maps(folder.path / MAPS_FILE), rows)
        sys.stdout.write(text_report(run) + '\n')
        sys.stderr.write(f'{len(rows)} rows: {folder.path}/report.html\n')


def report_error(error: Exception) -> None:
    """Write an error to stderr."""
    sys.stderr.write(f'error: {printable(str(error))}\n')


class LiveRun:
    """Plans samples with the planner of a running graph. A context manager.

    It publishes the maps and sets the planner's parameters; leaving the context restores them.
    """

    def __init__(self, caller: PlannerClient, client: str) -> None:
        """Use a running caller; `client` is the name of the waypoint client."""
        self._caller, self._client = caller, client
        self._maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self._before: dict[str, Any] = {}

    def __enter__(self) -> LiveRun:
        self._before = self._caller.values(TOUCHED)
        self._caller.set_values(RULES)
        return self

    def __exit__(self, *error: object) -> None:
        self._caller.set_values(self._before)

    def variants(self, methods: Sequence[str]) -> list[Variant]:
        """Return A* and the methods without waypoints and with the source of the graph.

        Raises PlannerClientError where the waypoint client does not have these parameters.
        """
        names = ('source', 'prompt', 'model')
        known = self._caller.values(names, self._client) if self._client else {'source': 'none'}
        source = tuple(known.values())
        variants = [PAPER_ASTAR]
        for method in methods:
            variants.append(Variant(method))
            if method in WAYPOINT_METHODS and source[0] != 'none':
                variants.append(Variant(method, *source))
        return list(dict.fromkeys(variants))

    def rows(
        self, samples: Sequence[BenchmarkSample], variants: Sequence[Variant], done: Finished
    ) -> Iterator[Row]:
        """Plan what is not `done`, map by map and variant by variant; yield each row."""
        for _, group in groupby(samples, key=lambda sample: sample.barrier_map.id):
            of_map = list(group)
            left = {
                variant: [s for s in of_map if variant not in done.get((*s.key, 1), ())]
                for variant in variants
            }
            if any(left.values()):
                grid_map = of_map[0].barrier_map.to_grid()
                # Until planner and client have received it.
                now = self._caller.node.get_clock().now().to_msg()
                self._maps.publish(grid_to_message(grid_map, now))
                self._caller.wait_until_ready(grid_map.digest, client=self._client)
                for variant in filter(left.get, left):
                    uses = {'method': variant.method, 'use_waypoints': variant.source != 'none'}
                    self._caller.set_values(uses)
                    yield from (self._plan(sample, grid_map, variant) for sample in left[variant])

    def _plan(self, sample: BenchmarkSample, grid_map: GridMap, variant: Variant) -> Row:
        cells = [sample.barrier_map.to_cell(point) for point in sample.sample[:2]]
        start, goal = (Pose2D(*pose) for pose in grid_map.grid_to_world(cells).tolist())
        path, report, round_trip = self._caller.call(start, goal)
        values = asdict(report)
        if report.length is not None:
            values['length'] = report.length / grid_map.resolution
        points = grid_map.world_to_grid(path_from_message(path))
        waypoints = grid_map.world_to_grid([(x, y) for x, y, _ in report.waypoints])
        statuses = [status for _, _, status in report.waypoints]
        columns = of_rows.plan_columns(values, statuses, np.rint(points).astype(np.int32))
        columns['waypoints'] = of_rows.format_points(waypoints.round(6).tolist())
        columns['family'] = sample.barrier_map.family
        return Row(*sample.key, 1, *variant, seconds_round_trip=round_trip, **columns)


if __name__ == '__main__':
    raise SystemExit(main())
