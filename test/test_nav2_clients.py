"""Nav2's own clients drive planner_node in planner_server's place.

The navigator of scripts, the lifecycle manager with its bonds, and the default behaviour trees.
"""

import contextlib
import time

import numpy as np
import pytest
import rclpy
from graph_tools import PATIENCE, calling, process, spinning
from lifecycle_msgs.msg import State
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_planner.resources import find_file
from rclpy.lifecycle import LifecycleNodeMixin, TransitionCallbackReturn
from rclpy.node import Node

stack = pytest.importorskip('nav2_stand_ins', exc_type=ImportError)
tree = pytest.importorskip('nav2_tree', exc_type=ImportError)
lifecycle = pytest.importorskip('nav2_lifecycle', exc_type=ImportError)
try:
    from nav2_simple_commander.robot_navigator import BasicNavigator
except ImportError:
    BasicNavigator = None

SPACE = '/stack'
NAV2 = str(find_file('nav2.yaml', 'config'))
REMAPS = [
    word
    for rule in (
        'map:=global_costmap/costmap',
        'map_updates:=global_costmap/costmap_updates',
        '/tf:=tf',
        '/tf_static:=tf_static',
    )
    for word in ('-r', rule)
]
ROBOT, GOAL, DOOR = (2.0, 3.0), (8.0, 3.0), (5.0, 3.0)
UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
RESULT = stack.ComputePathToPose.Result
# Nav2's default of 20 ms for an acknowledgement is for a computer that is not busy with tests.
SERVER_SECONDS = 5.0
WALLS = np.zeros((120, 200), dtype=bool)
WALLS[[0, -1]] = WALLS[:, [0, -1]] = True
WALLS[:, 100] = True
WALLS[50:70, 100] = False


def planner_process(namespace=SPACE):
    """Run planner_node as its page on Nav2 says, with the parameters made for that."""
    return process('planner_node', *REMAPS, namespace=namespace, files=(NAV2,))


@contextlib.contextmanager
def managing(*names, namespace=SPACE):
    """Make a lifecycle manager of these nodes and wait for their services."""
    manager = lifecycle.LifecycleManager(list(names), namespace=namespace)
    with spinning(manager):
        manager.connect()
        yield manager


class Stack:
    """A running stack: costmap, caller, manager, and planner_node as a process."""

    def __init__(self, costmap, caller, manager):
        self.costmap, self.caller, self.manager = costmap, caller, manager

    def show(self, period=1.0, *, updates=False, marks=(), come_back=False):
        """Publish a costmap with these marks (x, y, radius), and wait until it is planned on."""
        self.costmap.use(period, updates=updates)
        for mark in marks:
            self.costmap.mark(*mark, come_back=come_back)
        digest = self.costmap.grid_map.digest
        # Longer where the searches have to be compiled first.
        self.caller.wait_until_ready(digest, seconds=3.0 * PATIENCE)


@pytest.fixture(scope='module')
def running_stack():
    rclpy.init()
    costmap = stack.CostmapNode(WALLS, namespace=SPACE)
    robot = stack.RobotNode(*ROBOT, namespace=SPACE)
    with contextlib.ExitStack() as running:
        running.enter_context(spinning(costmap, robot))
        running.enter_context(planner_process())
        manager = running.enter_context(managing('planner_node'))
        caller = running.enter_context(calling(SPACE))
        assert manager.startup()
        yield Stack(costmap, caller, manager)
    rclpy.try_shutdown()


@pytest.fixture(params=['nav2_simple_commander', 'replay of its calls'])
def navigator(request, running_stack):
    if request.param == 'replay of its calls':
        made = stack.Navigator(namespace=SPACE)
    elif BasicNavigator is None:
        pytest.skip('nav2_simple_commander is not installed')
    else:
        made = BasicNavigator(namespace=SPACE)
    running_stack.show()
    yield made
    made.destroy_node()


def distance(first, second):
    return float(np.hypot(*(np.subtract(first, second))))


def test_the_navigator_gets_a_path_when_the_planner_is_active(navigator):
    navigator.waitUntilNav2Active(navigator='planner_node', localizer='robot_localization')
    path = navigator.getPath(stack.pose(*ROBOT), stack.pose(*GOAL, 0.5), 'GridBased')
    points = path_from_message(path)
    assert path.header.frame_id == 'map'
    assert distance(points[0], ROBOT) < 0.1
    assert distance(points[-1], GOAL) < 0.1
    assert distance(points[np.abs(points[:, 0] - 5.0).argmin()], DOOR) < 0.6
    assert path.poses[-1].pose.orientation.z == pytest.approx(np.sin(0.25))


def test_the_navigator_gets_a_path_through_poses(navigator):
    places = [(3.0, 1.0), (7.0, 5.0), GOAL]
    goals = [stack.pose(*place) for place in places]
    path = navigator.getPathThroughPoses(stack.pose(*ROBOT), goals, use_start=True)
    points = path_from_message(path)
    reached = [np.hypot(*(points - place).T).argmin() for place in places]
    assert reached == sorted(reached)
    assert all(distance(points[at], place) < 0.1 for at, place in zip(reached, places))


def test_the_navigator_gets_results_as_the_metrics_script_does(navigator):
    results = [
        navigator._getPathImpl(stack.pose(*ROBOT), stack.pose(*GOAL), name, use_start=True)
        for name in ('', 'GridBased')
    ]
    for result in results:
        assert result.error_code == RESULT.NONE
        assert len(result.path.poses) > 100
        assert result.planning_time.sec + result.planning_time.nanosec > 0


def test_the_navigator_gets_none_for_a_goal_off_the_map_and_for_an_unknown_planner(navigator):
    start = stack.pose(*ROBOT)
    assert navigator.getPath(start, stack.pose(20.0, 3.0)) is None
    assert navigator.getPath(start, stack.pose(*GOAL), 'SmacHybrid') is None
    assert navigator.getPath(start, stack.pose(*GOAL)) is not None


def test_the_navigator_gets_a_path_after_it_cleared_the_costmap(navigator, running_stack):
    running_stack.show(marks=[(*DOOR, 0.8)])
    start, goal = stack.pose(*ROBOT), stack.pose(*GOAL)
    assert navigator.getPath(start, goal) is None
    navigator.clearGlobalCostmap()
    assert navigator.getPath(start, goal) is not None


def test_a_goal_like_that_of_ros2_action_send_goal_gets_its_result(running_stack):
    running_stack.show()
    node = rclpy.create_node('send_goal', namespace=SPACE)
    kind = stack.ComputePathToPose
    client = rclpy.action.ActionClient(node, kind, f'{SPACE}/compute_path_to_pose')
    assert client.wait_for_server(PATIENCE)
    future = client.send_goal_async(kind.Goal(goal=stack.pose(*GOAL)), lambda _: None)
    rclpy.spin_until_future_complete(node, future, timeout_sec=PATIENCE)
    result = future.result().get_result_async()
    rclpy.spin_until_future_complete(node, result, timeout_sec=PATIENCE)
    assert result.result().status == stack.SUCCEEDED
    client.destroy()
    node.destroy_node()


@contextlib.contextmanager
def tree_client(*goals, follow=0.0):
    """Join the graph as bt_navigator, which follows a path for so many seconds."""
    client = tree.TreeClient([stack.pose(*goal) for goal in goals or [GOAL]], namespace=SPACE)
    client.follow = tree.StandIn(follow)
    try:
        yield client
    finally:
        client.destroy_node()


def navigate(client, kind=tree.ComputePath):
    return tree.run(tree.default_tree(client, kind, SERVER_SECONDS), PATIENCE)


COSTMAPS = [
    pytest.param({'period': 1.0, 'updates': False}, id='whole-at-1-Hz'),
    pytest.param({'period': 0.2, 'updates': True}, id='updates-at-5-Hz'),
]
# In each, NavFn with its tolerance of 0.5 m returns NO_VALID_PATH until the marks are cleared.
MARKS = [
    pytest.param((*GOAL, 0.7), id='goal-in-marks'),
    pytest.param((*ROBOT, 0.7), id='start-in-marks'),
    pytest.param((*DOOR, 0.8), id='goal-cut-off-by-marks'),
]


@pytest.mark.parametrize('costmap', COSTMAPS)
@pytest.mark.parametrize('mark', MARKS)
def test_a_tree_clears_the_costmap_and_has_a_path_with_the_retry(running_stack, costmap, mark):
    running_stack.show(**costmap, marks=[mark])
    with tree_client() as client:
        assert navigate(client) is tree.SUCCESS, client.answers
        assert client.codes == [RESULT.NO_VALID_PATH, RESULT.NONE], client.answers
        assert (client.clears, client.timeouts) == (1, 0)
        assert distance(path_from_message(client.blackboard['path'])[-1], GOAL) < 0.1


def test_a_tree_through_poses_clears_the_costmap_and_has_a_path_with_the_retry(running_stack):
    running_stack.show(marks=[(*DOOR, 0.8)])
    with tree_client((7.0, 1.0), GOAL) as client:
        assert navigate(client, tree.ComputePathThrough) is tree.SUCCESS, client.answers
        wanted = stack.ComputePathThroughPoses.Result.NO_VALID_PATH
        assert client.codes == [wanted, RESULT.NONE], client.answers


@pytest.mark.parametrize('place', [GOAL, ROBOT], ids=['goal', 'start'])
def test_a_tree_needs_no_recovery_where_marks_are_within_the_tolerance(running_stack, place):
    x, y = place
    running_stack.show(marks=[(x + 0.1, y, 0.02)])
    with tree_client() as client:
        assert navigate(client) is tree.SUCCESS, client.answers
        assert (client.codes, client.clears) == ([RESULT.NONE], 0), client.answers


def test_a_tree_recovers_six_times_before_it_gives_up_on_a_goal_in_an_obstacle(running_stack):
    running_stack.show(0.2, updates=True, marks=[(*GOAL, 0.7)], come_back=True)
    with tree_client() as client:
        assert navigate(client) is tree.FAILURE
        assert client.codes == [RESULT.NO_VALID_PATH] * 14, client.answers


def test_a_tree_gives_up_at_once_on_a_goal_off_the_map(running_stack):
    running_stack.show()
    with tree_client((20.0, 3.0)) as client:
        assert navigate(client) is tree.FAILURE
        assert client.codes == [RESULT.GOAL_OUTSIDE_MAP], client.answers
        assert client.clears == 0


def test_a_tree_replans_every_second_while_the_path_is_followed(running_stack):
    running_stack.show()
    with tree_client(follow=2.5) as client:
        assert navigate(client) is tree.SUCCESS, client.answers
        assert client.codes == [RESULT.NONE] * len(client.codes)
        assert 2 <= len(client.codes) <= 4


@pytest.mark.parametrize('mark', [None, (6.5, 3.0, 0.2)], ids=['free', 'blocked'])
def test_a_tree_plans_again_only_if_the_path_becomes_invalid(running_stack, mark):
    running_stack.show(0.2)
    with tree_client(follow=2.6) as client:
        root = tree.tree_without_needless_plans(client, SERVER_SECONDS)
        while not client.answers:
            assert root.execute_tick() is tree.RUNNING
        if mark:
            running_stack.costmap.mark(*mark)
        assert tree.run(root, PATIENCE) is tree.SUCCESS
        assert client.codes == [RESULT.NONE] * (2 if mark else 1), client.answers
        assert client.clears == 0


def test_a_tree_that_is_halted_cancels_its_goal(running_stack):
    running_stack.show(0.2, marks=[(*DOOR, 0.8)], come_back=True)
    with tree_client() as client:
        root = tree.default_tree(client, server_timeout=SERVER_SECONDS)
        while not client.acknowledged:
            assert root.execute_tick() is tree.RUNNING
        root.halt()
        assert root.status is tree.IDLE
        assert navigate(client) is tree.FAILURE


def test_the_manager_pauses_resumes_and_resets_the_planner(running_stack):
    manager, costmap = running_stack.manager, running_stack.costmap
    costmap.use(0.2)
    assert manager.pause()
    assert manager.states() == [State.PRIMARY_STATE_INACTIVE]
    with tree_client() as client:
        assert navigate(client) is tree.FAILURE
        assert client.codes == [], 'an inactive planner rejects goals'
        assert manager.resume()
        assert navigate(client) is tree.SUCCESS, client.answers
    assert manager.reset()
    assert manager.states() == [UNCONFIGURED]
    assert manager.startup()
    running_stack.show()
    with tree_client() as client:
        assert navigate(client) is tree.SUCCESS, client.answers
    assert manager.broken is None


class BondedNode(LifecycleNodeMixin, Node):
    """Another managed node of a stack."""

    def __init__(self, namespace):
        Node.__init__(self, 'controller_server', namespace=namespace)
        LifecycleNodeMixin.__init__(self)
        self.bond = None

    def on_activate(self, state):
        self.bond = lifecycle.Bond(self, 'controller_server', None)
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state):
        self.bond.close()
        return TransitionCallbackReturn.SUCCESS


def test_a_killed_planner_brings_the_stack_down_and_a_new_one_up_again(running_stack):
    space, names = '/killed', ('controller_server', 'planner_node')
    node = BondedNode(space)
    with contextlib.ExitStack() as running:
        running.enter_context(spinning(node))
        planner = running.enter_context(planner_process(space))
        manager = running.enter_context(managing(*names, namespace=space))
        assert manager.startup()
        # Longer than a missing heartbeat would need to be noticed.
        assert not manager.went_down.wait(1.5 * lifecycle.BOND_TIMEOUT)
        begin = time.monotonic()
        planner.kill()
        assert manager.went_down.wait(PATIENCE)
        assert manager.broken == 'planner_node'
        assert manager.broken_at - begin < 1.5 * lifecycle.BOND_TIMEOUT
        assert manager.managed['controller_server'].get_state() == UNCONFIGURED
        running.enter_context(planner_process(space))
        assert manager.wait_for_respawn(PATIENCE)
        assert manager.startup()
        assert manager.shutdown()
        assert manager.states() == [State.PRIMARY_STATE_FINALIZED] * 2
