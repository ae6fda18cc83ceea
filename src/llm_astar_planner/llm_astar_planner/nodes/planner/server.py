"""All of planner_node but the node itself: its parts, wired to the topics and services of one."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.node import Node
from std_msgs.msg import String

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.map_subscription import MapListener
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.qos import RELIABLE
from llm_astar_planner.nodes.common.tf import HAS_TF2, Frames, TransformListener
from llm_astar_planner.nodes.planner.diagnostics import Health
from llm_astar_planner.nodes.planner.instruction import take_instruction
from llm_astar_planner.nodes.planner.introspection import introspect
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.nav2_server import PathCheck, serve_nav2
from llm_astar_planner.nodes.planner.path_monitor import QUIET_SECONDS, PathMonitor
from llm_astar_planner.nodes.planner.preemption import PreemptingGoalSlot
from llm_astar_planner.nodes.planner.publishers import PlanPublisher
from llm_astar_planner.nodes.planner.request_conversion import PlanGoal, RequestConverter
from llm_astar_planner.nodes.planner.request_handler import RequestHandler
from llm_astar_planner.nodes.planner.waypoint_client import WaypointClient
from llm_astar_planner.planning.parameters import costmap_config
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.recall import Recall

NEWER_GOAL = 'a newer goal came'


class PlannerServer:
    """Answers GetPlan, RViz's buttons and Nav2, on a node that somebody else spins.

    Questions are answered while it is active and told why not otherwise; maps are taken either
    way. `close` takes all of it out of the graph again.
    """

    def __init__(self, node: Node, settings: Parameters) -> None:
        """Join the graph, not active yet."""
        self._node = node
        self._settings = settings
        self._entities = entities = Entities(node)
        self._goals = PreemptingGoalSlot()
        self._initial: PoseStamped | None = None
        self._recall = Recall(settings['remember_plans'])
        self._source = self._make_source()
        frames = self._make_frames()
        self._maps = MapManager(
            node.get_logger(), lambda: costmap_config(settings.values()), self._on_planner
        )
        reader = RequestConverter(settings, frames, self._source)
        self._answering = RequestHandler(
            node,
            settings,
            self._maps,
            reader,
            recall=self._recall,
            announcer=PlanPublisher(entities),
        )
        self._answering.on_outdated = self._look_again
        self._revalidation = PathMonitor(node, settings, self._answering)
        # What a look at the last path would publish is out of date then.
        self._answering.on_publish = lambda: self._revalidation.give_up('a newer path came')
        self._health = Health(entities, self._state)
        # Last of all: whoever spins the node may call back at once.
        self._listen(PathCheck(frames, lambda: str(settings['robot_base_frame'])))
        MapListener(entities, self._maps.take)

    @property
    def is_active(self) -> bool:
        """Whether questions are answered."""
        return self._answering.is_active

    @is_active.setter
    def is_active(self, value: bool) -> None:
        """Begin to answer; or end, and give up what is being planned."""
        self._answering.is_active = value
        if not value:
            self._answering.give_up('the node was deactivated')
            # Nobody follows it any more: it must not be replanned once the node is active again.
            self._answering.standing = None

    def close(self) -> None:
        """Give up what is being planned, and leave the graph."""
        self.is_active = False
        self._maps.close()
        self._revalidation.close()
        self._entities.close()

    def _make_source(self) -> WaypointClient | None:
        client = self._settings['llm_client']
        if not client:
            return None
        source = WaypointClient(self._node, client, self._recall.forget)
        self._entities.on_close(source.close)
        return source

    def _make_frames(self) -> Frames:
        if not HAS_TF2:
            return Frames(None)
        listener = TransformListener(self._node)
        self._entities.on_close(listener.close)
        return Frames(listener.buffer)

    def _listen(self, check: PathCheck) -> None:
        # Any number of callers at a time; a newer goal must get through while one is planned for.
        group = ReentrantCallbackGroup()
        service = self._entities.service(GetPlan, '~/get_plan', self._on_get_plan, group)
        introspect(self._node, service, self._settings['introspection_mode'])
        self._entities.subscription(
            PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, RELIABLE, group
        )
        self._entities.subscription(PoseStamped, 'goal_pose', self._on_goal_pose, RELIABLE, group)
        self._entities.subscription(
            String,
            '~/instruction',
            lambda message: take_instruction(self._node, message),
            RELIABLE,
            MutuallyExclusiveCallbackGroup(),
        )
        self._node.add_post_set_parameters_callback(self._on_parameters)
        self._entities.on_close(
            lambda: self._node.remove_post_set_parameters_callback(self._on_parameters)
        )
        has_nav2 = serve_nav2(self._entities, self._answering, check, lambda: self._maps.planner)
        served = 'with' if has_nav2 else 'without nav2_msgs, so without'
        self._node.get_logger().info(f"{served} Nav2's planner actions")

    def _on_parameters(self, _: Any) -> None:  # noqa: ANN401 - rclpy's own
        self._recall.resize(self._settings['remember_plans'])
        self._maps.refresh()

    def _on_planner(self, planner: Planner) -> None:
        self._node.get_logger().info(
            f'planning on {self._maps.name}', throttle_duration_sec=QUIET_SECONDS
        )
        self._health.publish()
        self._revalidation.look(planner)

    def _look_again(self) -> None:
        if self._maps.planner is not None:
            self._revalidation.look(self._maps.planner)

    def _on_get_plan(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        question = PlanGoal((request.goal,), request.start, float(request.tolerance))
        response.plan = self._answering.answer(question).path
        return response

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        self._initial = PoseStamped(header=message.header, pose=message.pose.pose)

    def _on_goal_pose(self, message: PoseStamped) -> None:
        cancel = self._goals.begin(NEWER_GOAL)
        self._answering.answer(PlanGoal((message,), fallback_start=self._initial), cancel)

    def _state(self) -> tuple[bool, str, dict[str, Any]]:
        """Return what /diagnostics tells."""
        planner, age = self._maps.planner, self._maps.age
        values = {
            'active': self.is_active,
            'map_digest': planner.grid_map.digest if planner else None,
            'map_age': None if age is None else round(age, 3),
            'llm_client_ready': self._source is not None and self._source.ready,
            'landmark_bytes': self._maps.landmark_bytes,
            'last_path': self._revalidation.last,
            'instruction': self._settings['instruction'],
            **self._answering.tally.values(),
        }
        is_well = planner is not None and self.is_active
        state = 'planning' if self.is_active else 'not active'
        return is_well, f'{state} on {self._maps.name}', values
