"""The robot's polygon in a running planner: by parameter, by topic, in every published path."""

import math
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import rclpy
import shapely
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point32, PolygonStamped, TransformStamped
from graph_tools import PATIENCE, calling, running, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message, status_values, yaw_of
from llm_astar_msgs_adapter.messages.writing import grid_to_message, quaternion_of
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE
from llm_astar_planner.nodes.common.tf import HAS_TF2, Frames
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.planning.footprint import Footprint
from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from shapely import affinity

if HAS_TF2:
    from tf2_msgs.msg import TFMessage

SPACE = '/footprint'
LONG = '[[0.5, 0.25], [0.5, -0.25], [-0.5, -0.25], [-0.5, 0.25]]'
SHORT = '[[0.2, 0.2], [0.2, -0.2], [-0.2, -0.2], [-0.2, 0.2]]'
ORIGIN = Pose2D(3.0, -2.0, 0.4)


def corridor(room) -> GridMap:
    """A corridor of 0.7 m with a corner, and a room there in which to turn or not."""
    cells = np.full((200, 200), 100, np.int8)
    cells[50:64, 10:112] = 0
    cells[50:180, 98:112] = 0
    cells[57 - room : 58 + room, 105 - room : 106 + room] = 0
    return GridMap(cells, 0.05, ORIGIN)


NARROW, ROOMY = corridor(0), corridor(18)


def pose_on(x, y, yaw):
    """A pose in the map's frame, of grid coordinates."""
    place = NARROW.grid_to_world([(x, y)])[0]
    return Pose2D(*place, yaw + ORIGIN.yaw)


# Not at the centres of cells.
START, GOAL = pose_on(30.3, 56.8, 0.1), pose_on(104.6, 160.2, math.pi / 2)


def polygon_of(points, frame='base_link', stamp=None):
    message = PolygonStamped()
    message.header.frame_id = frame
    message.header.stamp = stamp or Time()
    message.polygon.points = [Point32(x=float(x), y=float(y)) for x, y in points]
    return message


class Robot:
    """A planner, a caller, and what it publishes."""

    def __init__(self, planner, caller):
        self.planner, self.caller, self.values = planner, caller, {}
        node = caller.node
        self.maps = node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self.footprints = node.create_publisher(PolygonStamped, 'published_footprint', RELIABLE)
        self.parameters = node.create_client(SetParameters, 'planner_node/set_parameters')
        node.create_subscription(DiagnosticArray, '/diagnostics', self.on_state, RELIABLE)

    def on_state(self, message):
        for status in message.status:
            if status.name == f'{self.planner.get_fully_qualified_name()[1:]}: planner':
                self.values = status_values(status)

    @property
    def current(self):
        return self.planner._server._footprint.current

    def use(self, grid_map):
        self.maps.publish(grid_to_message(grid_map, Time()))
        self.caller.wait_until_ready(grid_map.digest)

    def ask(self):
        path, report, _ = self.caller.call(START, GOAL)
        return path, report

    def set(self, text):
        parameters = [Parameter('footprint', value=text).to_parameter_msg()]
        request = SetParameters.Request(parameters=parameters)
        return self.caller.ask(self.parameters, request).results[0]


@pytest.fixture(scope='module')
def robot():
    rclpy.init()
    values = {'llm_client': '', 'tolerance': 0.0, 'robot_radius': 0.2, 'max_planning_time': 60.0}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    planner = PlannerNode(namespace=SPACE, parameter_overrides=overrides)
    with running(planner), calling(SPACE) as caller:
        made = Robot(planner, caller)
        caller.wait_for_planner(PATIENCE)
        wait_for(made.footprints.get_subscription_count, 'the topic')
        made.use(NARROW)
        yield made
    rclpy.try_shutdown()


def test_the_parameter_counts_from_the_next_plan_on_and_a_bad_one_changes_nothing(robot):
    assert robot.ask()[1].code_name == 'NONE'
    assert robot.set(LONG).successful
    path, report = robot.ask()
    assert (report.code_name, len(path.poses)) == ('NO_VALID_PATH', 0)
    assert 'no path fits the footprint (4 points, radii 0.25 m inscribed' in report.message
    assert report.footprint == str(Footprint.parse(LONG))
    wait_for(lambda: robot.values.get('footprint_radii') == [0.25, 0.559], 'the radii')
    for text, words in (
        ('[[0, 0], [1, 0]]', '2 points; it needs 3 to 64'),
        ('[[0, 0], [1, 1], [1, 0], [0, 1]]', 'its outline meets itself (Self-intersection'),
        ('a circle', 'not of the form'),
    ):
        answer = robot.set(text)
        assert not answer.successful
        assert words in answer.reason
    assert robot.current == Footprint.parse(LONG)
    assert robot.ask()[1].code_name == 'NO_VALID_PATH'
    assert robot.set('').successful
    assert robot.ask()[1].code_name == 'NONE'


def test_every_pose_of_the_published_path_is_one_where_the_polygon_is_free(robot):
    robot.use(ROOMY)
    assert robot.set(LONG).successful
    path, report = robot.ask()
    assert report.code_name == 'NONE', report.message
    lethal = np.argwhere(ROOMY.cells == 100)
    corners = np.array([(-0.499, -0.499), (0.499, -0.499), (0.499, 0.499), (-0.499, 0.499)])
    squares = (lethal[:, None, ::-1] + corners).reshape(-1, 2)
    cells = shapely.STRtree(shapely.polygons(ROOMY.grid_to_world(squares).reshape(-1, 4, 2)))
    shape = shapely.Polygon(Footprint.parse(LONG).points)
    for pose in (stamped.pose for stamped in path.poses):
        turned = affinity.rotate(shape, yaw_of(pose.orientation, 'pose'), (0, 0), use_radians=True)
        placed = affinity.translate(turned, pose.position.x, pose.position.y)
        assert not len(cells.query(placed, predicate='intersects')), pose
    points = path_from_message(path)
    assert points[0] == pytest.approx(START[:2], abs=0.04)
    assert points[-1] == pytest.approx(GOAL[:2], abs=0.04)
    assert robot.set('').successful
    robot.use(NARROW)


def test_the_topic_counts_without_the_parameter_and_what_is_malformed_is_ignored(robot):
    footprint = Footprint.parse(LONG)
    robot.footprints.publish(polygon_of(footprint.points))
    wait_for(lambda: robot.current == footprint, 'the footprint')
    assert robot.ask()[1].code_name == 'NO_VALID_PATH'
    for points in ([(0, 0), (1, 0)], [(0, 0), (1, 0), (math.nan, 1)], [(0, 0)] * 1000):
        robot.footprints.publish(polygon_of(points))
    assert robot.ask()[1].code_name == 'NO_VALID_PATH'
    assert robot.set(SHORT).successful
    assert robot.ask()[1].code_name == 'NONE'
    # Of the topic nothing is taken meanwhile, and what was known before counts again.
    robot.footprints.publish(polygon_of([(0, 0), (1, 0), (0, 1)]))
    # Maps come on the same thread, so after these it has been passed over.
    for grid_map in (ROOMY, NARROW):
        robot.use(grid_map)
    assert robot.set('').successful
    wait_for(lambda: robot.current == footprint, 'the footprint of the topic')
    robot.footprints.publish(polygon_of(Footprint.parse(SHORT).points))
    wait_for(lambda: robot.current.circumscribed_radius < 0.5, 'the other footprint')
    assert robot.ask()[1].code_name == 'NONE'


def test_a_published_path_is_checked_again_when_the_footprint_changes(robot):
    assert robot.set(SHORT).successful
    assert robot.ask()[1].code_name == 'NONE'
    monitor = robot.planner._server.monitor
    assert robot.set(LONG).successful
    wait_for(lambda: 'no path fits the footprint' in monitor.state, 'the check')
    assert robot.set('').successful


@pytest.mark.skipif(not HAS_TF2, reason='tf2_ros is not installed')
def test_nav2s_footprint_is_taken_where_the_robot_is_by_tf(robot):
    stamp = robot.caller.node.get_clock().now().to_msg()
    transform = TransformStamped(child_frame_id='base_link')
    transform.header.frame_id, transform.header.stamp = 'map', stamp
    transform.transform.translation.x, transform.transform.translation.y = 30.0, -12.0
    transform.transform.rotation = quaternion_of(1.0)
    broadcaster = robot.caller.node.create_publisher(TFMessage, '/tf', RELIABLE)
    wait_for(broadcaster.get_subscription_count, '/tf')
    broadcaster.publish(TFMessage(transforms=[transform]))
    footprint = Footprint(((0.6, 0.25), (0.6, -0.25), (-0.4, -0.25), (-0.4, 0.25)))
    shape = affinity.rotate(shapely.Polygon(footprint.points), 1.0, (0, 0), use_radians=True)
    points = shapely.get_coordinates(affinity.translate(shape, 30.0, -12.0))[:-1]
    robot.footprints.publish(polygon_of(points, 'map', stamp))
    wait_for(lambda: robot.current and robot.current.is_close_to(footprint.array, 1e-4), 'it')


class Buffer:
    """Knows where the map's origin is in the robot's frame at one stamp."""

    def __init__(self, pose, stamp):
        self.pose, self.stamp = pose, stamp

    def lookup_transform(self, target_frame, source_frame, stamp):
        if (target_frame, source_frame, stamp.nanoseconds) != ('base_link', 'map', self.stamp):
            raise LookupError('no such transform')
        transform = TransformStamped()
        transform.transform.translation.x = self.pose.x
        transform.transform.translation.y = self.pose.y
        transform.transform.rotation = quaternion_of(self.pose.yaw)
        return transform


def footprint_server(frames, footprint='', **changes):
    settings = {
        'footprint': footprint,
        'robot_base_frame': 'base_link',
        'occupied_threshold': 65,
        'robot_radius': 0.0,
    } | changes
    settings = type('Settings', (dict,), {'current': settings})(settings)
    node = Mock()
    on_change = Mock()
    server = RobotFootprint(SimpleNamespace(node=node), settings, frames, on_change)
    return server, node.get_logger(), on_change


def test_a_footprint_in_the_global_frame_is_moved_back_by_the_transform_at_its_stamp():
    footprint = Footprint(((0.6, 0.2), (0.6, -0.3), (-0.4, -0.3), (-0.4, 0.2)))
    # The robot is at (40, -20), turned by 2 rad; so the map's origin is here in its frame.
    yaw, place = 2.0, np.array([40.0, -20.0])
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    origin = -place @ turn
    server, logger, on_change = footprint_server(Frames(Buffer(Pose2D(*origin, -yaw), 7 * 10**9)))
    world = footprint.array @ turn.T + place
    server.on_message(polygon_of(world, 'map', Time(sec=7)))
    assert server.current.is_close_to(footprint.array, 1e-4)
    on_change.assert_called_once()
    # The same again, with the rounding of another place: no change.
    first = server.current
    server.on_message(polygon_of(world + 1e-4, 'map', Time(sec=7)))
    assert server.current is first
    on_change.assert_called_once()
    # Without its transform a message is ignored, and the log says why.
    server.on_message(polygon_of(2 * world, 'map', Time(sec=8)))
    assert server.current is first
    assert 'no transform is known' in logger.error.call_args[0][0]
    assert 'the last one stays' in logger.error.call_args[0][0]


def test_a_footprint_that_comes_before_the_frame_of_the_robot_is_waited_for_quietly():
    server, logger, _ = footprint_server(Frames(Buffer(Pose2D(0.0, 0.0), 7 * 10**9)))
    server.on_message(polygon_of(np.eye(3)[:, :2], 'map', Time(sec=8)))
    logger.error.assert_not_called()
    assert 'no transform is known' in logger.debug.call_args[0][0]


@pytest.mark.parametrize(
    ('points', 'words'),
    [
        ([(0, 0), (1, 0)], '2 points; it needs 3 to 64'),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], 'meet'),
        ([(0, 0), (1, 0), (math.inf, 1)], 'not finite'),
        ([(n, 0) for n in range(100_000)], '100000 points, over 64'),
        ([], '0 points'),
    ],
)
def test_the_log_says_what_is_wrong_with_a_footprint(points, words):
    server, logger, on_change = footprint_server(Frames(None))
    server.on_message(polygon_of(points))
    assert words in logger.error.call_args[0][0]
    assert server.current is None
    on_change.assert_not_called()


@pytest.mark.parametrize(
    ('changes', 'is_used'),
    [({}, True), ({'occupied_threshold': 99}, False), ({'robot_radius': 0.22}, False)],
)
def test_a_circle_of_nav2_is_no_footprint_where_the_costmap_plans_for_it(changes, is_used):
    server, _, _ = footprint_server(Frames(None), **changes)
    angles = np.arange(16) * math.pi / 8
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * 0.2
    points += np.sign(np.round(points, 9)) * 0.01
    server.on_message(polygon_of(points))
    assert (server.current is not None) is is_used
    # A polygon that is no circle always counts.
    server.on_message(polygon_of(points * (1.0, 0.6)))
    assert server.current is not None


def test_the_parameter_of_the_start_counts_at_once():
    server, logger, _ = footprint_server(Frames(None), LONG)
    assert server.current == Footprint.parse(LONG)
    assert 'radii 0.25 m inscribed, 0.56 m circumscribed' in logger.info.call_args[0][0]
    server.on_message(polygon_of(Footprint.parse(SHORT).points))
    assert server.current == Footprint.parse(LONG)
