# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A node's bond with Nav2's lifecycle manager: heartbeats from which it learns that a node died.

The protocol is that of ROS's package bond, of which only the message is needed: both ends publish
`bond/msg/Status` on the topic `bond`. See `bond.cpp` there, and `createBond` of nav2_util's
LifecycleNode, whose behaviour and constants these are.
"""

from __future__ import annotations

import threading
import time
import uuid

from builtin_interfaces.msg import Time
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

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
# At the end: how often to say so, and how long to wait until the manager has heard it.
DEAD_PUBLISH_PERIOD_S, FAREWELL_S = 0.05, 0.1


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
        # Read at each heartbeat, without an executor: the heartbeats of every other node of the
        # stack come here as well, and to be woken for each of them costs four times as much.
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
            if self.keep_alive():
                self.say_farewell()
        except (InvalidHandle, RCLError):
            if self._node.context.ok():
                raise

    def keep_alive(self) -> bool:
        """Publish heartbeats until `close`; tell whether a manager is there to be told of it.

        Without a manager after CONNECT_TIMEOUT_S, and after one that has ended the bond, there
        are no more.
        """
        is_formed = False
        give_up = time.monotonic() + CONNECT_TIMEOUT_S
        while is_formed or time.monotonic() < give_up:
            self.publish(is_active=True)
            closes = self._closed.wait(self._period)
            heard = self.heard()
            if heard is False:
                self.publish(is_active=False)
                self._logger.info('the lifecycle manager has ended the bond')
                return False
            is_formed = is_formed or heard is True
            if closes:
                return True
        return False

    def say_farewell(self) -> None:
        """Break the bond: publish it until the manager has heard it, for FAREWELL_S at most."""
        end = time.monotonic() + FAREWELL_S
        self.publish(is_active=False)
        while self.heard() is not False and time.monotonic() < end:
            time.sleep(DEAD_PUBLISH_PERIOD_S)
            self.publish(is_active=False)

    def heard(self) -> bool | None:
        """Return what the manager has said since the last call.

        True for a heartbeat, False for the end of the bond, None for nothing.
        """
        latest = None
        subscription = self._statuses.handle
        with subscription:
            while (taken := subscription.take_message(Status, True)) is not None:
                # Those of other nodes are not worth making a message of.
                if self._id.encode() not in taken[0]:
                    continue
                status = deserialize_message(taken[0], Status)
                if status.id == self._id and status.instance_id != self._instance_id:
                    latest = latest is not False and bool(status.active)
        return latest

    def publish(self, *, is_active: bool) -> None:
        """Publish a heartbeat, or the end of the bond."""
        seconds, nanoseconds = divmod(time.monotonic_ns(), 1_000_000_000)
        status = Status(
            header=Header(stamp=Time(sec=seconds, nanosec=nanoseconds)), id=self._id,
            instance_id=self._instance_id, active=is_active,
            heartbeat_timeout=HEARTBEAT_TIMEOUT_S, heartbeat_period=self._period,
        )  # fmt: skip
        self._publisher.publish(status)


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
