"""planner_node: plans on the latest map, for a service, RViz's buttons, and who listens."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from llm_astar_msgs_adapter.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.occupancy_grid import grid_from_message
from llm_astar_msgs_adapter.path import path_to_message, pose_from_message
from llm_astar_msgs_adapter.report import PlanReport, report_to_message, status_to_message
from llm_astar_msgs_adapter.waypoints import expanded_to_message, waypoints_to_markers
from nav_msgs.msg import GridCells, OccupancyGrid, Path
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from llm_astar_planner.nodes.introspection import INTROSPECTION_MODE, introspect
from llm_astar_planner.nodes.parameters import Parameter, Parameters
from llm_astar_planner.nodes.paths import Paths
from llm_astar_planner.nodes.qos import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.remote_source import RemoteSource
from llm_astar_planner.nodes.run import run
from llm_astar_planner.plan_reports import failure_report, plan_report
from llm_astar_planner.planner import GridRules, Plan, Planner, PlanRequest
from llm_astar_planner.result_code import ResultCode
from llm_astar_planner.search.guided import Improvement
from llm_astar_planner.search.landmarks import LandmarkKeeper
from llm_astar_planner.search.methods import GUIDED, HEURISTICS, METHODS, compile_kernels

# Callers served at once; more wait their turn. Waiting for waypoints takes a thread, no core.
THREADS = 16

PARAMETERS = (
    Parameter('method', GUIDED, 'How to search', choices=tuple(METHODS)),
    Parameter(
        'max_suboptimality',
        1.1,
        'What guided proves its path within, 1 or more; 0: the first path found',
        minimum=0.0,
        maximum=1000.0,
    ),
    Parameter(
        'search_while_waiting', True, 'Whether guided starts before the waypoints are there'
    ),
    Parameter('any_angle', False, 'Whether the plan is shortened at any angle'),
    Parameter(
        'heuristic',
        'euclidean',
        "The paper's methods' estimate of what is left",
        choices=tuple(HEURISTICS),
    ),
    Parameter('weight', 2.0, "weighted_astar's weight of h", minimum=1.0, maximum=100.0),
    Parameter(
        'max_planning_time', 5.0, 'Seconds for waypoints and search', minimum=0.01, maximum=3600.0
    ),
    Parameter('source_timeout', 4.0, 'Seconds to wait for waypoints', minimum=0.0, maximum=3600.0),
    Parameter(
        'llm_client', 'llm_client_node', 'Node to ask for waypoints; empty asks none', fixed=True
    ),
    Parameter('use_waypoints', True, 'Whether to ask for waypoints'),
    Parameter('occupied_threshold', 65, 'Occupancy that blocks', minimum=1, maximum=100),
    Parameter('allow_unknown', True, 'Whether paths may cross unknown cells'),
    Parameter(
        'cost_travel_multiplier',
        2.0,
        'What occupancy that does not block adds to the price of a move; 0: lengths alone',
        minimum=0.0,
        maximum=100.0,
    ),
    Parameter('corner_cutting', False, 'Whether diagonal steps may pass blocked corners'),
    INTROSPECTION_MODE,
)


class PlannerNode(Node):
    """Plans from `map`; see the README for its topics, services and parameters."""

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Join the graph and compile the searches."""
        super().__init__('planner_node', **node_options)
        self._settings = Parameters(self, PARAMETERS, _problem)
        self._keeper = LandmarkKeeper()
        self._grid_map: GridMap | None = None
        self._map_time = 0.0
        self._planner: Planner | None = None
        self._planner_change = threading.Lock()
        self._start: PoseStamped | None = None
        self._last: PlanReport | None = None
        client = self._settings['llm_client']
        self._source = RemoteSource(self, client) if client else None
        compile_kernels()
        self._publish_to()
        self._listen()
        self.add_post_set_parameters_callback(lambda _: self._rebuild())
        self.get_logger().info('ready; waiting for a map')

    def destroy_node(self) -> None:
        """Leave the graph, the waypoint client included."""
        if self._source is not None:
            self._source.close()
        self._keeper.close()
        super().destroy_node()

    def _publish_to(self) -> None:
        self._plan_publisher = self.create_publisher(Path, 'plan', RELIABLE)
        self._raw_publisher = self.create_publisher(Path, '~/raw_plan', RELIABLE)
        self._report_publisher = self.create_publisher(DiagnosticArray, '~/report', REPORTS)
        self._marker_publisher = self.create_publisher(MarkerArray, '~/markers', RELIABLE)
        self._explored_publisher = self.create_publisher(GridCells, '~/explored', RELIABLE)
        self._health_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)

    def _listen(self) -> None:
        alone, together = MutuallyExclusiveCallbackGroup(), ReentrantCallbackGroup()
        self.create_subscription(
            OccupancyGrid,
            'map',
            self._on_map,
            LATCHED,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        service = self.create_service(
            GetPlan, '~/get_plan', self._on_get_plan, callback_group=together
        )
        introspect(self, service, self._settings['introspection_mode'])
        self.create_subscription(
            PoseWithCovarianceStamped,
            'initialpose',
            self._on_initial_pose,
            RELIABLE,
            callback_group=alone,
        )
        self.create_subscription(
            PoseStamped, 'goal_pose', self._on_goal_pose, RELIABLE, callback_group=alone
        )
        self.create_timer(1.0, self._publish_health, callback_group=together)

    def _on_map(self, message: OccupancyGrid) -> None:
        """Take a map, if it is one; the last good one stays otherwise."""
        try:
            grid_map = grid_from_message(message)
        except GridMapError as error:
            self.get_logger().error(f'map refused, {self._map_name()} stays: {error}')
            return
        self._grid_map, self._map_time = grid_map, time.monotonic()
        self._rebuild()
        self.get_logger().info(f'planning on {self._map_name()}')
        self._publish_health()

    def _rebuild(self) -> None:
        """Make the planner of the current map and parameters; plans under way keep theirs."""
        with self._planner_change:
            if self._grid_map is None:
                return
            rules = GridRules(
                self._settings['occupied_threshold'],
                self._settings['allow_unknown'],
                self._settings['corner_cutting'],
                self._settings['cost_travel_multiplier'],
            )
            current = self._planner
            if current and current.grid_map is self._grid_map and current.rules == rules:
                return
            planner = Planner(self._grid_map, rules, keeper=self._keeper)
            self._planner = planner.prepare(wait=False)

    def _on_get_plan(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        response.plan = self._answer(request.start, request.goal)
        return response

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        self._start = PoseStamped(header=message.header, pose=message.pose.pose)

    def _on_goal_pose(self, message: PoseStamped) -> None:
        self._answer(self._start, message)

    def _answer(self, start: PoseStamped | None, goal: PoseStamped) -> Path:
        """Plan, publish what came of it, and return the path; an empty one means failure."""
        stamp = self.get_clock().now().to_msg()
        planner = self._planner
        if planner is None:
            self._tell(failure_report(ResultCode.UNKNOWN, 'no map has arrived yet'), stamp)
            return path_to_message([], '', stamp)
        grid_map = planner.grid_map
        ends = _ends(start, goal, grid_map)
        if isinstance(ends, PlanReport):
            self._tell(ends, stamp)
            return path_to_message([], grid_map.frame_id, stamp)
        made = Paths(grid_map, stamp, ends[1].yaw)
        published: list[Path] = []

        def publish_better(better: Improvement) -> None:
            published.append(made.message(better.path))
            self._plan_publisher.publish(published[-1])

        plan = planner.plan(self._request(*ends, grid_map), on_improvement=publish_better)
        path = made.final(plan)
        if plan.code is ResultCode.NONE:
            if not published or published[-1] is not path:
                self._plan_publisher.publish(path)
            if self._raw_publisher.get_subscription_count():
                self._raw_publisher.publish(made.message(plan.path))
        self._show(plan, grid_map, stamp)
        self._tell(plan_report(plan, grid_map), stamp)
        return path

    def _request(self, start: Pose2D, goal: Pose2D, grid_map: GridMap) -> PlanRequest:
        return PlanRequest(
            start=grid_map.world_to_cell(start.x, start.y),
            goal=grid_map.world_to_cell(goal.x, goal.y),
            method=self._settings['method'],
            source=self._source if self._settings['use_waypoints'] else None,
            heuristic=self._settings['heuristic'],
            weight=self._settings['weight'],
            time_limit=self._settings['max_planning_time'],
            source_time_limit=self._settings['source_timeout'],
            max_suboptimality=self._settings['max_suboptimality'] or None,
            search_while_waiting=self._settings['search_while_waiting'],
            any_angle=self._settings['any_angle'],
            want_expanded=self._explored_publisher.get_subscription_count() > 0,
        )

    def _show(self, plan: Plan, grid_map: GridMap, stamp: Time) -> None:
        """Draw the plan for RViz, if anyone looks."""
        if self._marker_publisher.get_subscription_count():
            waypoints = [(point.x, point.y, point.verdict.value) for point in plan.waypoints]
            self._marker_publisher.publish(waypoints_to_markers(waypoints, grid_map, stamp))
        if self._explored_publisher.get_subscription_count():
            self._explored_publisher.publish(expanded_to_message(plan.expanded, grid_map, stamp))

    def _tell(self, report: PlanReport, stamp: Time) -> None:
        """Publish and log a report."""
        self._last = report
        self._report_publisher.publish(report_to_message(report, self.get_name(), stamp))
        logger = self.get_logger()
        if report.code:
            logger.warning(report.summary)
        else:
            logger.info(f'{report.summary}; guided by {report.guided_by}')

    def _map_name(self) -> str:
        if self._grid_map is None:
            return 'no map'
        size = f'{self._grid_map.width} x {self._grid_map.height}'
        return f'map {self._grid_map.digest} of {size} cells'

    def _publish_health(self) -> None:
        """Publish the state of the node: at 1 Hz, and whenever a map comes."""
        has_map = self._grid_map is not None
        values = {
            'map_digest': self._grid_map.digest if self._grid_map else None,
            'map_age': round(time.monotonic() - self._map_time, 3) if has_map else None,
            'llm_client_ready': self._source is not None and self._source.ready,
            'last_code': self._last.code_name if self._last else None,
            'last_guided_by': self._last.guided_by if self._last else None,
            'landmark_bytes': self._keeper.nbytes,
            'last_ratio': self._last.ratio if self._last else None,
            'last_source_status': self._last.source_status if self._last else None,
        }
        level = DiagnosticStatus.OK if has_map else DiagnosticStatus.WARN
        name = f'{self.get_fully_qualified_name()[1:]}: planner'
        stamp = self.get_clock().now().to_msg()
        message = f'planning on {self._map_name()}'
        self._health_publisher.publish(status_to_message(name, level, message, values, stamp))


def _problem(values: dict[str, Any]) -> str:
    bound = values['max_suboptimality']
    if 0.0 < bound < 1.0:
        return f'max_suboptimality: {bound} is neither 0 (first path) nor 1 or more'
    return ''


def _ends(
    start: PoseStamped | None, goal: PoseStamped, grid_map: GridMap
) -> tuple[Pose2D, Pose2D] | PlanReport:
    """Read both poses in the map's frame, or report why they cannot be."""
    if start is None:
        return failure_report(ResultCode.TF_ERROR, 'no start: nothing came on initialpose yet')
    poses = []
    for name, pose in (('start', start), ('goal', goal)):
        frame = pose.header.frame_id
        # Callers that leave the frame empty mean the map's.
        if frame not in ('', grid_map.frame_id):
            message = f'the {name} is in frame {frame!r}, the map in {grid_map.frame_id!r}'
            return failure_report(ResultCode.TF_ERROR, f'{message}, and no transform is known')
        try:
            poses.append(pose_from_message(pose, name))
        except GridMapError as error:
            return failure_report(ResultCode.UNKNOWN, str(error))
    return poses[0], poses[1]


def main(args: Sequence[str] | None = None) -> int:
    """Run planner_node."""
    return run(PlannerNode, args, lambda: MultiThreadedExecutor(num_threads=THREADS))


if __name__ == '__main__':
    raise SystemExit(main())
