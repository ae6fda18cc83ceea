# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""planner_node: plans on the newest map, for services, actions and RViz's buttons."""

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import Path
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.parameters import OVERRIDES, Parameters
from llm_astar_planner.nodes.common.spin import RCLError, run_node
from llm_astar_planner.nodes.planner import goals
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.types import ResultCode

if TYPE_CHECKING:
    from llm_astar_planner.nodes.planner.planner_server import PlannerServer

NAME = 'planner_node'
# The other threads are for maps, goals of RViz and of Nav2, parameters and instructions, and for
# a client in this process.
THREADS = goals.CALLERS + 24
NOT_CONFIGURED = 'the node is not configured (lifecycle)'


class PlannerNode(LifecycleNodeMixin, Node):
    """A lifecycle node: configure joins the graph, activate answers goals.

    It configures and activates itself unless the parameter `autostart` is false. Its topics,
    services and parameters are in docs/reference.md.
    """

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Declare the parameters, and start when spun or wait to be configured."""
        self._goals: Entities | None = None
        self._server: PlannerServer | None = None
        self._problem = ''
        # Plans for a goal. Those that come before the start wait for it.
        self.answer: goals.Answer = self.answer_after_start
        # What both the executor and the thread that ends the process change.
        self._lock = threading.RLock()
        self._is_leaving = False
        self._started = threading.Event()
        Node.__init__(self, NAME, **OVERRIDES, **node_options)
        if hasattr(self.context, 'untrack_node'):
            # Kilted's contexts destroy their nodes, holding a lock that this node's threads need.
            self.context.untrack_node(self)
        # Setting a parameter may take as long as a large map does; a manager waits two seconds.
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        (service,) = (one for one in self.services if one.srv_type is ChangeState)
        self._change_state, service.callback = service.callback, self.on_change_state
        self._settings = Parameters(self, NAME)
        if not self._settings['autostart']:
            self._started.set()
            self.get_logger().info('ready to be configured')
            return
        # When the executor runs, so that goals are taken meanwhile; also without a /clock.
        self._start_timer = self.create_timer(
            0.0,
            self.start,
            callback_group=MutuallyExclusiveCallbackGroup(),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    @property
    def is_active(self) -> bool:
        """Whether goals are taken: by an active node, and by one that is about to be."""
        return not self._started.is_set() or (
            self._server is not None and self._server.handler.is_active
        )

    def others(self) -> list[Node]:
        """Return the nodes that are to run in the same process."""
        if not self._settings['client_in_process']:
            return []
        from llm_astar_planner.nodes.llm_client_node import LlmClientNode  # noqa: PLC0415

        return [LlmClientNode()]

    def answer_after_start(self, goal: goals.PlanGoal, *arguments: Any) -> goals.PlanResponse:  # noqa: ANN401 - see RequestHandler.answer
        """Answer a goal as `RequestHandler.answer` does, once the node is configured."""
        self._started.wait()
        server = self._server
        if server is None:
            return goals.PlanResponse(
                goal, goals.refusal(ResultCode.UNKNOWN, NOT_CONFIGURED), Path()
            )
        return server.handler.answer(goal, *arguments)

    def start(self) -> None:
        """Configure and activate. Raises ParameterError if that fails."""
        self.destroy_timer(self._start_timer)
        try:
            if self.trigger_configure() is TransitionCallbackReturn.SUCCESS:
                self.trigger_activate()
        finally:
            self._started.set()
        if self._is_leaving or not self.context.ok():
            return
        if self._server is None:
            raise ParameterError(f'planner_node could not be configured: {self._problem}')
        self.get_logger().info('ready; waiting for a map')

    def destroy_node(self) -> None:
        """Leave the graph, in whatever state."""
        self._is_leaving = True
        self._started.set()
        self.close()
        super().destroy_node()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Join the graph; maps are taken from here on."""
        try:
            self.serve()
        except Exception as error:  # noqa: BLE001 - the manager is told, and may try again
            self._problem = ' '.join(str(error).split()) or type(error).__name__
            if self.context.ok():
                self.get_logger().error(f'not configured: {type(error).__name__}: {error}')
            self.close()
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def serve(self) -> None:
        """Join the graph: at first what clients wait for, then what takes long to import."""
        with self._lock:
            self._goals = Entities(self)
            introspection = self._settings['introspection_mode']
            goals.serve_goals(self._goals, self, introspection)
        from llm_astar_planner.nodes.planner.planner_server import PlannerServer  # noqa: PLC0415

        with self._lock:
            if self._is_leaving:
                raise ExternalShutdownException
            self._server = PlannerServer(self, self._settings, self)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer goals."""
        if self._server is not None:
            self._server.activate()
            self.answer = self._server.handler.answer
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cancel what is being planned, and refuse goals."""
        if self._server is not None:
            self._server.deactivate()
        return super().on_deactivate(state)

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph, ready to be configured again."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    on_shutdown = on_error = on_cleanup

    def on_change_state(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        """Refuse a transition that the state does not have; in rclpy it ends the process."""
        try:
            return self._change_state(request, response)
        except RCLError:  # rcl has logged it
            response.success = False
            return response

    def close(self) -> None:
        """Leave the graph, but for the lifecycle services."""
        with self._lock:
            if self._server is not None:
                self.answer = self.answer_after_start
                self._server.close()
                self._server = None
            if self._goals is not None:
                self._goals.close()
                self._goals = None


def main(args: Sequence[str] | None = None) -> int:
    """Run planner_node."""
    return run_node(PlannerNode, args, lambda: MultiThreadedExecutor(THREADS), PlannerNode.others)
