"""A recorder of the live graph: whatever comes on its topics goes into a bag as it came."""

from __future__ import annotations

import importlib
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import rclpy
from llm_astar_msgs_adapter.bags.types import BagTypeError, define
from llm_astar_msgs_adapter.bags.writing import BagWriter, OfferedTopic
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from llm_astar_planner.nodes.common.spin import leave

# What an evaluation reads, names relative to the namespace recorded.
TOPICS = (
    'map',
    'map_updates',
    'goal_pose',
    'initialpose',
    'amcl_pose',
    'plan',
    'planner_node/get_plan/_service_event',
    'planner_node/raw_plan',
    'planner_node/report',
    'planner_node/instruction',
    'llm_client_node/exchange',
    'odom',
    'tf',
    'tf_static',
    '/tf',
    '/tf_static',
    '/diagnostics',
)
NAME = 'llm_astar_recorder'
# How often new topics are looked for, and the user is told that nothing comes, in seconds.
LOOK_EVERY = 0.25
TELL_EVERY = 10.0
QUIET_SECONDS = 0.05
# Messages of a topic that wait while others are written.
DEPTH = 100
NANOSECONDS = 1_000_000_000

Tell = Callable[[str], None]


class Recorder(Node):
    """Subscribes to topics as their publishers come, and writes what they send."""

    def __init__(self, bag: BagWriter, topics: Sequence[str], namespace: str, tell: Tell) -> None:
        """Record topics of these full names into an open bag, from within a namespace."""
        super().__init__(NAME, namespace=namespace)
        self._bag = bag
        self._tell = tell
        self.wanted = topics
        self._waiting = set(topics)
        self._subscribed: dict[str, Subscription] = {}
        self.create_timer(LOOK_EVERY, self._look)

    def _look(self) -> None:
        """Subscribe to what is wanted and has a publisher by now, on terms that suit them all."""
        for name, types in self.get_topic_names_and_types():
            if name not in self._waiting and name not in self._subscribed:
                continue
            offered = [found.qos_profile for found in self.get_publishers_info_by_topic(name)]
            if not offered:
                continue
            if name in self._waiting:
                self._waiting.discard(name)
                self._begin(name, types[0], offered)
            elif _misses_any(self._subscribed[name].qos_profile, offered):
                self._subscribe(name, self._subscribed[name].msg_type, offered)
                self._tell(f'subscribed to {name} anew, as a publisher that came offers less')

    def _begin(self, name: str, msgtype: str, offered: list[QoSProfile]) -> None:
        try:
            topic = OfferedTopic(
                name, define(msgtype), tuple(dict.fromkeys(map(_qos_in_bag, offered)))
            )
            message_class = _message_class(msgtype)
        except (BagTypeError, ImportError, AttributeError) as error:
            self._tell(f'not recorded: {name} ({msgtype}): {error}')
            return
        self._bag.add_topic(topic)
        self._subscribe(name, message_class, offered)
        self._tell(f'recording {name} ({msgtype})')

    def _subscribe(self, name: str, message_class: type, offered: list[QoSProfile]) -> None:
        """Subscribe in place of what was subscribed before: two would write everything twice."""
        if name in self._subscribed:
            self.destroy_subscription(self._subscribed[name])
        self._subscribed[name] = self.create_subscription(
            message_class, name, partial(self._on_message, name), _matching(offered), raw=True
        )

    def _on_message(self, topic: str, data: bytes, info: dict[str, Any]) -> None:
        """Write a message at the time it arrived, not the later one at which its turn came."""
        # Not every middleware knows that time; those that do not say 0.
        self._bag.write(topic, info['received_timestamp'] or time.time_ns(), data)

    def tell_progress(self, total: int, new: int) -> None:
        """Tell how much came, and where nothing did, where it was looked for."""
        if total:
            self._tell(f'{total} messages, {new} of them in the last {TELL_EVERY:g} s')
            return
        domain = os.environ.get('ROS_DOMAIN_ID', '0')
        self._tell(
            f'nothing has come yet in namespace {self.get_namespace()}, ROS_DOMAIN_ID {domain}; '
            'is the graph up?'
        )

    @property
    def missing(self) -> list[str]:
        """The topics that had no publisher yet."""
        return [name for name in self.wanted if name in self._waiting]


@dataclass(frozen=True)
class Options:
    """What to record and into what; see BagWriter. `duration` is in seconds."""

    folder: str
    storage: str = 'mcap'
    max_bytes: int = 0
    duration: float = math.inf
    topics: tuple[str, ...] = TOPICS
    namespace: str = ''


def record(options: Options, tell: Tell) -> dict[str, int]:
    """Record until SIGINT, SIGTERM or the end of `duration`; return the messages by topic.

    `tell` gets a line on every topic found, and now and then on what came. Raises BagWriteError
    where the folder exists or the disk takes no more, OSError where it cannot be made, ValueError
    for names that cannot be.
    """
    namespace = '/' + options.namespace.strip('/')
    topics = _full_names(options.topics, namespace)
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    writer = BagWriter(options.folder, options.storage, options.max_bytes)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        with writer as bag:
            recorder = Recorder(bag, topics, namespace, tell)
            _spin(recorder, bag, stopped, options.duration)
            if recorder.missing:
                tell(f'never there: {", ".join(recorder.missing)}')
        # Only now that the bag is closed: it may end the process.
        leave(recorder)
    finally:
        rclpy.try_shutdown()
    return writer.counts


def _spin(recorder: Recorder, bag: BagWriter, stopped: threading.Event, duration: float) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(recorder)
    end = time.monotonic() + duration
    told, next_tell = 0, time.monotonic() + TELL_EVERY
    while not stopped.is_set() and time.monotonic() < end:
        executor.spin_once(timeout_sec=LOOK_EVERY)
        if time.monotonic() >= next_tell:
            recorder.tell_progress(bag.total, bag.total - told)
            told, next_tell = bag.total, time.monotonic() + TELL_EVERY
    _drain(executor, bag)
    executor.shutdown()


def _drain(executor: SingleThreadedExecutor, bag: BagWriter) -> None:
    """Write what had arrived when the end came, but do not follow a graph that talks on."""
    quiet = 0
    for _ in range(DEPTH * len(bag.counts)):
        count = bag.total
        executor.spin_once(timeout_sec=QUIET_SECONDS)
        # The timer takes turns, too.
        quiet = quiet + 1 if bag.total == count else 0
        if quiet == 4:
            return


def _full_names(topics: Sequence[str], namespace: str) -> list[str]:
    """Return topics' full names, those without a slash in front below a namespace.

    Raises ValueError for what no topic or no namespace can be called.
    """
    try:
        return list(dict.fromkeys(expand_topic_name(name, NAME, namespace) for name in topics))
    except ValueError as error:
        # Behind it stands a place in the source of rcl.
        raise ValueError(str(error).partition(', at /')[0]) from None


def _message_class(msgtype: str) -> type:
    """Return the class of `package/msg/Name` or `package/srv/Name_Event`.

    Raises ImportError or AttributeError where its package is not installed here.
    """
    package, kind, name = msgtype.split('/')
    module = importlib.import_module(f'{package}.{kind}')
    if kind == 'srv':
        return getattr(module, name.removesuffix('_Event')).Event
    return getattr(module, name)


def _misses_any(asked: QoSProfile, offered: list[QoSProfile]) -> bool:
    """Tell whether a subscription asks for more than some of these publishers offer."""
    return any(qos_check_compatible(qos, asked)[0] == QoSCompatibility.ERROR for qos in offered)


def _matching(offered: list[QoSProfile]) -> QoSProfile:
    """Return the QoS that gets the most of all of these publishers."""
    reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
    latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE),
    )


def _qos_in_bag(offered: QoSProfile) -> Qos:
    return Qos(
        history=QosHistory[offered.history.name],
        depth=offered.depth,
        reliability=QosReliability[offered.reliability.name],
        durability=QosDurability[offered.durability.name],
        deadline=_span(offered.deadline),
        lifespan=_span(offered.lifespan),
        liveliness=QosLiveliness[offered.liveliness.name],
        liveliness_lease_duration=_span(offered.liveliness_lease_duration),
        avoid_ros_namespace_conventions=offered.avoid_ros_namespace_conventions,
    )


def _span(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, NANOSECONDS))
