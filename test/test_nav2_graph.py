"""Nav2's own interface to a planner, with the real messages where they are installed."""

import contextlib
import importlib.util
import sys
import threading

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from graph_tools import PATIENCE, calling, running, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import (
    path_from_message,
    pose_from_message,
    stamp_of,
)
from llm_astar_msgs_adapter.messages.writing import (
    grid_to_message,
    path_to_message,
    pose_to_message,
)
from llm_astar_planner.nodes.common.entities import LATCHED
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetPlan
from rclpy.action import ActionClient
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter

actions = pytest.importorskip('nav2_msgs.action', reason='nav2_msgs is not installed')
services = pytest.importorskip('nav2_msgs.srv', reason='nav2_msgs is not installed')
needs_tf2 = pytest.mark.skipif(
    importlib.util.find_spec('tf2_ros') is None, reason='tf2_ros is not installed'
)

SPACE = '/nav2'
LONG = 60.0
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
START, GOAL = Pose2D(5.5, 5.5), Pose2D(35.5, 5.5, 1.0)
# Rounds of goals that are sent back to back, and how each may end: status and code.
ROUNDS, ROWS = 10, [5.5 + row for row in range(8)]
ENDED = {(SUCCEEDED, 0), (ABORTED, 0)}
CELLS = np.zeros((30, 40), dtype=np.int8)
CELLS[:25, 20] = 100


class HangingClient(Node):
    """A waypoint client that answers when it is told to."""

    def __init__(self):
        super().__init__('llm_client_node', namespace=SPACE)
        self.asked = threading.Event()
        self.go = threading.Event()
        self.create_service(
            GetPlan, '~/get_waypoints', self._answer, callback_group=ReentrantCallbackGroup()
        )

    def _answer(self, request, response):
        self.asked.set()
        self.go.wait(LONG)
        return response

    def destroy_node(self):
        self.go.set()
        super().destroy_node()


class Graph:
    """The actions as a behaviour tree sees them."""

    def __init__(self, caller):
        self.node, self.caller = caller.node, caller
        self.feedback = []
        self.to = ActionClient(self.node, actions.ComputePathToPose, 'compute_path_to_pose')
        self.through = ActionClient(
            self.node, actions.ComputePathThroughPoses, 'compute_path_through_poses'
        )

    def close(self):
        self.to.destroy()
        self.through.destroy()

    def send(self, action, goal):
        """Send a goal; return its handle."""
        return self.call(action.send_goal_async, goal, self.feedback.append)

    def call(self, function, *arguments):
        """Call where the node is spun: rclpy loses what is answered before a call has returned."""
        task = self.node.executor.create_task(function, *arguments)
        wait_for(task.done, 'the call')
        future = task.result()
        wait_for(future.done, 'an answer')
        return future.result()

    def result(self, handle):
        answer = self.call(handle.get_result_async)
        return answer.status, answer.result

    def ask(self, action, goal):
        return self.result(self.send(action, goal))


def pose(place, frame='map'):
    return pose_to_message(place, frame, Time())


def to_pose(goal=GOAL, start=START, frame='map', **fields):
    return actions.ComputePathToPose.Goal(
        goal=pose(goal, frame), start=pose(start, frame), **({'use_start': True} | fields)
    )


def through_poses(*goals, **fields):
    goal = actions.ComputePathThroughPoses.Goal(start=pose(START), use_start=True, **fields)
    poses = [pose(place) for place in goals]
    if hasattr(goal.goals, 'goals'):
        goal.goals.goals = poses
    else:
        goal.goals = poses
    return goal


@pytest.fixture(scope='module')
def graph():
    rclpy.init()
    overrides = {
        'max_planning_time': LONG,
        'source_timeout': LONG,
        'search_while_waiting': False,
        'use_waypoints': False,
    }
    planner = PlannerNode(
        namespace=SPACE,
        parameter_overrides=[Parameter(name, value=value) for name, value in overrides.items()],
    )
    client = HangingClient()
    with running(planner, client), calling(SPACE) as caller:
        made = Graph(caller)
        made.planner, made.client = planner, client
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        maps.publish(grid_to_message(GridMap(CELLS), Time()))
        caller.wait_until_ready(GridMap(CELLS).digest)
        for action in (made.to, made.through):
            assert action.wait_for_server(PATIENCE)
        yield made
        made.close()
    rclpy.try_shutdown()


@contextlib.contextmanager
def waiting(graph):
    """Have the planner wait for waypoints that do not come."""
    graph.client.asked.clear()
    graph.client.go.clear()
    graph.planner.set_parameters([Parameter('use_waypoints', value=True)])
    try:
        yield
    finally:
        graph.planner.set_parameters([Parameter('use_waypoints', value=False)])
        graph.client.go.set()


def test_a_path_to_a_pose_with_a_planning_time_and_without_feedback(graph):
    graph.feedback.clear()
    status, result = graph.ask(graph.to, to_pose())
    assert (status, result.error_code) == (SUCCEEDED, actions.ComputePathToPose.Result.NONE)
    points = path_from_message(result.path)
    assert points[0] == pytest.approx(START[:2])
    assert points[-1] == pytest.approx(GOAL[:2])
    assert result.path.header.frame_id == 'map'
    assert result.planning_time.sec + result.planning_time.nanosec > 0
    assert not graph.feedback


def test_a_path_through_poses_passes_each_in_turn(graph):
    places = [(5.5, 25.5), (15.5, 2.5), (35.5, 20.5)]
    status, result = graph.ask(graph.through, through_poses(*(Pose2D(*at) for at in places)))
    assert (status, result.error_code) == (SUCCEEDED, 0)
    points = path_from_message(result.path).tolist()
    indices = [points.index(list(place)) for place in places]
    assert indices == sorted(indices)
    assert indices[-1] == len(points) - 1


def ends_of(result):
    poses = [pose_from_message(stamped.pose) for stamped in result.path.poses]
    return poses[0], poses[-1], len(poses)


def test_a_path_begins_and_ends_at_the_exact_poses_and_is_valid(graph):
    start, goal = Pose2D(5.9, 5.2, 2.0), Pose2D(35.1, 5.8, -1.0)
    status, result = graph.ask(graph.to, to_pose(goal, start))
    assert status == SUCCEEDED
    first, last, _ = ends_of(result)
    assert (first, last) == (pytest.approx(start), pytest.approx(goal))
    client = graph.node.create_client(services.IsPathValid, 'is_path_valid')
    response = graph.caller.ask(client, services.IsPathValid.Request(path=result.path))
    assert (response.is_valid, list(response.invalid_pose_indices)) == (True, [])


def test_start_and_goal_in_one_cell_give_what_navfn_gives(graph):
    start, goal = Pose2D(5.9, 5.2, 2.0), Pose2D(5.1, 5.8, -1.0)
    _, result = graph.ask(graph.to, to_pose(goal, start))
    assert ends_of(result) == (pytest.approx(start), pytest.approx(goal), 2)
    turned = Pose2D(5.9, 5.2, -1.0)
    _, result = graph.ask(graph.to, to_pose(turned, start))
    assert ends_of(result) == (pytest.approx(turned), pytest.approx(turned), 1)
    name = 'use_final_approach_orientation'
    graph.planner.set_parameters([Parameter(name, value=True)])
    _, result = graph.ask(graph.to, to_pose(turned, start))
    graph.planner.set_parameters([Parameter(name, value=False)])
    assert ends_of(result) == (pytest.approx(start), pytest.approx(start), 1)


def test_a_robot_inside_the_marks_of_an_obstacle_plans_its_way_out(graph):
    start = Pose2D(20.5, 5.5)
    graph.planner.set_parameters([Parameter('start_tolerance', value=1.0)])
    status, result = graph.ask(graph.to, to_pose(start=start))
    graph.planner.set_parameters([Parameter('start_tolerance', value=0.25)])
    assert status == SUCCEEDED
    own, free = path_from_message(result.path)[:2]
    assert own == pytest.approx(start[:2])
    assert np.hypot(*(free - own)) == pytest.approx(1.0)


def test_a_thousand_poses_are_passed(graph):
    rng = np.random.default_rng(4)
    places = rng.permutation(np.argwhere(CELLS == 0))[:1000].tolist()
    goals = [Pose2D(x + 0.5, y + 0.5) for y, x in places]
    status, result = graph.ask(graph.through, through_poses(*goals))
    assert status == SUCCEEDED
    passed = {tuple(point) for point in path_from_message(result.path).tolist()}
    assert passed >= {goal[:2] for goal in goals}


@pytest.mark.parametrize(
    ('goal', 'name'),
    [
        (to_pose(planner_id='SmacHybrid'), 'INVALID_PLANNER'),
        (to_pose(frame='nowhere'), 'TF_ERROR'),
        (to_pose(use_start=False), 'TF_ERROR'),
        (to_pose(start=Pose2D(-9.0, 3.0)), 'START_OUTSIDE_MAP'),
        (to_pose(goal=Pose2D(99.0, 3.0)), 'GOAL_OUTSIDE_MAP'),
        (to_pose(start=Pose2D(20.5, 5.5)), 'NO_VALID_PATH'),
        (to_pose(goal=Pose2D(20.5, 5.5)), 'NO_VALID_PATH'),
        (to_pose(frame=''), 'TF_ERROR'),
        (to_pose(goal=Pose2D(float('nan'), 5.5)), 'GOAL_OUTSIDE_MAP'),
    ],
)
def test_each_failure_of_a_path_to_a_pose_has_its_code_and_a_sentence(graph, goal, name):
    status, result = graph.ask(graph.to, goal)
    assert (status, len(result.path.poses)) == (ABORTED, 0)
    assert result.error_code == getattr(actions.ComputePathToPose.Result, name)
    if hasattr(result, 'error_msg'):
        assert len(result.error_msg) > 10


@pytest.mark.parametrize(
    ('goal', 'name'),
    [
        (through_poses(), 'NO_VIAPOINTS_GIVEN'),
        (through_poses(GOAL, planner_id='SmacHybrid'), 'INVALID_PLANNER'),
        (through_poses(Pose2D(99.0, 3.0), GOAL), 'GOAL_OUTSIDE_MAP'),
        (through_poses(Pose2D(20.5, 5.5), GOAL), 'NO_VALID_PATH'),
    ],
)
def test_each_failure_through_poses_has_that_actions_own_code(graph, goal, name):
    status, result = graph.ask(graph.through, goal)
    assert status == ABORTED
    assert result.error_code == getattr(actions.ComputePathThroughPoses.Result, name)
    assert 300 < result.error_code < 310


@pytest.mark.skipif(
    not hasattr(actions.ComputePathToPose.Goal(), 'viapoints'), reason='Nav2 is older than that'
)
def test_viapoints_take_the_waypoints_place_and_a_newer_result_says_how_far_it_got(graph):
    with waiting(graph):
        viapoints = [pose(Pose2D(15.5, 27.5)), pose(Pose2D(20.5, 10.5))]
        status, result = graph.ask(graph.to, to_pose(viapoints=viapoints))
        assert (status, result.error_code) == (SUCCEEDED, 0)
        assert not graph.client.asked.is_set()
    stamp = stamp_of(result.path)
    graph.caller.wait_for(lambda: stamp in graph.caller._reports, 'the report', PATIENCE)
    _, report = graph.caller._reports.pop(stamp)
    assert report.source == 'viapoints'
    # The second one is in the wall, with no other cell within the tolerance.
    assert report.source_detail.startswith('1 of 2 via points can be reached; not within 0.5 m')
    assert report.guided_by == 'viapoints'
    assert graph.ask(graph.through, through_poses(GOAL))[1].last_reached_index == -1


def test_a_canceled_goal_ends_although_no_waypoints_come(graph):
    with waiting(graph):
        handle = graph.send(graph.to, to_pose(goal=Pose2D(34.5, 6.5)))
        assert graph.client.asked.wait(PATIENCE)
        graph.call(handle.cancel_goal_async)
        status, result = graph.result(handle)
    assert status == CANCELED
    assert len(result.path.poses) == 0


def test_a_newer_goal_preempts_the_one_before(graph):
    with waiting(graph):
        older = graph.send(graph.to, to_pose(goal=Pose2D(34.5, 7.5)))
        assert graph.client.asked.wait(PATIENCE)
        graph.planner.set_parameters([Parameter('use_waypoints', value=False)])
        newer = graph.send(graph.to, to_pose(goal=Pose2D(34.5, 8.5)))
        status, result = graph.result(older)
        assert graph.result(newer)[0] == SUCCEEDED
    assert (status, result.error_code) == (ABORTED, actions.ComputePathToPose.Result.NONE)
    if hasattr(result, 'error_msg'):
        assert 'a newer goal came' in result.error_msg


def test_of_goals_sent_back_to_back_the_last_survives(graph, monkeypatch):
    """In the order in which they were sent, even if threads change as often as they can."""
    begun = []
    execute, interval = ServerGoalHandle.execute, sys.getswitchinterval()

    def noted(handle):
        begun.append(handle.request.goal.pose.position.y)
        execute(handle)

    def send():
        goals = [to_pose(goal=Pose2D(34.5, y)) for y in ROWS]
        return [graph.to.send_goal_async(goal) for goal in goals]

    monkeypatch.setattr(ServerGoalHandle, 'execute', noted)
    sys.setswitchinterval(1e-6)
    try:
        for _ in range(ROUNDS):
            task = graph.node.executor.create_task(send)
            wait_for(task.done, 'the goals to be sent')
            for sent in task.result():
                wait_for(sent.done, 'the goals to be accepted')
            results = [graph.result(sent.result()) for sent in task.result()]
            assert begun == ROWS
            assert results[-1][0] == SUCCEEDED
            assert {(status, result.error_code) for status, result in results} <= ENDED
            begun.clear()
    finally:
        sys.setswitchinterval(interval)


def test_is_path_valid_tells_which_poses_are_not(graph):
    client = graph.node.create_client(services.IsPathValid, 'is_path_valid')
    for points, invalid in (
        ([(4.5, 5.5), (5.5, 5.5)], []),
        ([(19.5, 5.5), (20.5, 5.5), (21.5, 5.5)], [1]),
        ([(4.5, 5.5), (34.5, 5.5)], [1]),
    ):
        path = path_to_message(points, 'map', Time())
        response = graph.caller.ask(client, services.IsPathValid.Request(path=path))
        assert response.is_valid == (not invalid)
        assert list(response.invalid_pose_indices) == invalid


@needs_tf2
def test_the_robots_pose_and_poses_of_other_frames_come_through_tf2(graph):
    messages = pytest.importorskip('tf2_msgs.msg')
    publisher = graph.node.create_publisher(messages.TFMessage, '/tf_static', LATCHED)
    transforms = []
    for parent, child, x, y in (('map', 'odom', 3.0, 1.0), ('odom', 'base_link', 2.5, 4.5)):
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id = parent
        transform.transform.translation.x, transform.transform.translation.y = x, y
        transforms.append(transform)
    publisher.publish(messages.TFMessage(transforms=transforms))
    goal = to_pose(goal=Pose2D(32.5, 4.5, 1.0), frame='odom', use_start=False)

    def is_known():
        status, result = graph.ask(graph.to, goal)
        ends = path_from_message(result.path)[[0, -1]].tolist() if status == SUCCEEDED else None
        return ends == [[5.5, 5.5], [35.5, 5.5]]

    wait_for(is_known, 'the transforms')


def test_a_managed_node_rejects_goals_until_it_is_active(graph):
    node = PlannerNode(
        namespace='/managed_nav2', parameter_overrides=[Parameter('autostart', value=False)]
    )
    with running(node), calling('/managed_nav2') as caller:
        managed = Graph(caller)
        node.trigger_configure()
        assert managed.to.wait_for_server(PATIENCE)
        rejected = managed.send(managed.to, to_pose())
        node.trigger_activate()
        status, result = managed.ask(managed.to, to_pose())
        managed.close()
    assert not rejected.accepted
    assert (status, result.error_code) == (ABORTED, 207)
    if hasattr(result, 'error_msg'):
        assert 'no map' in result.error_msg
