"""Transforms applied to poses in the plane."""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.transforms import flat_pose, matrix_of, moved


def transform(x=0.0, y=0.0, z=0.0, rotation=(0.0, 0.0, 0.0, 1.0)):
    names = dict(zip('xyzw', rotation))
    return SimpleNamespace(
        translation=SimpleNamespace(x=x, y=y, z=z), rotation=SimpleNamespace(**names)
    )


def turned(yaw, x=0.0, y=0.0):
    return matrix_of(transform(x, y, 0.0, (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))))


def test_a_pose_is_turned_and_shifted():
    pose = moved(Pose2D(1.0, 0.0, math.pi / 2), turned(math.pi / 2, 10.0, 20.0))
    assert pose == pytest.approx((10.0, 21.0, math.pi))
    assert flat_pose(turned(0.5, 3.0, 4.0)) == pytest.approx((3.0, 4.0, 0.5))


def test_a_pose_in_a_tilted_frame_is_projected_on_the_plane():
    pitch = math.radians(60.0)
    sloped = transform(rotation=(0.0, math.sin(pitch / 2), 0.0, math.cos(pitch / 2)))
    assert moved(Pose2D(2.0, 1.0, 0.0), matrix_of(sloped)) == pytest.approx((1.0, 1.0, 0.0))


numbers = st.floats(-1e3, 1e3)
angles = st.floats(-3.0, 3.0)


@given(numbers, numbers, angles, numbers, numbers, angles)
def test_a_transform_and_its_inverse_leave_a_pose_where_it_was(x, y, yaw, tx, ty, turn):
    there = moved(Pose2D(x, y, yaw), turned(turn, tx, ty))
    c, s = math.cos(turn), math.sin(turn)
    back = moved(there, turned(-turn, -(c * tx + s * ty), s * tx - c * ty))
    assert back[:2] == pytest.approx((x, y), abs=1e-6)
    assert math.cos(back.yaw - yaw) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('broken', 'field'),
    [
        (transform(x=math.nan), 'transform'),
        (transform(rotation=(0.0, 0.0, 0.0, 0.0)), 'transform.rotation'),
        (transform(rotation=(1.0, 1.0, 0.0, 1.0)), 'transform.rotation'),
    ],
)
def test_a_malformed_transform_is_refused(broken, field):
    with pytest.raises(GridMapError) as caught:
        matrix_of(broken)
    assert caught.value.field == field
