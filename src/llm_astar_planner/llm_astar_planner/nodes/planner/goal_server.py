"""Takes goals: `~/get_plan` and Nav2's path actions, which clients wait for."""

from __future__ import annotations

from nav_msgs.srv import GetPlan
from rclpy.service_introspection import ServiceIntrospectionState

from llm_astar_planner.nodes.common.callback_groups import LimitedCallbackGroup
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import RELIABLE
from llm_astar_planner.nodes.planner.goals import GoalAnswerer, PlanGoal
from llm_astar_planner.nodes.planner.nav2_server import serve_nav2

# Callers served at a time; more wait their turn. Waiting for waypoints takes a thread, no core.
CALLERS = 16
INTROSPECTION_STATES = {
    'disabled': ServiceIntrospectionState.OFF,
    'metadata': ServiceIntrospectionState.METADATA,
    'contents': ServiceIntrospectionState.CONTENTS,
}


class GoalServer:
    """The services and actions that take goals. They need nothing that takes long to import."""

    def __init__(self, entities: Entities, answerer: GoalAnswerer, introspection: str) -> None:
        """Serve; `introspection` is one of INTROSPECTION_STATES, for `~/get_plan`."""
        self._answerer = answerer
        callers = LimitedCallbackGroup(CALLERS)
        service = entities.service(GetPlan, '~/get_plan', self.on_get_plan, callers)
        state = INTROSPECTION_STATES[introspection]
        service.configure_introspection(entities.node.get_clock(), RELIABLE, state)
        served = 'with' if serve_nav2(entities, answerer) else 'without nav2_msgs, so without'
        entities.node.get_logger().info(f"{served} Nav2's planner actions")

    def on_get_plan(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        """Answer `~/get_plan`."""
        goal = PlanGoal((request.goal,), request.start, float(request.tolerance))
        response.plan = self._answerer.answer_goal(goal).path
        return response
