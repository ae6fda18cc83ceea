# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The parts of planner_node that plan, and the topics that go with them.

Importing them takes a second, so planner_node does it after its first services are there.
"""

from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from llm_astar_planner.nodes.common.bond import Bond, make_bond
from llm_astar_planner.nodes.common.entities import RELIABLE, Entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.spin import SpinThread, side_node
from llm_astar_planner.nodes.common.tf import listen
from llm_astar_planner.nodes.planner import goals
from llm_astar_planner.nodes.planner.instruction_server import InstructionServer
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.path_monitor import PathMonitor
from llm_astar_planner.nodes.planner.path_validity import PathValidityService
from llm_astar_planner.nodes.planner.places_server import PlacesServer
from llm_astar_planner.nodes.planner.publishers import DiagnosticsPublisher, PlanPublisher
from llm_astar_planner.nodes.planner.request_handler import RequestConverter, RequestHandler
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.nodes.planner.waypoint_client import WaypointClient
from llm_astar_planner.nodes.planner.zone_server import MaskSubscription, ZoneServer
from llm_astar_planner.planning.compile import KernelCompiler
from llm_astar_planner.planning.parameters import costmap_config, request_fields
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest


class PlannerServer:
    """What the node does between configure and cleanup: its parts, and its topics and services.

    Goals are answered while it is active and refused with the reason otherwise; maps are taken
    in both states. Those that come while the searches are being compiled wait for it.
    """

    def __init__(self, node: Node, settings: Parameters, goal_handler: goals.GoalHandler) -> None:
        """Join the graph, not active yet; `goal_handler` answers the goals of RViz."""
        self._node = node
        self._goal_handler = goal_handler
        self._settings = settings
        self._entities = entities = Entities(node)
        self._goals = goals.PreemptingGoalSlot()
        self._bond: Bond | None = None
        self._initial_pose: PoseStamped | None = None
        self._places = PlacesServer(entities, settings)
        side = side_node(node, 'maps')
        entities.on_close(side.destroy_node)
        self._instructions = InstructionServer(
            entities, side, settings, lambda: self._places.places, self.on_understood,
            self.answer_question,
        )  # fmt: skip
        name = settings['llm_client']
        self._client = WaypointClient(entities, name, self.on_client_change) if name else None
        compiler = self.make_compiler()
        frames = listen(entities)
        self._maps = MapManager(
            node.get_logger(), lambda: costmap_config(settings.values()), self.on_planner, compiler
        )
        self._zones = ZoneServer(entities, side, settings, frames, self._maps.take)
        self._footprint = RobotFootprint(entities, settings, frames, self.on_footprint)
        replans = goals.PreemptingGoalSlot()
        self._publisher = PlanPublisher(entities, replans)
        cache = self._client.cache if self._client else None
        self.monitor = PathMonitor(
            node.get_logger(), settings, self._maps, replans, cache, self._footprint
        )
        self.handler = RequestHandler(
            node=node,
            settings=settings,
            maps=self._maps,
            converter=RequestConverter(settings, frames, self._client, self._footprint),
            compiler=compiler,
            publisher=self._publisher,
            instructions=self._instructions,
            monitor=self.monitor,
        )
        self.monitor.start(self.handler)
        self._diagnostics = DiagnosticsPublisher(entities, self.state)
        # Last of all: the executor may call back at once.
        self._instructions.start()
        self.subscribe()
        newest = self._maps.newest_arrived
        PathValidityService(entities, settings, frames, newest, self._footprint)
        self._footprint.subscribe(side)
        self.subscribe_to_maps(side)

    def activate(self) -> None:
        """Answer goals from now on, bound to a lifecycle manager."""
        self.handler.activate()
        self._bond = make_bond(self._node, self._settings['bond_heartbeat_period'])

    def deactivate(self) -> None:
        """Refuse goals from now on; cancel what is being planned."""
        self.handler.deactivate('the node was deactivated')
        # The path must not be replanned when the node is activated again.
        self.monitor.tasks.put(self.monitor.forget)
        if self._bond is not None:
            self._bond.close()
            self._bond = None

    def close(self) -> None:
        """Cancel what is being planned, and leave the graph."""
        self.deactivate()
        self._maps.close()
        self.monitor.close()
        self._entities.close()

    def on_goal_pose(self, message: PoseStamped) -> None:
        """Plan to the goal that was set in RViz; a newer one preempts it."""
        token = self._goals.begin('a newer goal came')
        goal = goals.PlanGoal(
            (message,), fallback_start=self._initial_pose, client=goals.GOAL_POSE
        )
        # Poses are taken one at a time, in their order, so the planning is left to another thread.
        self._node.executor.create_task(self._goal_handler.answer, goal, token)

    def on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Keep the pose that was set in RViz as the start if tf does not know the robot's."""
        self._initial_pose = PoseStamped(header=message.header, pose=message.pose.pose)

    def on_parameters(self, _: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Follow changed parameters."""
        self._places.refresh()
        self._instructions.refresh()
        self._zones.refresh()
        self._footprint.refresh()
        self._maps.refresh()

    def on_planner(self, planner: Planner) -> None:
        """Check the last path on a new map."""
        if not self._node.context.ok():  # the process ends
            return
        self._diagnostics.publish()
        self._places.on_planner(planner)
        self.monitor.check(planner)

    def on_understood(self) -> None:
        """Replan the last path if new maps do, as something else is asked of it now."""
        if self._settings['replan_on_map']:
            self.monitor.check_again('the instruction has changed')

    def on_footprint(self) -> None:
        """Check the last path for a footprint that has changed."""
        self.monitor.check_again('the footprint has changed')

    def answer_question(self, text: str) -> str:
        """Return the answer to a question about the last plan. Raises QuestionError."""
        return self.handler.answer_question(text, self._places.places)

    def make_compiler(self) -> KernelCompiler:
        """Return what compiles the searches, at first those under the present settings."""
        settings = self._settings.current
        source = self._client if settings['use_waypoints'] else None
        compiler = KernelCompiler(
            costmap_config(settings),
            PlanRequest((0, 0), (0, 0), source=source, **request_fields(settings)),
            self._node.get_logger().info,
        )
        self._entities.on_close(compiler.close)
        return compiler

    def on_client_change(self) -> None:
        """Drop the client's answers: it may answer differently from now on."""
        self._instructions.on_client_change()
        if self._client is not None:
            self._client.cache.clear()

    def subscribe(self) -> None:
        """Subscribe."""
        # One at a time: the newest pose must not be preempted by the one before.
        group, node, entities = MutuallyExclusiveCallbackGroup(), self._node, self._entities
        initial, goal = self.on_initial_pose, self.on_goal_pose
        entities.subscription(PoseWithCovarianceStamped, 'initialpose', initial, RELIABLE, group)
        entities.subscription(PoseStamped, goals.GOAL_POSE, goal, RELIABLE, group)
        node.add_post_set_parameters_callback(self.on_parameters)
        entities.on_close(lambda: node.remove_post_set_parameters_callback(self.on_parameters))

    def subscribe_to_maps(self, node: Node) -> None:
        """Take maps and zones on a thread of their own, that of a node beside this one.

        Requests that came later must not overtake them.
        """
        topic = self._settings['filter_info_topic']
        MaskSubscription(node, self._node, topic, lambda masks: self._zones.use(masks=masks))
        MapSubscription(Entities(node), self._zones.take, self._node)
        self._entities.on_close(SpinThread(node).close)

    def state(self) -> tuple[bool, str, dict[str, Any]]:
        """Return what /diagnostics says."""
        planner, age = self._maps.planner, self._maps.age
        values = {
            'active': self.handler.is_active,
            'map_digest': planner.grid_map.digest if planner else None,
            'map_age': None if age is None else round(age, 3),
            'llm_client_ready': self._client is not None and self._client.service_is_ready(),
            'last_path': self.monitor.state,
            **self._footprint.values(),
            **self._maps.landmarks.values(),
            **self._instructions.values(),
            **self._zones.values(),
        }
        overdue = self._maps.arrivals.warnings()
        is_well = planner is not None and self.handler.is_active and not overdue
        state = 'planning' if self.handler.is_active else 'not active'
        return is_well, '; '.join((f'{state} on {self._maps.name}', *overdue)), values
