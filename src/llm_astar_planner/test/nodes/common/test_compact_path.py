"""Requests whose path is read as it lies in memory, beside what rclpy makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from llm_astar_planner.nodes.common import compact_path
from llm_astar_planner.nodes.common.compact_path import (
    CompactPath,
    compact_service,
    compact_type,
    is_read_rightly,
)
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from std_srvs.srv import SetBool

# A message with a path that is installed everywhere.
KIND = GetPlan.Response


def path_of(count, seed=1):
    rng = np.random.default_rng(seed)
    poses = []
    for n in range(count):
        values = rng.normal(size=7).tolist()
        pose = Pose(
            position=Point(**dict(zip('xyz', values))),
            orientation=Quaternion(**dict(zip('xyzw', values[3:]))),
        )
        name = ['map', '', 'odom', 'größe', 'a' * 300][n % 5]
        header = Header(stamp=Time(sec=n, nanosec=7), frame_id=name)
        poses.append(PoseStamped(header=header, pose=pose))
    return Path(header=Header(stamp=Time(sec=5), frame_id='map'), poses=poses)


@pytest.mark.parametrize('count', [0, 1, 7, 500])
def test_a_path_is_read_as_rclpy_reads_it(count):
    raw = serialize_message(KIND(plan=path_of(count)))
    found = deserialize_message(raw, compact_type(KIND)).plan
    expected = CompactPath.of_message(deserialize_message(raw, KIND).plan)
    assert (found.frame_id, found.frames) == (expected.frame_id, expected.frames)
    np.testing.assert_array_equal(found.values, expected.values)
    assert found.values.shape == (count, 7)


def test_a_path_outlives_its_message():
    compact = compact_type(KIND)
    first = deserialize_message(serialize_message(KIND(plan=path_of(50))), compact).plan
    before = first.values.copy()
    for seed in range(20):
        deserialize_message(serialize_message(KIND(plan=path_of(50, seed))), compact)
    np.testing.assert_array_equal(first.values, before)


def test_a_service_without_a_path_or_with_unknown_fields_stays_as_it_is():
    assert compact_service(GetPlan) is GetPlan
    nothing = SimpleNamespace()
    assert compact_service(nothing) is nothing
    with pytest.raises(KeyError):
        compact_type(Path)


def test_scalar_fields_are_read_too():
    compact = compact_type(SetBool.Request)
    assert deserialize_message(serialize_message(SetBool.Request(data=True)), compact).data is True
    reply = SetBool.Response(success=True, message='because')
    found = deserialize_message(serialize_message(reply), compact_type(SetBool.Response))
    assert (found.success, found.message) == (True, 'because')


def test_a_message_that_would_be_misread_is_noticed(monkeypatch):
    assert is_read_rightly(KIND, compact_type(KIND))
    monkeypatch.setattr(
        compact_path.CompactPath, 'of_struct', lambda _: CompactPath('map', (), np.zeros((0, 7)))
    )
    assert not is_read_rightly(KIND, compact_type(KIND))


def test_the_requests_of_is_path_valid_are_compact_and_its_responses_are_not():
    services = pytest.importorskip('nav2_msgs.srv', reason='nav2_msgs is not installed')
    kind = compact_service(services.IsPathValid)
    assert kind.Response is services.IsPathValid.Response
    assert kind.Request is not services.IsPathValid.Request
    request = services.IsPathValid.Request(path=path_of(3))
    found = deserialize_message(serialize_message(request), kind.Request)
    assert set(vars(found)) == set(request.get_fields_and_field_types())
    assert len(found.path.values) == 3


def test_another_version_of_rclpy_reads_by_its_own_means(monkeypatch):
    services = pytest.importorskip('nav2_msgs.srv', reason='nav2_msgs is not installed')
    monkeypatch.setattr(compact_path, 'TRIED', ('6',))
    assert compact_service(services.IsPathValid) is services.IsPathValid
