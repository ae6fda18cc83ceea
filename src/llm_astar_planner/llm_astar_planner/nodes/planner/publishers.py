"""Publishes plans, what they tell of themselves, and what RViz shows of them."""

from __future__ import annotations

import threading
import traceback
from concurrent.futures import ThreadPoolExecutor

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.diagnostics import PlanReport, report_to_message
from llm_astar_msgs_adapter.messages.markers import expanded_to_message, waypoints_to_markers
from nav_msgs.msg import GridCells, Path
from visualization_msgs.msg import MarkerArray

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import RELIABLE, REPORTS
from llm_astar_planner.planning.types import Plan


class PlanPublisher:
    """The topics a plan leaves on."""

    def __init__(self, entities: Entities) -> None:
        """Make the publishers."""
        self._node = entities.node
        self._plan = entities.publisher(Path, 'plan', RELIABLE)
        self._raw_plan = entities.publisher(Path, '~/raw_plan', RELIABLE)
        self._report = entities.publisher(DiagnosticArray, '~/report', REPORTS)
        self._markers = entities.publisher(MarkerArray, '~/markers', RELIABLE)
        self._explored = entities.publisher(GridCells, '~/explored', RELIABLE)
        self._change = threading.Lock()
        self._latest: tuple[Plan, GridMap, Time] | None = None
        self._painter = ThreadPoolExecutor(1, 'painter')
        entities.on_close(self._painter.shutdown)

    @property
    def wants_expanded(self) -> bool:
        """Whether anybody looks at the expanded cells."""
        return bool(self._explored.get_subscription_count())

    @property
    def wants_raw(self) -> bool:
        """Whether anybody listens for the path before it is shortened."""
        return bool(self._raw_plan.get_subscription_count())

    def publish(self, path: Path) -> None:
        """Publish a plan."""
        self._plan.publish(path)

    def publish_raw(self, path: Path) -> None:
        """Publish a plan as it was before it was shortened."""
        self._raw_plan.publish(path)

    def show(self, plan: Plan, grid_map: GridMap, stamp: Time) -> None:
        """Draw the plan for RViz, if anyone looks.

        That is done aside, so no caller waits for it; a plan that a newer one overtakes meanwhile
        is not drawn.
        """
        if not (self._markers.get_subscription_count() or self.wants_expanded):
            return
        with self._change:
            is_waiting = self._latest is not None
            self._latest = (plan, grid_map, stamp)
        if not is_waiting:
            self._painter.submit(self._draw)

    def _draw(self) -> None:
        with self._change:
            latest, self._latest = self._latest, None
        if latest is None:
            return
        plan, grid_map, stamp = latest
        try:
            if self._markers.get_subscription_count():
                waypoints = [(point.x, point.y, point.status.value) for point in plan.waypoints]
                ends = (plan.start, plan.goal)
                markers = waypoints_to_markers(waypoints, grid_map, stamp, ends, plan.via)
                self._markers.publish(markers)
            if self.wants_expanded and plan.expanded.size:
                self._explored.publish(expanded_to_message(plan.expanded, grid_map, stamp))
        except Exception:  # noqa: BLE001 - a picture that fails must not go unnoticed
            self._node.get_logger().error(traceback.format_exc())

    def tell(self, report: PlanReport, stamp: Time) -> None:
        """Publish and log a report."""
        self._report.publish(report_to_message(report, self._node.get_name(), stamp))
        logger = self._node.get_logger()
        if report.code:
            logger.warning(report.summary)
        else:
            logger.info(f'{report.summary}; guided by {report.guided_by}')
