"""A benchmark run through the live graph: every sample a GetPlan, every answer a row."""

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

from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample, ProblemMap
from llm_astar_planner.benchmark.points import format_points, turning_points
from llm_astar_planner.benchmark.results import Case, Row, RowKey
from llm_astar_planner.benchmark.runner.engine import BASELINE
from llm_astar_planner.nodes.common.qos import LATCHED
from llm_astar_planner.nodes.tools.planner_client import Caller, CallerError
from llm_astar_planner.search.paper import WAYPOINT_METHODS

# What a run sets of the planner, and puts back: the paper lets paths cut corners, and a plan
# that is remembered, or made again on the next map, has no time of its own.
RULES = {'corner_cutting': True, 'remember_plans': 0}
TOUCHED = ('method', 'use_waypoints', *RULES)


class LiveRun:
    """Replays samples through the planner of a graph. A context manager.

    It publishes the maps itself and sets the planner's method and rules; leaving it puts the
    parameters back.
    """

    def __init__(self, caller: Caller, planner: str, client: str) -> None:
        """Take a running caller, and the names of the planner and of its waypoint client."""
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

    def cases(self, methods: Sequence[str]) -> list[Case]:
        """Return the cases of methods: A* first; with the graph's waypoints, and without.

        Raises CallerError where the waypoint client does not tell its source.
        """
        names = ('source', 'prompt', 'model')
        source = tuple(self._get(self._client, names).values()) if self._client else ('none',)
        cases = [BASELINE]
        for method in methods:
            cases.append(Case(method))
            if method in WAYPOINT_METHODS and source[0] != 'none':
                cases.append(Case(method, *source))
        return list(dict.fromkeys(cases))

    def rows(
        self, samples: Sequence[BenchmarkSample], cases: Sequence[Case], done: frozenset[RowKey]
    ) -> Iterator[list[Row]]:
        """Plan what is not `done`, map by map and case by case; yield rows as they come."""
        for _, group in groupby(samples, key=lambda sample: sample.barrier_map.id):
            of_map = list(group)
            left = [
                (case, sample)
                for case in cases
                for sample in of_map
                if (*sample.key, 1, case) not in done
            ]
            if not left:
                continue
            barrier_map = of_map[0].barrier_map
            grid_map = barrier_map.to_grid()
            self._show(grid_map)
            for case, of_case in groupby(left, key=lambda pair: pair[0]):
                self._set({'method': case.method, 'use_waypoints': case.source != 'none'})
                for _, sample in of_case:
                    yield [self._plan(sample, barrier_map, grid_map, case)]

    def _show(self, grid_map: GridMap) -> None:
        """Publish a map and wait until planner and client have it."""
        self._maps.publish(grid_to_message(grid_map, self._caller.node.get_clock().now().to_msg()))
        self._caller.wait_until_ready(grid_map.digest, client=self._client)

    def _plan(
        self, sample: BenchmarkSample, barrier_map: ProblemMap, grid_map: GridMap, case: Case
    ) -> Row:
        cells = [barrier_map.to_cell(point) for point in sample.sample[:2]]
        start, goal = (Pose2D(*place) for place in grid_map.grid_to_world(cells).tolist())
        path, report, round_trip = self._caller.call(start, goal)
        return _row(sample, grid_map, case, path, report, round_trip=round_trip)

    def _get(self, node: str, names: Sequence[str]) -> dict[str, Any]:
        client = self._caller.node.create_client(GetParameters, f'{node}/get_parameters')
        values = self._caller.ask(client, GetParameters.Request(names=list(names))).values
        if len(values) != len(names):
            raise CallerError(f'{node} has no parameters {", ".join(names)}')
        return {name: parameter_value_to_python(value) for name, value in zip(names, values)}

    def _set(self, values: dict[str, Any]) -> None:
        client = self._caller.node.create_client(SetParameters, f'{self._planner}/set_parameters')
        messages = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        results = self._caller.ask(client, SetParameters.Request(parameters=messages)).results
        for name, result in zip(values, results):
            if not result.successful:
                raise CallerError(f'{self._planner} refused {name}: {result.reason}')


def _row(
    sample: BenchmarkSample,
    grid_map: GridMap,
    case: Case,
    path: Path,
    report: PlanReport,
    *,
    round_trip: float,
) -> Row:
    """Put an answer into cells, as the rows of a run without a graph are."""
    cells = np.rint(grid_map.world_to_grid(path_from_message(path))).astype(np.int32)
    places = grid_map.world_to_grid([(x, y) for x, y, _ in report.waypoints])
    length = math.nan if report.length is None else report.length / grid_map.resolution
    return Row(
        *sample.key,
        1,
        *case,
        report.code_name,
        operation=float(report.operation),
        storage=float(report.storage),
        length=length,
        seconds_source=report.seconds_source,
        seconds_search=report.seconds_search,
        source_status=report.source_status,
        guided_by=report.guided_by,
        waypoints=format_points(places.round(6).tolist()),
        verdicts=';'.join(verdict for _, _, verdict in report.waypoints),
        path=format_points(turning_points(cells)),
        seconds_round_trip=round_trip,
        first_operation=float(report.first_operation) if report.code == 0 else math.nan,
        ratio=math.nan if report.ratio is None else report.ratio,
        **(_of_path(report) if report.code == 0 else {}),
    )


def _of_path(report: PlanReport) -> dict[str, Any]:
    """Return the columns that only a path has."""
    return {
        'clearance': math.inf if report.clearance is None else report.clearance,
        'turns': float(report.turns),
        'unknown_length': report.unknown_length,
    }
