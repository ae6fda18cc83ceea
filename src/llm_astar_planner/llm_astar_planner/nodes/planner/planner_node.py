"""planner_node: plans on the latest map, for a service, RViz's buttons, Nav2, and who listens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rclpy
from lifecycle_msgs.srv import ChangeState
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.spin import run
from llm_astar_planner.nodes.planner.server import PlannerServer
from llm_astar_planner.search.paper import compile_kernels

NAME = 'planner_node'
# Callers served at once; more wait their turn. Waiting for waypoints takes a thread, no core.
THREADS = 16


class PlannerNode(Node):
    """Plans from the start; see the README for its topics, services and parameters."""

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Compile the searches and join the graph."""
        compile_kernels()
        super().__init__(NAME, **node_options)
        self._server = PlannerServer(self, Parameters(self, NAME))
        self._server.is_active = True
        self.get_logger().info('ready; waiting for a map')

    def destroy_node(self) -> None:
        """Leave the graph, the waypoint client included."""
        self._server.close()
        super().destroy_node()


class ManagedPlannerNode(LifecycleNodeMixin, Node):
    """The same as a managed node: configure joins the graph, activate answers."""

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Compile the searches, declare the parameters, and wait to be configured."""
        # Before its services are there: who brings nodes up waits for these first.
        compile_kernels()
        Node.__init__(self, NAME, **node_options)
        # To set a parameter may take as long as a large map does; its manager waits two seconds.
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._on_change_state
        self._settings = Parameters(self, NAME)
        self._server: PlannerServer | None = None
        self.get_logger().info('ready to be configured')

    def destroy_node(self) -> None:
        """Leave the graph, in whatever state."""
        self._close()
        super().destroy_node()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Join the graph; maps are taken from here on."""
        try:
            self._server = PlannerServer(self, self._settings)
        except Exception as error:  # noqa: BLE001 - the manager is told, and may try again
            self.get_logger().error(f'not configured: {type(error).__name__}: {error}')
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer questions."""
        if self._server is not None:
            self._server.is_active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give up what is being planned, and tell callers that the node is not active."""
        if self._server is not None:
            self._server.is_active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph, to be configured anew."""
        self._close()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph for good."""
        self._close()
        return super().on_shutdown(state)

    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph, and be ready to be configured anew."""
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def _on_change_state(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        """Refuse a transition that the state does not have, which in rclpy ends the process."""
        try:
            return self._change_state(request, response)
        except RCLError:  # rcl has logged it
            response.success = False
            return response

    def _close(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None


def make_node() -> Node:
    """Make the node of the kind that its parameter `autostart` asks for."""
    # A node is of one kind from its making, and only a node can read its parameters.
    probe = rclpy.create_node(NAME, start_parameter_services=False, enable_rosout=False)
    try:
        is_managed = not Parameters(probe, NAME)['autostart']
    finally:
        probe.destroy_node()
    return ManagedPlannerNode() if is_managed else PlannerNode()


def main(args: Sequence[str] | None = None) -> int:
    """Run planner_node."""
    return run(make_node, args, lambda: MultiThreadedExecutor(num_threads=THREADS))


if __name__ == '__main__':
    raise SystemExit(main())
