"""Plans samples with the planner of a running graph, one GetPlan per sample, one row each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from types import TracebackType
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.diagnostics import PlanReport
from llm_astar_msgs_adapter.messages.occupancy_grid import grid_to_message
from llm_astar_msgs_adapter.messages.path import path_from_message
from nav_msgs.msg import OccupancyGrid, Path
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python

from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample
from llm_astar_planner.benchmark.results import Row, RowKey, Variant, format_points, turning_points
from llm_astar_planner.benchmark.runner.engine import BASELINE
from llm_astar_planner.nodes.common.qos import LATCHED
from llm_astar_planner.nodes.tools.planner_client import PlannerClient, PlannerClientError
from llm_astar_planner.search.paper import WAYPOINT_METHODS

# Parameters of the planner that a run sets and restores: the paper's paths may cut corners.
RULES = {'corner_cutting': True}
TOUCHED = ('method', 'use_waypoints', *RULES)


class LiveRun:
    """Plans samples with the planner of a running graph. A context manager.

    It publishes the maps and sets the planner's parameters; leaving the context restores them.
    """

    def __init__(self, caller: PlannerClient, planner: str, client: str) -> None:
        """Use a running caller; `planner` and `client` are the names of the two nodes."""
        self._caller = caller
        self._planner = planner
        self._client = client
        self._maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self._before: dict[str, Any] = {}

    def __enter__(self) -> LiveRun:
        self._before = self._get(self._planner, TOUCHED)
        self._set(RULES)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._set(self._before)

    def variants(self, methods: Sequence[str]) -> list[Variant]:
        """Return A* and the methods without waypoints and with the source of the graph.

        Raises PlannerClientError where the waypoint client does not have these parameters.
        """
        names = ('source', 'prompt', 'model')
        source = tuple(self._get(self._client, names).values()) if self._client else ('none',)
        variants = [BASELINE]
        for method in methods:
            variants.append(Variant(method))
            if method in WAYPOINT_METHODS and source[0] != 'none':
                variants.append(Variant(method, *source))
        return list(dict.fromkeys(variants))

    def rows(
        self,
        samples: Sequence[BenchmarkSample],
        variants: Sequence[Variant],
        done: frozenset[RowKey],
    ) -> Iterator[Row]:
        """Plan what is not `done`, map by map and variant by variant; yield each row."""
        for _, group in groupby(samples, key=lambda sample: sample.barrier_map.id):
            of_map = list(group)
            left = [
                (variant, sample)
                for variant in variants
                for sample in of_map
                if (*sample.key, 1, variant) not in done
            ]
            if not left:
                continue
            grid_map = of_map[0].barrier_map.to_grid()
            self._publish_map(grid_map)
            for variant, of_variant in groupby(left, key=lambda pair: pair[0]):
                self._set({'method': variant.method, 'use_waypoints': variant.source != 'none'})
                for _, sample in of_variant:
                    yield self._plan(sample, grid_map, variant)

    def _publish_map(self, grid_map: GridMap) -> None:
        """Publish a map and wait until planner and client have received it."""
        self._maps.publish(grid_to_message(grid_map, self._caller.node.get_clock().now().to_msg()))
        self._caller.wait_until_ready(grid_map.digest, client=self._client)

    def _plan(self, sample: BenchmarkSample, grid_map: GridMap, variant: Variant) -> Row:
        cells = [sample.barrier_map.to_cell(point) for point in sample.sample[:2]]
        start, goal = (Pose2D(*pose) for pose in grid_map.grid_to_world(cells).tolist())
        path, report, round_trip = self._caller.call(start, goal)
        columns = report_columns(report, path, grid_map)
        return Row(*sample.key, 1, *variant, seconds_round_trip=round_trip, **columns)

    def _get(self, node: str, names: Sequence[str]) -> dict[str, Any]:
        client = self._caller.node.create_client(GetParameters, f'{node}/get_parameters')
        values = self._caller.ask(client, GetParameters.Request(names=list(names))).values
        if len(values) != len(names):
            raise PlannerClientError(f'{node} has no parameters {", ".join(names)}')
        return {name: parameter_value_to_python(value) for name, value in zip(names, values)}

    def _set(self, values: dict[str, Any]) -> None:
        client = self._caller.node.create_client(SetParameters, f'{self._planner}/set_parameters')
        messages = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        results = self._caller.ask(client, SetParameters.Request(parameters=messages)).results
        for name, result in zip(values, results):
            if not result.successful:
                raise PlannerClientError(f'{self._planner} refused {name}: {result.reason}')


def report_columns(report: PlanReport, path: Path, grid_map: GridMap) -> dict[str, Any]:
    """Return the columns of a row that describe a reported plan, in cells as without a graph."""
    cells = np.rint(grid_map.world_to_grid(path_from_message(path))).astype(np.int32)
    waypoints = grid_map.world_to_grid([(x, y) for x, y, _ in report.waypoints])
    columns: dict[str, Any] = {
        'code': report.code_name,
        'operation': float(report.operation),
        'storage': float(report.storage),
        'length': math.nan if report.length is None else report.length / grid_map.resolution,
        'seconds_source': report.seconds_source,
        'seconds_search': report.seconds_search,
        'source_status': report.source_status,
        'guided_by': report.guided_by,
        'waypoints': format_points(waypoints.round(6).tolist()),
        'verdicts': ';'.join(status for _, _, status in report.waypoints),
        'path': format_points(turning_points(cells)),
        'ratio': math.nan if report.ratio is None else report.ratio,
    }
    if report.code == 0:
        columns |= {
            'first_operation': float(report.first_operation),
            'clearance': math.inf if report.clearance is None else report.clearance,
            'turns': float(report.turns),
            'unknown_length': report.unknown_length,
        }
    return columns
