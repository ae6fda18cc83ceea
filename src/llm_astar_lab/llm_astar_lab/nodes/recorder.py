# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Records topics of the live graph into a bag, as serialized messages."""

import contextlib
import importlib
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_planner.nodes.common.spin import joined
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_check_compatible
from rclpy.subscription import Subscription

from llm_astar_lab.bags.types import NANOSECONDS, BagTypeError, TypeDefinition, define
from llm_astar_lab.bags.writing import BagWriter, OfferedTopic
from llm_astar_lab.bags.writing import qos as reliable_qos

# Of `recorded_topics.yaml`: the topics that an evaluation reads. Those of EXPECTED are subscribed
# to at once.
RECORDED = read_yaml(Path(__file__).with_name('recorded_topics.yaml'), BagTypeError)
EXPECTED: dict[str, list[str]] = RECORDED['expected']
TOPICS = (*EXPECTED, *RECORDED['others'])
NAME = 'llm_astar_recorder'
# How often to look for new topics, and to report the number of messages (s).
DISCOVERY_PERIOD_S = 0.25
REPORT_PERIOD_S = 10.0
# How long to wait for each message that has arrived when the recording ends (s).
DRAIN_TIMEOUT_S = 0.05
# How many messages of a topic wait while others are written.
DEPTH = 100

# What a type raises that is not installed here.
UNKNOWN_TYPE = (BagTypeError, ImportError, AttributeError)

# Prints a line for the user.
PrintLine = Callable[[str], None]


class Recorder:
    """Subscribes to topics, those of EXPECTED at once and others when their publishers appear.

    Every message is written as it comes.
    """

    def __init__(
        self, node: Node, bag: BagWriter, topics: Sequence[str], report: PrintLine
    ) -> None:
        """Record topics with these full names into an open bag; the caller spins `node`."""
        self._node = node
        self.bag = bag
        self._report, self._reported = report, 0
        # The topics that had no publisher so far.
        self.waiting = dict.fromkeys(topics)
        self._subscribed: dict[str, Subscription] = {}
        self._definitions: dict[str, TypeDefinition] = {}
        for relative, (msgtype, *latched) in EXPECTED.items():
            name = expand_topic_name(relative, NAME, node.get_namespace())
            # It may have no publisher yet, and its type may not be installed.
            if name in self.waiting:
                with contextlib.suppress(*UNKNOWN_TYPE):
                    self._subscribe(name, msgtype, recorder_qos(latched=bool(latched)))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(DISCOVERY_PERIOD_S, self._discover, clock=steady)

    def _discover(self) -> None:
        """Record topics that have a publisher by now, with a QoS that fits all of them."""
        for name in dict.fromkeys((*self.waiting, *self._subscribed)):
            msgtypes, offered = self._publishers(name)
            if offered and name in self.waiting:
                self._begin(name, msgtypes[0], offered)
            elif offered and requests_too_much(self._subscribed[name].qos_profile, offered):
                self._subscribe(name, self._definitions[name].msgtype, matching_qos(offered))
                self._report(f'subscribed to {name} again, since a new publisher offers less')

    def _publishers(self, topic: str) -> tuple[list[str], list[QoSProfile]]:
        """Return the types and the QoS that a topic's publishers offer."""
        found = self._node.get_publishers_info_by_topic(topic)
        return [one.topic_type for one in found], [one.qos_profile for one in found]

    def _begin(self, name: str, msgtype: str, offered: list[QoSProfile]) -> None:
        """Add a topic to the bag and subscribe to it as it is offered, if its type is installed.

        No message has come yet: one that a new subscription receives again is written once.
        """
        try:
            self._subscribe(name, msgtype, matching_qos(offered))
        except UNKNOWN_TYPE as error:
            del self.waiting[name]
            if name in self._subscribed:
                self._node.destroy_subscription(self._subscribed.pop(name))
            self._report(f'not recorded: {name} ({msgtype}): {error}')
        else:
            self._add_topic(name, offered)

    def _add_topic(self, name: str, offered: list[QoSProfile]) -> None:
        """Add a topic to the bag."""
        del self.waiting[name]
        definition = self._definitions[name]
        different = {str(profile): profile for profile in map(bag_qos, offered)}
        self.bag.add_topic(OfferedTopic(name, definition, tuple(different.values())))
        self._report(f'recording {name} ({definition.msgtype})')

    def _subscribe(self, name: str, msgtype: str, qos: QoSProfile) -> None:
        """Subscribe, unless a subscription is the same.

        Another one is replaced, since two would write each message twice. Raises one of
        UNKNOWN_TYPE.
        """
        definition, message_class = define(msgtype), import_message_class(msgtype)
        before = self._subscribed.get(name)
        if before is not None:
            if (before.msg_type, before.qos_profile) == (message_class, qos):
                return
            self._node.destroy_subscription(before)
        self._definitions[name] = definition
        self._subscribed[name] = self._node.create_subscription(
            message_class, name, partial(self._on_message, name), qos, raw=True
        )

    def _on_message(self, topic: str, data: bytes, info: dict[str, Any]) -> None:
        """Write a message with the time at which it arrived."""
        if topic in self.waiting:
            # Its publisher has not been looked for yet, and may have left already.
            _, offered = self._publishers(topic)
            self._add_topic(topic, offered or [self._subscribed[topic].qos_profile])
        # 0 where the middleware does not know that time.
        self.bag.write(topic, info['received_timestamp'] or time.time_ns(), data)

    def report_progress(self) -> None:
        """Report the number of messages; without any, the namespace and domain searched."""
        total, before = self.bag.total, self._reported
        self._reported = total
        new = f'{total - before} of them in the last {REPORT_PERIOD_S:g} s'
        domain = os.environ.get('ROS_DOMAIN_ID', '0')
        where = f'namespace {self._node.get_namespace()}, ROS_DOMAIN_ID {domain}'
        nothing = f'no message yet in {where}; is the graph up?'
        self._report(f'{total} messages, {new}' if total else nothing)


def record(
    writer: BagWriter, topics: Sequence[str], namespace: str, duration: float, report: PrintLine
) -> None:
    """Record topics into a bag until SIGINT, SIGTERM or the end of `duration` (s).

    `report` gets a line for every topic found, and regularly one on the number of messages. Raises
    BagWriteError where the disk is full or fails, OSError where the bag's folder cannot be made,
    ValueError for invalid names.
    """
    namespace = '/' + namespace.strip('/')
    topics = full_names(topics, namespace)
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    # The bag is closed first, since leaving the graph may end the process.
    with joined(NAME, namespace) as node, writer as bag:
        recorder = Recorder(node, bag, topics, report)
        spin_until(stopped, node, recorder, duration)
        if recorder.waiting:
            report(f'never there: {", ".join(recorder.waiting)}')


def spin_until(stopped: threading.Event, node: Node, recorder: Recorder, duration: float) -> None:
    """Record until `stopped` is set or `duration` seconds have passed, then write what arrived."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end, next_report = time.monotonic() + duration, time.monotonic() + REPORT_PERIOD_S
    while not stopped.is_set() and time.monotonic() < end:
        executor.spin_once(timeout_sec=DISCOVERY_PERIOD_S)
        if time.monotonic() >= next_report:
            recorder.report_progress()
            next_report = time.monotonic() + REPORT_PERIOD_S
    # Bounded by the queues, since a busy graph publishes for ever. The timer takes turns, too, so
    # one turn without a message does not mean that all are written.
    quiet = 0
    for _ in range(DEPTH * len(recorder.bag.counts)):
        count = recorder.bag.total
        executor.spin_once(timeout_sec=DRAIN_TIMEOUT_S)
        quiet = quiet + 1 if recorder.bag.total == count else 0
        if quiet == 4:
            break
    executor.shutdown()


def full_names(topics: Sequence[str], namespace: str) -> list[str]:
    """Return the full names of topics; those without a leading slash are in the namespace.

    Raises ValueError for invalid names.
    """
    try:
        return list(dict.fromkeys(expand_topic_name(name, NAME, namespace) for name in topics))
    except ValueError as error:
        # The rest of the message is a line of rcl's source code.
        raise ValueError(str(error).partition(', at /')[0]) from None


def import_message_class(msgtype: str) -> type:
    """Return the class of `package/msg/Name` or `package/srv/Name_Event`.

    Raises ImportError or AttributeError where its package of messages is not installed here. Any
    participant of the graph names types, so no other package is imported.
    """
    package, kind, name = msgtype.split('/')
    found = find_spec(package) if package.isidentifier() else None
    folders = [] if found is None else found.submodule_search_locations or []
    support = f'{package}_s__rosidl_typesupport_c*'
    if not any(next(Path(folder).glob(support), None) for folder in folders):
        raise ImportError(f'{package} is no package of ROS messages')
    module = importlib.import_module(f'{package}.{kind}')
    if kind == 'srv':
        return getattr(module, name.removesuffix('_Event')).Event
    return getattr(module, name)


def requests_too_much(requested: QoSProfile, offered: list[QoSProfile]) -> bool:
    """Tell whether a subscription requests more than one of these publishers offers."""
    return any(qos_check_compatible(qos, requested)[0].name == 'ERROR' for qos in offered)


def matching_qos(offered: list[QoSProfile]) -> QoSProfile:
    """Return the QoS of a subscription that receives most from all of these publishers."""
    reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
    latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    return recorder_qos(reliable=reliable, latched=latched)


def recorder_qos(*, reliable: bool = True, latched: bool) -> QoSProfile:
    """Return the QoS of a subscription whose messages wait while others are written."""
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def bag_qos(offered: QoSProfile) -> dict[str, Any]:
    """Return a publisher's QoS as a bag holds it."""
    values = reliable_qos(offered.depth)
    values['avoid_ros_namespace_conventions'] = offered.avoid_ros_namespace_conventions
    for name in ('durability', 'history', 'liveliness', 'reliability'):
        values[name] = getattr(offered, name).name.lower()
    for name in ('deadline', 'lifespan', 'liveliness_lease_duration'):
        seconds, rest = divmod(getattr(offered, name).nanoseconds, NANOSECONDS)
        values[name] = {'nsec': rest, 'sec': seconds}
    return values
