"""benchmark_node: plans the samples of a dataset through a running graph, one GetPlan each.

It writes the same results as `llm-astar bench`, plus the round-trip time of every call.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from typing import Any

import rclpy
from llm_astar_msgs_adapter.maps.barrier_map import (
    BarrierMapError,
    load_barrier_maps,
    save_barrier_maps,
)
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from llm_astar_planner.benchmark.datasets.grids import is_grid_dataset
from llm_astar_planner.benchmark.datasets.samples import (
    BenchmarkSample,
    SelectionError,
    load_samples,
)
from llm_astar_planner.benchmark.report.markdown import text_report
from llm_astar_planner.benchmark.report.write import write_report
from llm_astar_planner.benchmark.results import (
    MAPS_FILE,
    ResultsError,
    ResultsFolder,
    RowKey,
    describe_run,
)
from llm_astar_planner.benchmark.runner.config import open_folder
from llm_astar_planner.benchmark.runner.progress import progress
from llm_astar_planner.nodes.common.spin import leave
from llm_astar_planner.nodes.live_benchmark import LiveRun
from llm_astar_planner.nodes.tools.planner_client import PlannerClient, PlannerClientError
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.paper import METHODS

OK, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 2, 3, 130
EPILOG = """\
Start planner_node and llm_client_node first, but no map_node: this node publishes the maps. It
sets the parameters `method`, `use_waypoints` and `corner_cutting` of the planner
and restores them at the end.

exit codes: 0 ok, 2 bad usage or input, 3 the graph stopped answering, 130 interrupted
"""


def main(args: Sequence[str] | None = None) -> int:
    """Run benchmark_node and return its exit code."""
    arguments = parse_arguments(remove_ros_args(sys.argv if args is None else args)[1:])
    try:
        dataset = find_file(arguments.dataset, 'maps')
        if is_grid_dataset(dataset):
            message = (
                f'{dataset}: a grid dataset cannot be run through the graph; use llm-astar bench'
            )
            raise SelectionError(message)
        samples = load_samples(dataset, arguments.maps, arguments.limit, arguments.seed)
        folder = ResultsFolder(arguments.out)
        parameters = {'methods': arguments.methods, 'limit': arguments.limit}
        parameters |= {'maps': arguments.maps, 'seed': arguments.seed, 'live': True}
        metadata = describe_run([dataset], parameters)
        done = open_folder(folder, metadata, resume=arguments.resume)
        save_barrier_maps(load_barrier_maps(dataset), folder.path / MAPS_FILE)
    except (BarrierMapError, FileNotFoundError, ResultsError, SelectionError) as error:
        return report_error(str(error), BAD_INPUT)
    begun = time.monotonic()
    code = plan_samples(args, arguments, folder, samples, done)
    metadata['seconds'] = float(metadata.get('seconds', 0.0)) + time.monotonic() - begun
    return close_run(folder, metadata, arguments.seed, code)


def parse_arguments(argv: Sequence[str]) -> argparse.Namespace:
    """Parse the command line without the ROS arguments."""
    parser = argparse.ArgumentParser(
        prog='benchmark_node',
        description='Plan samples through a running graph and write a results folder.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        '--dataset',
        default='samples_1000.json',
        metavar='FILE',
        help='barrier maps: a path, or a name in maps/ (default: %(default)s)',
    )
    parser.add_argument('--maps', metavar='RANGES', help='map ids, such as 50-99 or 0-9,12')
    parser.add_argument('--limit', type=int, metavar='N', help='draw N of the samples')
    parser.add_argument('--seed', type=int, default=0, help='seed of the draw (0)')
    parser.add_argument(
        '--methods',
        default=['llm_astar'],
        type=lambda text: text.split(','),
        metavar='NAMES',
        help=f'run besides astar; of {", ".join(METHODS)} (default: llm_astar)',
    )
    parser.add_argument('--out', default='out/live', metavar='DIR', help='(default: %(default)s)')
    parser.add_argument('--resume', action='store_true', help='continue an interrupted run')
    parser.add_argument('--planner', default='planner_node', help='name of the planner node')
    parser.add_argument(
        '--client', default='llm_client_node', help="name of the waypoint client; '' for none"
    )
    arguments = parser.parse_args(argv)
    if arguments.limit is not None and arguments.limit < 1:
        parser.error(f'--limit {arguments.limit} is not 1 or more')
    for name in arguments.methods:
        if name not in METHODS:
            parser.error(f'--methods {name!r} is unknown; available are {", ".join(METHODS)}')
    return arguments


def plan_samples(
    args: Sequence[str] | None,
    arguments: argparse.Namespace,
    folder: ResultsFolder,
    samples: Sequence[BenchmarkSample],
    done: frozenset[RowKey],
) -> int:
    """Plan the samples; every row is written as soon as it arrives."""
    # Python must get Ctrl-C, so that the planner's parameters are restored.
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('benchmark_node')
    try:
        with PlannerClient(node, arguments.planner) as caller:
            caller.wait_for_planner()
            with LiveRun(caller, arguments.planner, arguments.client) as run:
                variants = run.variants(arguments.methods)
                with progress(len(samples) * len(variants) - len(done), 'plan') as step:
                    for row in run.rows(samples, variants, done):
                        folder.append([row])
                        step()
    except (PlannerClientError, ResultsError) as error:
        return report_error(str(error), INCOMPLETE)
    except KeyboardInterrupt:
        return report_error(
            'interrupted: the rows so far are kept; continue with --resume', INTERRUPTED
        )
    finally:
        leave(node)
        rclpy.try_shutdown()
    return OK


def close_run(folder: ResultsFolder, metadata: dict[str, Any], seed: int, code: int) -> int:
    """Write the reports of a run and print the table."""
    try:
        rows = folder.read()
        if not rows:
            return code
        folder.write_json('metadata.json', metadata)
        write_report(folder, metadata, load_barrier_maps(folder.path / MAPS_FILE))
    except ResultsError as error:
        return report_error(str(error), INCOMPLETE)
    sys.stdout.write(text_report(rows, seed) + '\n')
    sys.stderr.write(f'{len(rows)} rows: {folder.path}/report.html\n')
    return code


def report_error(message: str, code: int) -> int:
    """Write an error to stderr; return `code`."""
    sys.stderr.write(f'error: {message}\n')
    return code


if __name__ == '__main__':
    raise SystemExit(main())
