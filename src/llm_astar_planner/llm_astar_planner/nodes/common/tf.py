# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Transforms poses into the map's frame, with tf2 if it is installed."""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import pose_from_message
from llm_astar_msgs_adapter.messages.transforms import flat_pose, matrix_of, moved
from rclpy.exceptions import InvalidHandle
from rclpy.time import Time

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.spin import SpinThread, side_node
from llm_astar_planner.search.arrays import POLL_PERIOD_S, Float64s

try:
    import tf2_ros
except ImportError:
    HAS_TF2 = False
else:
    HAS_TF2 = True

# Seconds to wait for a transform: those of a robot arrive many times a second.
PATIENCE = 0.2
# Seconds from one take of transforms to the next, and how many the queue holds meanwhile.
TAKE_SECONDS, QUEUED = 0.5, 500
# Asks tf2 for the newest transform.
NEWEST = Time()

# Whether the caller has time to wait; may raise an exception that ends the whole request.
MayWait = Callable[[], bool]


def never() -> bool:
    """Use only transforms that have arrived already."""
    return False


class FrameError(LlmAstarError, RuntimeError):
    """A pose that cannot be transformed into the map's frame; the message says which and why."""


class Frames:
    """Transforms poses of other frames, and the pose of the robot, into the map's frame."""

    def __init__(self, buffer: Any, take: Callable[[], None] = lambda: None) -> None:  # noqa: ANN401 - tf2 may not be installed
        """Take tf2's buffer (its `lookup_transform`), None if tf2 is not installed.

        `take` is called before each look-up, to fill the buffer with what has arrived.
        """
        self._buffer, self._take = buffer, take

    def locate(
        self, pose: PoseStamped, frame_id: str, name: str, may_wait: MayWait = never
    ) -> Pose2D:
        """Return a pose in `frame_id`, by the transform at its stamp, or the latest for stamp 0.

        Waits up to PATIENCE seconds, while `may_wait()`, for a transform that has not arrived.
        An empty frame means `frame_id`. Raises FrameError naming the pose by `name` if the
        transform does not arrive, GridMapError if a number is not finite, and what `may_wait`
        raises.
        """
        place = pose_from_message(pose.pose, name)
        frame = pose.header.frame_id
        if frame in ('', frame_id):
            return place
        stamp = Time.from_msg(pose.header.stamp)
        return moved(place, self.matrix(frame, frame_id, name, stamp, may_wait))

    def matrix(
        self, frame: str, frame_id: str, name: str, stamp: Time = NEWEST, may_wait: MayWait = never
    ) -> Float64s:
        """Return the transform [4, 4] of a frame into `frame_id`, waiting as `locate` does.

        Raises FrameError, with `name` for what is in that frame, if there is none, GridMapError if
        it is malformed, and what `may_wait` raises.
        """
        what = f'the {name} is in frame {frame!r}, the map in {frame_id!r}'
        return self._look_up(frame_id, frame, stamp, may_wait, what)

    def robot(self, base_frame: str, frame_id: str, may_wait: MayWait = never) -> Pose2D:
        """Return the robot's latest pose in `frame_id`, waiting as `locate` does.

        Raises FrameError, and what `may_wait` raises.
        """
        what = f'the pose of the robot ({base_frame!r} in {frame_id!r}) is needed'
        return flat_pose(self._look_up(frame_id, base_frame, NEWEST, may_wait, what))

    def _look_up(
        self, target: str, source: str, stamp: Time, may_wait: MayWait, what: str
    ) -> Float64s:
        if self._buffer is None:
            raise FrameError(f'{what}, and tf2_ros is not installed')
        # tf2's own wait cannot be cancelled, and never ends while simulated time is paused.
        deadline = time.monotonic() + PATIENCE
        while True:
            self._take()
            try:
                found = self._buffer.lookup_transform(target, source, stamp)
            except Exception as error:  # noqa: BLE001 - tf2's exceptions have no common base
                problem = f'{what}, and no transform is known: {error}'
            else:
                return matrix_of(found.transform)
            if not may_wait() or time.monotonic() >= deadline:
                raise FrameError(problem)
            time.sleep(POLL_PERIOD_S)


def listen(entities: Entities) -> Frames:
    """Return the transforms of `/tf` and `/tf_static`, none without tf2_ros.

    They have a node and a thread of their own, since hundreds of them may arrive in a second, and
    must not wait for plans. That thread takes many at a time, without an executor: to be woken for
    each costs five times as much.
    """
    if not HAS_TF2:
        return Frames(None)
    parent = entities.node
    # Of the parent's remaps only those of the topics: __node would give both the same name.
    topics = {name: parent.resolve_topic_name(name) for name in ('/tf', '/tf_static')}
    remaps = [word for name, to in topics.items() for word in ('-r', f'{name}:={to}')]
    clock = parent.get_parameter('use_sim_time')
    node = side_node(
        parent, 'transforms', cli_args=['--ros-args', *remaps], parameter_overrides=[clock]
    )
    entities.on_close(node.destroy_node)
    buffer = tf2_ros.Buffer(node=node)
    # Of the node only its clock and tf2's service are spun.
    not_spun = side_node(parent, 'tf', cli_args=['--ros-args', *remaps])
    entities.on_close(not_spun.destroy_node)
    taker = TransformTaker(tf2_ros.TransformListener(buffer, not_spun, qos=QUEUED))
    entities.on_close(taker.close)
    entities.on_close(SpinThread(node).close)
    return Frames(buffer, taker.take)


class TransformTaker:
    """Gives tf2's listener the messages that have arrived, each TAKE_SECONDS and in `take`."""

    def __init__(self, listener: Any) -> None:  # noqa: ANN401 - tf2 may not be installed
        """Start to take; nobody else spins the node of the `listener`."""
        static, moving = listener.tf_static_sub, listener.tf_sub
        self._taken = (static, listener.static_callback), (moving, listener.callback)
        self._lock, self._closed = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self.run, name='transforms', daemon=True)
        self._thread.start()

    def run(self) -> None:
        """Take what has arrived until closed: a queue holds only so many."""
        while not self._closed.wait(TAKE_SECONDS):
            self.take()

    def take(self) -> None:
        """Take what has arrived."""
        with self._lock:
            for subscription, callback in self._taken:
                kind, handle = subscription.msg_type, subscription.handle
                with contextlib.suppress(InvalidHandle), handle:
                    while (taken := handle.take_message(kind, False)) is not None:
                        callback(taken[0])

    def close(self) -> None:
        """Stop."""
        self._closed.set()
        self._thread.join()
