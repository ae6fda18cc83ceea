"""Whether a path can still be followed, asked with the messages of Jazzy, Kilted and newer."""

import math
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import path_to_message, quaternion_of
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.tf import Frames
from llm_astar_planner.nodes.planner.path_validity import PathValidityService, occupancy_limit
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_validator import CollisionChecker
from nav_msgs.msg import Path
from std_msgs.msg import Header

STAMP = Time(sec=7)
CELLS = np.zeros((20, 30), dtype=np.int8)
CELLS[:, 10] = 100
CELLS[5, 20] = -1
CELLS[5, 25] = 60
MAP = GridMap(CELLS, 0.5)
# Fields that the newest message has, with their defaults.
NEWEST = {
    'max_cost': 254,
    'consider_unknown_as_obstacle': False,
    'layer_name': '',
    'footprint': '',
    'stop_at_first_collision': True,
    'max_lookahead_distance': -1.0,
}


class Buffer:
    """Knows some transforms, as x, y and yaw by source."""

    def __init__(self, **transforms):
        self.transforms = transforms
        self.asked = []

    def lookup_transform(self, target_frame, source_frame, time):
        self.asked.append((source_frame, time.nanoseconds))
        if source_frame not in self.transforms:
            raise LookupError(f'{source_frame} does not exist')
        x, y, yaw = self.transforms[source_frame]
        found = TransformStamped()
        found.transform.translation.x, found.transform.translation.y = x, y
        found.transform.rotation = quaternion_of(yaw)
        return found


class Service:
    """The service on a map, and what it logs."""

    def __init__(self, grid_map=MAP, config=None, buffer=None, footprint=None):
        config = config or CostmapConfig()
        newest = grid_map and (Costmap(grid_map, config), CollisionChecker(grid_map, config))
        entities, settings = Mock(), {'robot_base_frame': 'base_link'}
        self.logger = entities.node.get_logger()
        self.service = PathValidityService(
            entities,
            settings,
            Frames(buffer),
            lambda: newest,
            SimpleNamespace(current=footprint),
        )

    def ask(self, path, **fields):
        """Return whether the path is valid, and the indices."""
        answer = self.service.fill(SimpleNamespace(path=path, **fields), SimpleNamespace())
        return answer.is_valid, answer.invalid_pose_indices

    def fails(self, path, **fields):
        """Return what is logged; the newest message says that the check has failed."""
        response = SimpleNamespace(success=True)
        answer = self.service.fill(SimpleNamespace(path=path, **(NEWEST | fields)), response)
        assert (answer.success, answer.is_valid, answer.invalid_pose_indices) == (False, False, [])
        return self.logger.warning.call_args[0][0]


def path_of(*points, frame='map', yaw=None):
    return path_to_message(points, frame, STAMP, yaw)


THROUGH = path_of((4.0, 2.0), (5.2, 2.0), (6.0, 2.0))
BESIDE = path_of((6.0, 2.0), (14.0, 8.0))
OVER_UNKNOWN = path_of((10.2, 2.7))


def test_poses_on_obstacles_and_behind_them_are_invalid():
    service = Service()
    assert service.ask(THROUGH) == (False, [1])
    assert service.ask(BESIDE) == (True, [])
    assert service.ask(OVER_UNKNOWN) == (True, [])
    assert service.ask(OVER_UNKNOWN, consider_unknown_as_obstacle=True) == (False, [0])
    closed = Service(config=CostmapConfig(allow_unknown=False))
    assert closed.ask(OVER_UNKNOWN, consider_unknown_as_obstacle=False) == (False, [0])


def test_poses_that_the_robot_has_passed_are_not_checked():
    assert Service(buffer=Buffer(base_link=(6.0, 2.0, 0.0))).ask(THROUGH) == (True, [])


def test_a_frame_is_transformed_once_and_by_its_newest_transform():
    buffer = Buffer(odom=(4.2, 3.0, 0.0))
    path = path_of(*((0.1 * n, 0.0) for n in range(20)), frame='odom')
    path.poses[0].header = Header()
    valid, indices = Service(buffer=buffer).ask(path)
    assert not valid
    assert indices == [n for n in range(20) if 5.0 <= 4.2 + 0.1 * n + 1e-9 < 5.5]
    assert buffer.asked == [('odom', 0), ('base_link', 0)]
    turned = Buffer(odom=(5.2, 3.0, math.pi / 2.0))
    assert Service(buffer=turned).ask(path_of((0.0, 1.0), frame='odom')) == (True, [])
    assert Service(buffer=turned).ask(path_of((1.0, 0.0), frame='odom')) == (False, [0])


def test_poses_of_several_frames_are_refused():
    path = path_of((4.0, 2.0), (1.0, 2.0), (4.0, 2.0))
    path.poses[1].header = Header(frame_id='odom')
    assert 'in several frames' in Service(buffer=Buffer(odom=(4.2, 0.0, 0.0))).fails(path)


def test_what_cannot_be_checked_is_not_valid_and_the_log_says_why():
    service = Service()
    assert service.ask(Path()) == (False, [])
    assert 'the path is empty' in service.fails(Path())
    assert 'tf2_ros is not installed' in service.fails(path_of((1.0, 1.0), frame='odom'))
    assert 'odom does not exist' in Service(buffer=Buffer()).fails(
        path_of((1.0, 1.0), frame='odom')
    )
    assert 'not finite' in service.fails(path_of((1.0, 1.0), (math.nan, 1.0)))
    assert 'layer_name must be empty' in service.fails(BESIDE, layer_name='obstacle_layer')
    assert 'footprint must be empty' in service.fails(BESIDE, footprint='[[0.1, 0.1], [0.2, 0.2]]')
    assert 'no map has arrived' in Service(grid_map=None).fails(BESIDE)


def test_a_path_that_was_checked_is_a_success_whether_it_is_valid_or_not():
    for path, is_valid in ((BESIDE, True), (THROUGH, False)):
        response = SimpleNamespace(success=None)
        answer = Service().service.fill(SimpleNamespace(path=path, **NEWEST), response)
        assert (answer.success, answer.is_valid) == (True, is_valid)


def test_a_cost_limit_is_in_the_costs_of_nav2():
    path = path_of((12.7, 2.7))  # occupancy 60
    for max_cost, is_valid in ((254, True), (255, True), (160, True), (150, False), (0, False)):
        assert Service().ask(path, max_cost=max_cost)[0] is is_valid, max_cost
    assert Service().ask(OVER_UNKNOWN, max_cost=1) == (True, [])
    assert Service().ask(OVER_UNKNOWN, max_cost=0) == (False, [0])


def test_costs_become_the_occupancy_that_they_are_published_as():
    published = {cost: 1 + 97 * (cost - 1) // 251 for cost in range(1, 253)}
    published |= {0: 0, 253: 99, 254: 100}
    for max_cost in range(1, 255):
        limit = occupancy_limit(max_cost)
        assert all(published[cost] >= limit for cost in range(max_cost, 255))
        assert published[max_cost] == limit
    assert occupancy_limit(255) > 100


CAR = Footprint(((1.0, 0.3), (-1.0, 0.3), (-1.0, -0.3), (1.0, -0.3)))


def test_the_polygon_of_the_robot_must_fit_at_each_heading():
    service = Service(footprint=CAR)
    along = path_of((4.2, 2.0), (4.2, 3.0), yaw=math.pi / 2.0)
    assert service.ask(along, **NEWEST) == (True, [])
    assert service.ask(path_of((4.2, 2.0), yaw=0.0), **NEWEST) == (False, [0])


def test_a_polygon_turns_with_the_frame_of_its_path():
    service = Service(buffer=Buffer(odom=(4.2, 2.0, math.pi / 2.0)), footprint=CAR)
    assert service.ask(path_of((0.0, 0.0), frame='odom', yaw=0.0)) == (True, [])
    across = path_of((0.0, 0.0), frame='odom', yaw=math.pi / 2.0)
    assert service.ask(across) == (False, [0])


def test_the_cells_of_a_map_with_a_turned_origin_are_found():
    turned = GridMap(CELLS, 0.5, Pose2D(1.0, 2.0, 0.3))
    x, y = turned.grid_to_world([(10.0, 4.0)])[0].tolist()
    assert Service(turned).ask(path_of((x, y))) == (False, [0])


numbers = st.floats() | st.floats(-5.0, 20.0)


@given(
    st.lists(st.tuples(numbers, numbers, st.sampled_from(['map', '', 'odom', 'x'])), max_size=4),
    st.floats(-4.0, 4.0),
    st.fixed_dictionaries(
        {
            'max_cost': st.integers(0, 255),
            'consider_unknown_as_obstacle': st.booleans(),
            'layer_name': st.sampled_from(['', '', 'static_layer']),
            'footprint': st.sampled_from(['', '[[0, 0]]']),
            'stop_at_first_collision': st.booleans(),
            'max_lookahead_distance': st.floats(),
        }
    ),
    st.sampled_from([0.0, 0.7]),
)
def test_any_request_gets_an_answer(places, yaw, fields, robot_radius):
    path = path_of(*((0.0, 0.0) for _ in places), yaw=yaw)
    for pose, (x, y, frame) in zip(path.poses, places):
        pose.header = Header(frame_id=frame)
        pose.pose.position = Point(x=x, y=y, z=0.0)
    buffer = Buffer(odom=(4.0, 2.0, 0.5), base_link=(3.0, 3.0, 0.0))
    service = Service(config=CostmapConfig(robot_radius=robot_radius), buffer=buffer)
    response = SimpleNamespace(success=None)
    answer = service.service.fill(SimpleNamespace(path=path, **fields), response)
    assert isinstance(answer.success, bool)
    assert answer.is_valid == (answer.success and not answer.invalid_pose_indices)
    assert all(0 <= index < len(places) for index in answer.invalid_pose_indices)
