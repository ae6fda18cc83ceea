"""The translations between messages and values, with the real message classes."""

import array
import math
from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import (
    grid_from_message,
    path_from_message,
    pose_from_message,
    yaws_of,
)
from llm_astar_msgs_adapter.messages.markers import (
    MAX_DRAWN,
    expanded_from_message,
    expanded_to_message,
    waypoints_to_markers,
)
from llm_astar_msgs_adapter.messages.report import (
    ExchangeReport,
    PlanReport,
    ReportError,
    report_from_message,
)
from llm_astar_msgs_adapter.messages.writing import (
    grid_to_message,
    path_to_message,
    pose_to_message,
    quaternion_of,
    report_to_message,
)
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

STAMP = Time(sec=5, nanosec=7)
GRID = GridMap(
    np.array([[0, 100, -1], [50, 65, 0]], dtype=np.int8), 0.25, Pose2D(-1.0, 2.0, 0.5), 'map'
)
REPORT = PlanReport(
    code=0,
    code_name='NONE',
    message='42.7 cells',
    method='llm_astar',
    guided_by='replay:x',
    source='replay',
    source_status='OK',
    source_detail='',
    operation=281,
    first_operation=270,
    storage=298,
    length=42.72792206135785,
    ratio=1.05,
    seconds_source=0.001,
    seconds_search=0.0005,
    waypoints=((26.0, 9.0, 'accepted'), (60.0, 1.5, 'out_of_bounds')),
    map_digest='abc',
    start_shift=0.25,
    goal_shift=0.1,
    unknown_length=1.5,
    clearance=0.35,
    turns=4,
    warnings=('the start cell (1, 2) is not free; the path begins at (3, 2), 0.25 m off',),
    instruction='followed',
)


def test_a_map_keeps_its_digest_through_a_message():
    grid_map = GridMap(GRID.cells, 0.05, GRID.origin, 'map')  # not exact as a float32
    assert grid_from_message(grid_to_message(grid_map, STAMP)).digest == grid_map.digest


def test_a_grid_survives_the_round_trip():
    message = grid_to_message(GRID, STAMP)
    assert message.header.frame_id == 'map'
    assert message.header.stamp == STAMP
    back = grid_from_message(message)
    np.testing.assert_array_equal(back.cells, GRID.cells)
    assert (back.width, back.height) == (3, 2)
    assert back.resolution == 0.25
    assert back.origin == pytest.approx(GRID.origin)


def change_of(path, value):
    def change(message):
        target = message
        *parents, last = path.split('.')
        for parent in parents:
            target = getattr(target, parent)
        setattr(target, last, value)

    return change


@pytest.mark.parametrize(
    ('change', 'field'),
    [
        (change_of('header.frame_id', ''), 'frame_id'),
        (change_of('info.resolution', 0.0), 'resolution'),
        (change_of('info.resolution', math.nan), 'resolution'),
        (change_of('info.width', 4), 'data'),
        (change_of('data', array.array('b', [0] * 5)), 'data'),
        (change_of('data', array.array('b', [0] * 5 + [101])), 'cells'),
        (change_of('info.origin.position.x', math.nan), 'origin'),
        (change_of('info.origin.orientation.w', 0.1), 'orientation'),
        (change_of('info.origin.orientation.w', math.nan), 'orientation'),
    ],
)
def test_a_malformed_map_names_its_field(change, field):
    message = grid_to_message(GRID, STAMP)
    change(message)
    with pytest.raises(GridMapError, match=field):
        grid_from_message(message)


def test_a_map_with_roll_or_pitch_is_refused():
    message = grid_to_message(GRID, STAMP)
    quaternion = message.info.origin.orientation
    quaternion.x, quaternion.z, quaternion.w = math.sqrt(0.5), 0.0, math.sqrt(0.5)
    with pytest.raises(GridMapError, match='roll or pitch'):
        grid_from_message(message)


def test_an_empty_map_is_refused():
    message = grid_to_message(GRID, STAMP)
    message.info.width = message.info.height = 0
    message.data = array.array('b')
    with pytest.raises(GridMapError, match='cells'):
        grid_from_message(message)


def test_a_path_has_frame_stamp_and_the_direction_of_travel_on_every_pose():
    points = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]
    message = path_to_message(points, 'map', STAMP, goal_yaw=1.0)
    assert message.header.stamp == STAMP
    assert all(pose.header.frame_id == 'map' for pose in message.poses)
    assert all(pose.header.stamp == STAMP for pose in message.poses)
    yaws = [pose_from_message(pose.pose).yaw for pose in message.poses]
    assert yaws == pytest.approx([0.0, math.pi / 2, 1.0])
    np.testing.assert_array_equal(path_from_message(message), points)


def test_the_poses_of_a_path_are_those_that_constructors_make():
    points, stamp = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 2.0]], STAMP
    for pose, (x, y) in zip(path_to_message(points, 'map', stamp).poses, points):
        expected = PoseStamped(header=Header(stamp=stamp, frame_id='map'))
        expected.pose.position = Point(x=x, y=y)
        expected.pose.orientation = quaternion_of(pose_from_message(pose.pose).yaw)
        assert pose == expected
        assert serialize_message(pose) == serialize_message(expected)


def test_a_path_may_be_empty_or_have_one_pose():
    assert path_to_message([], 'map', STAMP).poses == []
    assert path_from_message(path_to_message([], 'map', STAMP)).shape == (0, 2)
    assert len(path_to_message([[1.0, 2.0]], 'map', STAMP).poses) == 1


def test_a_pose_survives_the_round_trip_and_one_that_is_not_finite_is_named():
    pose = Pose2D(1.5, -2.0, 0.75)
    assert pose_from_message(pose_to_message(pose, 'map', STAMP).pose) == pytest.approx(pose)
    broken = PoseStamped()
    broken.pose.position.y = math.inf
    with pytest.raises(GridMapError, match='goal'):
        pose_from_message(broken.pose, 'goal')


@pytest.mark.parametrize(('length', 'yaw'), [(1e-9, 1.2), (5.0, 1.2), (1e300, 1.2), (0.0, 0.0)])
def test_a_heading_does_not_depend_on_the_norm_of_its_quaternion(length, yaw):
    message = pose_to_message(Pose2D(0.0, 0.0, 1.2), 'map', STAMP)
    message.pose.orientation.z *= length
    message.pose.orientation.w *= length
    assert pose_from_message(message.pose).yaw == pytest.approx(yaw)


@pytest.mark.parametrize(
    'report',
    [
        REPORT,
        replace(REPORT, code=208, code_name='NO_VALID_PATH', length=None, waypoints=()),
        ExchangeReport(
            'replay:m',
            'OK',
            '',
            'm',
            'few_shot',
            'Path: [["\n]]',
            1,
            10,
            5,
            0.2,
            ((1.0, 2.5),),
            'd',
            '1,1->2,2',
            messages=(('user', 'where?'),),
        ),
    ],
)
def test_reports_survive_the_round_trip(report):
    message = report_to_message(report, 'planner_node', STAMP)
    assert message.header.stamp == STAMP
    assert report_from_message(message, type(report)) == report


def test_a_report_without_later_fields_is_read_with_their_defaults():
    message = report_to_message(REPORT, 'planner_node', STAMP)
    later = ('start_shift', 'clearance', 'turns', 'warnings', 'instruction')
    message.status[0].values = [v for v in message.status[0].values if v.key not in later]
    message.status[0].values += [KeyValue(key='of_tomorrow', value='not JSON')]
    old = report_from_message(message, PlanReport)
    assert old == replace(
        REPORT, start_shift=0.0, clearance=None, turns=0, warnings=(), instruction=''
    )


def test_a_report_says_first_whether_there_is_a_path():
    assert REPORT.summary == 'path found: 42.7 cells'
    failed = replace(REPORT, code=206, code_name='GOAL_OCCUPIED', message='the goal is not free')
    assert failed.summary == 'no path: the goal is not free [GOAL_OCCUPIED 206]'


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({}, '1 accepted, 1 out of bounds, from replay: x'),
        ({'guided_by': 'none'}, '1 accepted, 1 out of bounds, from replay; the path was found'),
        ({'source_status': 'NONE'}, 'none asked'),
        ({'source_status': 'NONE', 'source_detail': 'why'}, 'none asked: why'),
        ({'source_status': 'NO_WAYPOINTS'}, 'none: replay suggests none'),
        ({'source_status': 'LATE', 'source_detail': 'why'}, 'none in time: why'),
        (
            {'source_status': 'TIMEOUT', 'source_detail': 'why \ud800'},
            'none from replay: why ? [TIMEOUT]',
        ),
    ],
)
def test_a_report_says_in_one_line_what_became_of_the_waypoints(change, words):
    assert replace(REPORT, **change).waypoint_summary.startswith(words)


def test_a_lone_surrogate_in_a_message_does_not_break_a_report():
    report = replace(REPORT, message='half \ud800')
    message = report_to_message(report, 'planner_node', STAMP)
    serialize_message(message)
    assert report.summary.endswith('half ?')
    assert report_from_message(message, PlanReport) == report


@pytest.mark.parametrize(
    ('change', 'level'),
    [
        ({'warnings': ()}, DiagnosticStatus.OK),
        ({}, DiagnosticStatus.WARN),
        ({'warnings': (), 'source_status': 'TIMEOUT'}, DiagnosticStatus.WARN),
        ({'warnings': (), 'instruction_report': {'satisfied': False}}, DiagnosticStatus.WARN),
        ({'warnings': (), 'instruction_report': {'satisfied': True}}, DiagnosticStatus.OK),
        ({'code': 208}, DiagnosticStatus.ERROR),
    ],
)
def test_the_level_is_ok_warn_or_error_by_code_source_and_warnings(change, level):
    message = report_to_message(replace(REPORT, **change), 'planner_node', STAMP)
    assert message.status[0].level == level


def test_a_message_that_is_not_a_report_is_refused_with_its_field():
    with pytest.raises(ReportError, match='statuses'):
        report_from_message(DiagnosticArray(), PlanReport)
    message = report_to_message(REPORT, 'planner_node', STAMP)
    message.status[0].values[0].value = '{'
    with pytest.raises(ReportError, match='code: is not JSON'):
        report_from_message(message, PlanReport)
    message.status[0].values.pop(0)
    with pytest.raises(ReportError, match='code: is missing'):
        report_from_message(message, PlanReport)


def test_markers_delete_the_old_ones_first_and_colour_waypoints_by_status():
    waypoints = [(1.0, 0.0, 'accepted'), (2.0, 1.0, 'occupied')]
    clear, *markers = waypoints_to_markers(waypoints, GRID, STAMP).markers
    assert clear.action == clear.DELETEALL
    spheres = [marker for marker in markers if marker.type == marker.SPHERE]
    assert len({marker.id for marker in markers}) == len(markers)
    assert spheres[0].color != spheres[1].color
    place = spheres[0].pose.position
    np.testing.assert_allclose(GRID.world_to_grid([(place.x, place.y)]), [[1.0, 0.0]], atol=1e-9)


def test_markers_name_waypoints_endpoints_and_via_points():
    waypoints = [(1.0, 0.0, 'accepted'), (2.0, 1.0, 'out_of_bounds'), (2.0, 0.0, 'accepted')]
    array = waypoints_to_markers(
        waypoints, GRID, STAMP, endpoints=[(0.0, 0.0), (2.0, 1.0)], via=[(1.0, 1.0)]
    )
    markers = array.markers[1:]
    labels = [marker.text for marker in markers if marker.ns == 'labels']
    assert labels == ['1', '2 out of bounds', '3', 'start', 'goal', 'via 1']
    assert {marker.ns for marker in markers} == {'waypoints', 'labels', 'ends', 'via'}


def test_no_label_hides_its_shape_or_another_label_from_above():
    waypoints = [(0.0, 0.0, 'accepted'), (2.0, 1.0, 'occupied')]
    ends = [(0.0, 0.0), (2.0, 1.0)]
    _, *markers = waypoints_to_markers(waypoints, GRID, STAMP, ends).markers
    labels = [marker for marker in markers if marker.ns == 'labels']
    shapes = [marker for marker in markers if marker.ns in ('waypoints', 'ends')]
    for shape, label in zip(shapes, labels):
        assert label.pose.position.x == shape.pose.position.x
        assert abs(label.pose.position.y - shape.pose.position.y) > shape.scale.y
    assert len({(label.pose.position.x, label.pose.position.y) for label in labels}) == 4


def test_markers_can_be_seen_on_a_large_map():
    wide = GridMap(np.zeros((10, 4000), dtype=np.int8), 0.05)
    marker = waypoints_to_markers([(9.0, 9.0, 'accepted')], wide, STAMP).markers[1]
    assert marker.scale.x == pytest.approx(0.015 * 4000 * 0.05)


def test_a_plan_without_waypoints_deletes_the_markers_of_the_plan_before():
    (clear,) = waypoints_to_markers([], GRID, STAMP).markers
    assert clear.action == clear.DELETEALL


def test_many_expanded_cells_are_drawn_as_larger_blocks_and_none_is_lost():
    grid_map = GridMap(np.zeros((301, 503), dtype=np.int8), 0.1, GRID.origin, 'map')
    expanded = np.random.default_rng(0).random(grid_map.cells.shape) < 0.5
    message = expanded_to_message(expanded, grid_map, STAMP)
    assert message.cell_width == pytest.approx(0.4)
    assert len(message.cells) <= MAX_DRAWN
    drawn = expanded_from_message(message, grid_map)
    assert drawn[expanded].all()
    alone = np.zeros_like(expanded)
    alone[300, 502] = True
    back = expanded_from_message(expanded_to_message(alone, grid_map, STAMP), grid_map)
    np.testing.assert_array_equal(back, alone)


def test_expanded_cells_survive_the_round_trip():
    expanded = np.array([[True, False, True], [False, True, False]])
    message = expanded_to_message(expanded, GRID, STAMP)
    np.testing.assert_array_equal(expanded_from_message(message, GRID), expanded)
    none = expanded_to_message(np.zeros_like(expanded), GRID, STAMP)
    assert not expanded_from_message(none, GRID).any()


def test_the_yaws_of_many_quaternions_are_those_of_each():
    values = np.random.default_rng(5).normal(size=(20, 4))
    poses = [Pose(orientation=Quaternion(**dict(zip('xyzw', row)))) for row in values.tolist()]
    assert yaws_of(values) == pytest.approx([pose_from_message(pose).yaw for pose in poses])
    values[0, 3] = math.nan
    values[1] = 0.0
    assert yaws_of(values)[:2].tolist() == [0.0, 0.0]
    assert yaws_of(values[:0]).shape == (0,)
