"""benchmark_node: replays a dataset's samples through the live graph and prints the ratios.

It publishes each map itself (no map_node beside it), sets the planner's method, and calls
GetPlan sample by sample, so that transport and nodes are part of what is measured.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import rclpy
from llm_astar_msgs_adapter.barrier_map import BarrierMap, BarrierMapError, load_barrier_maps
from llm_astar_msgs_adapter.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.occupancy_grid import grid_to_message
from llm_astar_msgs_adapter.report import PlanReport
from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.utilities import remove_ros_args

from llm_astar_planner.nodes.caller import Caller, CallerError
from llm_astar_planner.nodes.qos import LATCHED
from llm_astar_planner.search.methods import METHODS
from llm_astar_planner.share import find_file

BASELINE = 'astar'


class Row(NamedTuple):
    """One sample planned by one method, with its round trip in seconds."""

    map: int
    pair: int
    method: str
    report: PlanReport
    round_trip: float


def main(args: Sequence[str] | None = None) -> int:
    """Run benchmark_node; return 0, 2 on bad input, 3 where the graph broke off, 130 on Ctrl-C."""
    arguments = _arguments(remove_ros_args(args if args is not None else sys.argv)[1:])
    try:
        maps = load_barrier_maps(find_file(arguments.dataset, 'maps'))
    except (BarrierMapError, FileNotFoundError) as error:
        sys.stderr.write(f'error: {error}\n')
        return 2
    rclpy.init(args=args)
    node = rclpy.create_node('benchmark_node')
    rows: list[Row] = []
    code = 0
    try:
        with Caller(node, arguments.planner) as caller:
            rows.extend(_replay(caller, maps, arguments))
    except CallerError as error:
        sys.stderr.write(f'error: {error}\n')
        code = 3
    except KeyboardInterrupt:
        code = 130
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    sys.stdout.write(summary(rows))
    return code


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='benchmark_node',
        description='Replay start-goal samples through the live graph and print the ratios to '
        'A*. Start planner_node and llm_client_node first, and no map_node.',
    )
    parser.add_argument(
        '--dataset',
        default='demo.json',
        metavar='FILE',
        help='barrier maps: a path, or a name in maps/ (default: %(default)s)',
    )
    parser.add_argument('--limit', type=int, metavar='N', help='samples at most (default: all)')
    parser.add_argument(
        '--method', default='llm_astar', choices=tuple(METHODS), help='compared with astar'
    )
    parser.add_argument('--planner', default='planner_node', help="the planner node's name")
    arguments = parser.parse_args(argv)
    if arguments.limit is not None and arguments.limit < 1:
        parser.error(f'--limit {arguments.limit} is not 1 or more')
    return arguments


class _PlannerParameters:
    """Sets the method of the planner node."""

    def __init__(self, node: Node, planner: str) -> None:
        self._client = node.create_client(SetParameters, f'{planner}/set_parameters')

    def set_method(self, caller: Caller, method: str) -> None:
        """Set the method. Raises CallerError where the planner refuses or is silent."""
        request = SetParameters.Request(
            parameters=[Parameter('method', value=method).to_parameter_msg()]
        )
        result = caller.ask(self._client, request).results[0]
        if not result.successful:
            raise CallerError(f'method {method} was refused: {result.reason}')


def _samples(maps: list[BarrierMap], limit: int | None) -> Iterator[tuple[BarrierMap, list[int]]]:
    """Yield each map with the indices of the pairs to replay."""
    left = sum(len(barrier_map.samples) for barrier_map in maps) if limit is None else limit
    for barrier_map in maps:
        pairs = list(range(min(left, len(barrier_map.samples))))
        left -= len(pairs)
        if pairs:
            yield barrier_map, pairs


def _replay(
    caller: Caller, maps: list[BarrierMap], arguments: argparse.Namespace
) -> Iterator[Row]:
    """Plan every sample by the baseline and by the method; yield a row each."""
    publisher = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
    parameters = _PlannerParameters(caller.node, arguments.planner)
    methods = list(dict.fromkeys((BASELINE, arguments.method)))
    for barrier_map, pairs in _samples(maps, arguments.limit):
        grid_map = barrier_map.to_grid()
        publisher.publish(grid_to_message(grid_map, caller.node.get_clock().now().to_msg()))
        caller.wait_until_ready(grid_map.digest)
        for method in methods:
            parameters.set_method(caller, method)
            for pair in pairs:
                yield _plan(caller, barrier_map, grid_map, pair, method)


def _plan(
    caller: Caller, barrier_map: BarrierMap, grid_map: GridMap, pair: int, method: str
) -> Row:
    sample = barrier_map.samples[pair]
    cells = [barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)]
    start, goal = (Pose2D(*place) for place in grid_map.grid_to_world(cells).tolist())
    _, report, round_trip = caller.call(start, goal)
    return Row(barrier_map.id, pair, method, report, round_trip)


def summary(rows: Sequence[Row]) -> str:
    """Return the ratios to A* over the samples that both methods solved, as text.

    Geometric means of the ratios on the same sample (LLM-A* paper, sec. 4.3).
    """
    baseline = {(row.map, row.pair): row.report for row in rows if row.method == BASELINE}
    others = [row for row in rows if row.method != BASELINE or len(baseline) == len(rows)]
    solved = [
        (row.report, baseline[row.map, row.pair])
        for row in others
        if row.report.code == 0
        and (row.map, row.pair) in baseline
        and baseline[row.map, row.pair].code == 0
    ]
    if not solved:
        return f'{len(rows)} plans, no sample solved by both methods\n'
    lines = [f'{len(others)} samples, {len(solved)} solved, {others[0].method} over {BASELINE}:']
    for name in ('operation', 'storage', 'length'):
        ratios = [getattr(ours, name) / getattr(theirs, name) for ours, theirs in solved]
        lines.append(f'  {name:9}  {100 * np.exp(np.mean(np.log(ratios))):7.2f} %')
    guides: dict[str, int] = {}
    for row in others:
        guides[row.report.guided_by] = guides.get(row.report.guided_by, 0) + 1
    counts = ', '.join(f'{name} {count}' for name, count in sorted(guides.items()))
    lines.append(f'  guided by  {counts}')
    times = np.percentile([1000 * row.round_trip for row in rows], [50, 95, 99])
    lines.append('  round trip {:.2f} / {:.2f} / {:.2f} ms (p50 / p95 / p99)'.format(*times))
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    raise SystemExit(main())
