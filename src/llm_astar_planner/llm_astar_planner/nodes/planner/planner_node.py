"""planner_node: plans on the newest map, for services, actions and RViz's buttons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from lifecycle_msgs.srv import ChangeState
from nav_msgs.srv import GetPlan
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.service_introspection import ServiceIntrospectionState
from std_msgs.msg import String

from llm_astar_planner.instructions.place_names import PlaceGoalError
from llm_astar_planner.nodes.common.bond import Bond, make_bond
from llm_astar_planner.nodes.common.callback_groups import LimitedCallbackGroup
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.qos import RELIABLE
from llm_astar_planner.nodes.common.spin import SpinThread, run_node, side_node
from llm_astar_planner.nodes.common.tf import HAS_TF2, Frames, TransformListener
from llm_astar_planner.nodes.planner.diagnostics import DiagnosticsPublisher
from llm_astar_planner.nodes.planner.instruction_server import InstructionServer
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.nav2_server import PathValidityService, serve_nav2
from llm_astar_planner.nodes.planner.path_monitor import QUIET_SECONDS, PathMonitor
from llm_astar_planner.nodes.planner.places_server import PlacesParameter, PlacesServer
from llm_astar_planner.nodes.planner.publishers import PlanPublisher
from llm_astar_planner.nodes.planner.request_conversion import PlanGoal, RequestConverter
from llm_astar_planner.nodes.planner.request_handler import (
    CancellationToken,
    PlanResponse,
    PreemptingGoalSlot,
    RequestHandler,
)
from llm_astar_planner.nodes.planner.waypoint_client import WaypointClient
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.parameters import costmap_config
from llm_astar_planner.planning.plan_reuse import CachedWaypointSource
from llm_astar_planner.planning.planner import Planner

NAME = 'planner_node'
# Callers served at a time; more wait their turn. Waiting for waypoints takes a thread, no core.
CALLERS = 16
# The other threads are for maps, goals of RViz and of Nav2, parameters and instructions.
THREADS = CALLERS + 8
READY_SECONDS = 0.1
INTROSPECTION_STATES = {
    'disabled': ServiceIntrospectionState.OFF,
    'metadata': ServiceIntrospectionState.METADATA,
    'contents': ServiceIntrospectionState.CONTENTS,
}


class PlannerServer:
    """What the node does between configure and cleanup: its parts, and its topics and services.

    Goals are answered while it is active and refused with the reason otherwise; maps are taken
    in both states.
    """

    def __init__(self, node: Node, settings: Parameters, places: PlacesParameter) -> None:
        """Join the graph, not active yet."""
        self._node = node
        self._settings = settings
        self._entities = entities = Entities(node)
        self._goals = PreemptingGoalSlot()
        self._bond: Bond | None = None
        self._initial_pose: PoseStamped | None = None
        self._cache: CachedWaypointSource | None = None
        self._places = PlacesServer(entities, places)
        self._instructions = InstructionServer(
            entities, settings, lambda: self._places.places, self.on_understood
        )
        self._client = self.make_client()
        self._cache = CachedWaypointSource(self._client) if self._client else None
        frames = self.make_frames()
        self._maps = MapManager(
            node.get_logger(), lambda: costmap_config(settings.values()), self.on_planner
        )
        replans = PreemptingGoalSlot()
        self._publisher = PlanPublisher(entities)
        self._handler = RequestHandler(
            node,
            settings,
            self._maps,
            RequestConverter(settings, frames, self._cache),
            publisher=self._publisher,
            replans=replans,
            instructions=self._instructions,
        )
        self._monitor = PathMonitor(
            node, settings, self._maps, self._handler, replans=replans, cache=self._cache
        )
        self._diagnostics = DiagnosticsPublisher(entities, self.state)
        # Last of all: the executor may call back at once.
        self._instructions.start()
        self.subscribe()
        validity = PathValidityService(frames, lambda: str(settings['robot_base_frame']))
        has_nav2 = serve_nav2(entities, self, validity, lambda: self._maps.planner)
        served = 'with' if has_nav2 else 'without nav2_msgs, so without'
        node.get_logger().info(f"{served} Nav2's planner actions")
        self.subscribe_to_maps()

    @property
    def is_active(self) -> bool:
        """Whether goals are answered."""
        return self._handler.is_active

    def activate(self) -> None:
        """Answer goals from now on, bound to a lifecycle manager."""
        self._handler.activate()
        self._bond = make_bond(self._node, self._settings['bond_heartbeat_period'])

    def deactivate(self) -> None:
        """Refuse goals from now on; cancel what is being planned."""
        self._handler.deactivate('the node was deactivated')
        # The path must not be replanned when the node is activated again.
        self._monitor.forget()
        if self._bond is not None:
            self._bond.close()
            self._bond = None

    def close(self) -> None:
        """Cancel what is being planned, and leave the graph."""
        self.deactivate()
        self._maps.close()
        self._monitor.close()
        self._entities.close()

    def answer_goal(
        self,
        goal: PlanGoal,
        token: CancellationToken | None = None,
        on_better: Callable[[], None] | None = None,
    ) -> PlanResponse:
        """Plan, publish and watch the path; never raises. See RequestHandler.answer."""
        response = self._handler.answer(goal, token, on_better)
        self._monitor.watch(response)
        return response

    def on_get_plan(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        """Answer `~/get_plan`."""
        goal = PlanGoal((request.goal,), request.start, float(request.tolerance))
        response.plan = self.answer_goal(goal).path
        return response

    def on_goal_pose(self, message: PoseStamped) -> None:
        """Plan to the goal that was set in RViz; a newer one preempts it."""
        token = self._goals.begin('a newer goal came')
        self.answer_goal(PlanGoal((message,), fallback_start=self._initial_pose), token)

    def on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Keep the pose that was set in RViz as the start if tf does not know the robot's."""
        self._initial_pose = PoseStamped(header=message.header, pose=message.pose.pose)

    def on_goal_place(self, message: String) -> None:
        """Plan to the place of this name, as to a goal that was set in RViz."""
        try:
            pose = self._places.goal_pose(message.data)
        except PlaceGoalError as error:
            self._node.get_logger().error(f'goal_place: {error}')
            return
        self.on_goal_pose(pose)

    def on_parameters(self, _: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Follow changed parameters."""
        self._places.refresh()
        self._instructions.refresh()
        self._maps.refresh()

    def on_planner(self, planner: Planner) -> None:
        """Check the last path on a new map."""
        message = f'planning on {self._maps.name}'
        self._node.get_logger().info(message, throttle_duration_sec=QUIET_SECONDS)
        self._diagnostics.publish()
        self._places.on_planner(planner)
        self._monitor.check(planner)

    def on_understood(self) -> None:
        """Replan the last path if new maps do, as something else is asked of it now."""
        planner = self._maps.planner
        if planner is not None and self._settings['replan_on_map']:
            self._monitor.check(planner, 'the instruction has changed')

    def make_client(self) -> WaypointClient | None:
        """Return the client of the waypoint node, None if no node is to be asked."""
        name = self._settings['llm_client']
        if not name:
            return None
        client = WaypointClient(self._node, name, self.on_client_change)
        self._entities.on_close(client.close)
        return client

    def on_client_change(self) -> None:
        """Drop the client's answers: it may answer differently from now on."""
        self._instructions.on_client_change()
        if self._cache is not None:
            self._cache.clear()

    def make_frames(self) -> Frames:
        """Return the transforms, empty without tf2_ros."""
        if not HAS_TF2:
            return Frames(None)
        listener = TransformListener(self._node)
        self._entities.on_close(listener.close)
        return Frames(listener.buffer)

    def subscribe(self) -> None:
        """Serve and subscribe."""
        # A newer goal must get through while one is planned for.
        group, node = ReentrantCallbackGroup(), self._node
        callers = LimitedCallbackGroup(CALLERS)
        service = self._entities.service(GetPlan, '~/get_plan', self.on_get_plan, callers)
        state = INTROSPECTION_STATES[self._settings['introspection_mode']]
        service.configure_introspection(node.get_clock(), RELIABLE, state)
        for kind, topic, callback in (
            (PoseWithCovarianceStamped, 'initialpose', self.on_initial_pose),
            (PoseStamped, 'goal_pose', self.on_goal_pose),
            (String, '~/goal_place', self.on_goal_place),
        ):
            self._entities.subscription(kind, topic, callback, RELIABLE, group)
        node.add_post_set_parameters_callback(self.on_parameters)
        self._entities.on_close(
            lambda: node.remove_post_set_parameters_callback(self.on_parameters)
        )

    def subscribe_to_maps(self) -> None:
        """Take maps on a thread of their own: requests that came later must not overtake them."""
        node = side_node(self._node, 'maps')
        thread = SpinThread(node)
        self._entities.on_close(node.destroy_node)
        self._entities.on_close(thread.close)
        MapSubscription(Entities(node), self._maps.take, self._node, self._maps.arrivals.note)
        thread.start()

    def state(self) -> tuple[bool, str, dict[str, Any]]:
        """Return what /diagnostics says."""
        planner, age = self._maps.planner, self._maps.age
        values = {
            'active': self.is_active,
            'map_digest': planner.grid_map.digest if planner else None,
            'map_age': None if age is None else round(age, 3),
            'llm_client_ready': self._client is not None and self._client.ready,
            'last_path': self._monitor.state,
            **{name: round(value, 3) for name, value in self._maps.landmark_statistics().items()},
            **self._instructions.values(),
            **self._publisher.statistics.values(),
        }
        overdue = self._maps.arrivals.warnings()
        is_well = planner is not None and self.is_active and not overdue
        state = 'planning' if self.is_active else 'not active'
        return is_well, '; '.join((f'{state} on {self._maps.name}', *overdue)), values


class PlannerNode(LifecycleNodeMixin, Node):
    """A lifecycle node: configure joins the graph, activate answers goals.

    It configures and activates itself unless the parameter `autostart` is false. Its topics,
    services and parameters are in docs/reference.md.
    """

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Compile the searches, declare the parameters, and start or wait to be configured."""
        # Before the services are there: a lifecycle manager waits for these first.
        compile_kernels()
        Node.__init__(self, NAME, **node_options)
        # Setting a parameter may take as long as a large map does; a manager waits two seconds.
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self.on_change_state
        self._settings = Parameters(self, NAME)
        self._places = PlacesParameter(self, self._settings)
        self._server: PlannerServer | None = None
        if not self._settings['autostart']:
            self.get_logger().info('ready to be configured')
            return
        if self.trigger_configure() is not TransitionCallbackReturn.SUCCESS:
            raise ParameterError('planner_node could not be configured: see the log')
        self.trigger_activate()
        # Said when the executor runs: before that, rclpy may abort at two signals in a row.
        self._ready_timer = self.create_timer(READY_SECONDS, self.on_ready)

    def on_ready(self) -> None:
        """Log once that the node is ready."""
        self.destroy_timer(self._ready_timer)
        self.get_logger().info('ready; waiting for a map')

    def destroy_node(self) -> None:
        """Leave the graph, in whatever state."""
        self.close()
        super().destroy_node()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Join the graph; maps are taken from here on."""
        try:
            self._server = PlannerServer(self, self._settings, self._places)
        except Exception as error:  # noqa: BLE001 - the manager is told, and may try again
            self.get_logger().error(f'not configured: {type(error).__name__}: {error}')
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer goals."""
        if self._server is not None:
            self._server.activate()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cancel what is being planned, and refuse goals."""
        if self._server is not None:
            self._server.deactivate()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph, to be configured again."""
        self.close()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph for good."""
        self.close()
        return super().on_shutdown(state)

    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Leave the graph, ready to be configured again."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

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
        if self._server is not None:
            self._server.close()
            self._server = None


def main(args: Sequence[str] | None = None) -> int:
    """Run planner_node."""
    return run_node(PlannerNode, args, lambda: MultiThreadedExecutor(num_threads=THREADS))


if __name__ == '__main__':
    raise SystemExit(main())
