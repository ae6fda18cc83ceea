# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A node's bond with Nav2's lifecycle manager: heartbeats from which it learns that a node died.

The protocol is that of ROS's package bond, of which only the message is needed: both ends publish
`bond/msg/Status` on the topic `bond`. See `bond.cpp` there, and `createBond` of nav2_util's
LifecycleNode, whose behaviour and constants these are.
"""

import threading
import time
import uuid

from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from llm_astar_planner.nodes.common.entities import BOND, BOND_HEARTBEATS
from llm_astar_planner.nodes.common.spin import RCLError, side_node

try:
    from bond.msg import Status
except ImportError:
    Status = None

# The name of its topic, in the namespace of the node.
TOPIC = 'bond'
# What a heartbeat says of the other end's patience; the manager goes by its own `bond_timeout`.
HEARTBEAT_TIMEOUT_S = 4.0
# How long to look for a manager: a node that activates itself may have none.
CONNECT_TIMEOUT_S = 10.0
# From one heartbeat to the next at most until the manager is heard: it waits for two seconds.
FORMING_S = 0.1
# At the end: how long to wait until the manager has that.
FAREWELL = Duration(seconds=0.1)


class Bond:
    """The end of a bond that a managed node holds, from its activation to `close`.

    It has a node and a thread of its own, and real time also where time is simulated: what plans
    and maps take cannot stop the heartbeats. As with Nav2's own nodes, nothing comes of a manager
    that dies, and only `close` makes place for a bond with the next one.
    """

    def __init__(self, parent: Node, period: float) -> None:
        """Begin to publish a heartbeat every `period` seconds. Needs the package bond."""
        self._id = parent.get_name()
        self._instance_id = str(uuid.uuid4())
        self._period = period
        self._logger = parent.get_logger()
        self._node = side_node(parent, 'bond')
        topic = parent.resolve_topic_name(TOPIC)
        self._publisher = self._node.create_publisher(Status, topic, BOND_HEARTBEATS)
        self._heartbeat = self.status(is_active=True)
        # Only until the manager is heard: the heartbeats of every other node of the stack come
        # here as well, a hundred a second. Read without an executor, which each would wake.
        self._statuses = self._node.create_subscription(Status, topic, lambda _: None, BOND)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self.run, name='bond', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Tell the manager that the node is no longer active, and end."""
        self._closed.set()
        self._thread.join()
        self._node.destroy_node()

    def run(self) -> None:
        """Publish heartbeats until `close`, or until the context is shut down."""
        try:
            if self.is_formed():
                self._node.destroy_subscription(self._statuses)
                while not self._closed.wait(self._period):
                    self._publisher.publish(self._heartbeat)
                self._publisher.publish(self.status(is_active=False))
                self._publisher.wait_for_all_acked(FAREWELL)
        except (InvalidHandle, RCLError):
            if self._node.context.ok():
                raise

    def is_formed(self) -> bool:
        """Publish heartbeats until the manager's is heard, or `close`.

        Return False where no manager is there after CONNECT_TIMEOUT_S: there are no more then.
        """
        give_up = time.monotonic() + CONNECT_TIMEOUT_S
        while time.monotonic() < give_up:
            self._publisher.publish(self._heartbeat)
            if self._closed.wait(min(self._period, FORMING_S)) or self.is_heard():
                return True
        return False

    def is_heard(self) -> bool:
        """Tell whether a heartbeat of the manager has come since the last call."""
        heard = False
        subscription = self._statuses.handle
        with subscription:
            while (taken := subscription.take_message(Status, True)) is not None:
                # Those of other nodes are not worth making a message of.
                if self._id.encode() in taken[0]:
                    status = deserialize_message(taken[0], Status)
                    is_other = status.id == self._id and status.instance_id != self._instance_id
                    heard |= is_other and status.active
        return heard

    def status(self, *, is_active: bool) -> bytes:
        """Return a heartbeat, or the end of the bond, serialized: it is the same each time."""
        status = Status(
            id=self._id, instance_id=self._instance_id, active=is_active,
            heartbeat_timeout=HEARTBEAT_TIMEOUT_S, heartbeat_period=self._period,
        )  # fmt: skip
        return serialize_message(status)


def make_bond(node: Node, period: float) -> Bond | None:
    """Bond a node that has just become active, with a heartbeat every `period` seconds.

    None, which is logged, where the message is not installed; None for a period of 0 or less.
    """
    if period <= 0.0:
        return None
    if Status is None:
        node.get_logger().info(
            'without the package bond: a lifecycle manager needs bond_timeout: 0.0', once=True
        )
        return None
    return Bond(node, period)
