# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The publishers, subscriptions and services of one part of a node, and calls of services."""

import contextlib
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from rcl_interfaces.srv import SetParameters
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.task import Future
from rclpy.waitable import NumberOfEntities, Waitable

_T = TypeVar('_T')


def latched(depth: int) -> QoSProfile:
    """Return a reliable profile by which who subscribes late gets the last messages."""
    durability = DurabilityPolicy.TRANSIENT_LOCAL
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


# As map_server publishes: a subscriber that joins late gets the last map.
LATCHED = latched(1)
# As LATCHED, of several publishers: the last message of each.
LATCHED_BY_MANY = latched(10)
# Reports that belong to a service's response: a client that is discovered late gets them too.
REPORTS = latched(10)
# For who waits for the reports of many calls at once, of which none may be lost.
REPORTS_OF_CALLS = latched(256)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
# Map updates: none may be lost, since each changes another part of the map.
UPDATES = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# Requests that wait until a thread is free, and their answers: with the default of 10, those of
# many callers at once would be lost, on both sides: a client's queue also holds the responses to
# all other clients until it has looked at them.
CALLS = QoSProfile(depth=4096, reliability=ReliabilityPolicy.RELIABLE)
# Heartbeats of a bond as bondcpp sends and takes them, those of all other nodes included.
BOND_HEARTBEATS = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
BOND = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# Requests of one service that wait at most, and that are taken before they are looked at.
MOST_WAITING, MOST_AT_ONCE = 128, 1024
QUIET_SECONDS = 1.0
# Each event handler is looked at each time that an executor wakes up; subscriptions have those
# that warn of a publisher with another profile.
NO_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
# Seconds without a response after which a service is asked again; twice as long each time.
ASK_AGAIN_S = 3.0


class Entities:
    """Creates entities on a node and destroys all of them in `close`."""

    def __init__(self, node: Node) -> None:
        """Take the node on which to create them."""
        self.node = node
        self._undo: list[Callable[[], Any]] = []

    def publisher(self, kind: type, name: str, qos: QoSProfile) -> Publisher:
        """Create a publisher, without the event handlers that an executor waits for."""
        made = self.node.create_publisher(kind, name, qos, event_callbacks=NO_EVENTS)
        return self._keep(made, self.node.destroy_publisher)

    def subscription(
        self,
        kind: type,
        name: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        group: CallbackGroup,
    ) -> None:
        """Create a subscription."""
        made = self.node.create_subscription(kind, name, callback, qos, callback_group=group)
        self._keep(made, self.node.destroy_subscription)

    def service(
        self,
        kind: type,
        name: str,
        callback: Callable[[Any, Any], Any] | None,
        group: CallbackGroup,
    ) -> Service:
        """Create a service that loses no request of many callers."""
        made = self.node.create_service(
            kind, name, callback, qos_profile=CALLS, callback_group=group
        )
        return self._keep(made, self.node.destroy_service)

    def timer(self, seconds: float, callback: Callable[[], None], group: CallbackGroup) -> None:
        """Create a timer of a steady clock.

        That of the node may jump back, or stand still where time is simulated.
        """
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        made = self.node.create_timer(seconds, callback, callback_group=group, clock=steady)
        self._keep(made, self.node.destroy_timer)

    def _keep(self, made: _T, destroy: Callable[[_T], Any]) -> _T:
        self._undo.append(lambda: destroy(made))
        return made

    def on_close(self, undo: Callable[[], Any]) -> None:
        """Call `undo` in `close`, in its turn."""
        self._undo.append(undo)

    def close(self) -> None:
        """Destroy everything, in reverse order of creation."""
        while self._undo:
            self._undo.pop()()


class LoggedThread(ThreadPoolExecutor):
    """A thread that runs what is submitted one after the other, and logs each exception."""

    def __init__(self, entities: Entities, name: str, *, drops_rest: bool = False) -> None:
        """Run until the entities are closed; with `drops_rest` what waits then is not run."""
        super().__init__(1, name)
        self._node = entities.node
        entities.on_close(lambda: self.shutdown(cancel_futures=drops_rest))

    def run(self, task: Callable[..., None], *arguments: Any) -> None:  # noqa: ANN401 - the task's
        """Have a task run on the thread."""
        self.submit(self._logged, task, *arguments)

    def _logged(self, task: Callable[..., None], *arguments: Any) -> None:  # noqa: ANN401
        try:
            task(*arguments)
        except Exception:  # noqa: BLE001 - a failure on this thread must not go unnoticed
            # After a signal nothing can be published any more, which is no failure.
            if self._node.context.ok():
                self._node.get_logger().error(traceback.format_exc())


class UntakenCallbackGroup(MutuallyExclusiveCallbackGroup):
    """Keeps an executor from taking what is taken in another way."""

    def can_execute(self, _: Any) -> bool:  # noqa: ANN401 - rclpy's own
        """Tell that nothing may run."""
        return False


class QueuedService(Waitable):
    """A service that takes every request at once: it is answered, waits, or hears that it is busy.

    So none waits in the middleware, which drops what is too much without a sign. rclpy does not
    tell which client asked, so the limits are for all clients together.
    """

    def __init__(
        self,
        entities: Entities,
        kind: Any,  # noqa: ANN401 - a service type
        name: str,
        answer: Callable[[Any, Any, float, str], Any],
        *,
        threads: int,
    ) -> None:
        """Serve on so many threads, the oldest request first.

        `answer` gets a request, its response to fill, when it arrived in monotonic seconds, and
        ''. Of requests that come while MOST_WAITING wait it gets the first, and why all those that
        came together are refused with its response.
        """
        super().__init__(MutuallyExclusiveCallbackGroup())
        self._kind = kind
        self._answer = answer
        self._logger, self._context = entities.node.get_logger(), entities.node.context
        self._lock = threading.Lock()
        self._waiting = self._index = 0
        self.service = entities.service(kind, name, None, UntakenCallbackGroup())
        self._pool = ThreadPoolExecutor(threads, 'callers')
        entities.on_close(lambda: self._pool.shutdown(wait=False, cancel_futures=True))
        entities.node.add_waitable(self)
        entities.on_close(lambda: entities.node.remove_waitable(self))

    def __enter__(self) -> None:
        """Keep the service from being destroyed while the executor waits for it."""
        self.service.handle.__enter__()

    def __exit__(self, *error: object) -> None:
        """Let it be destroyed again."""
        self.service.handle.__exit__(*error)

    def get_num_entities(self) -> NumberOfEntities:
        """Return what the executor waits for: one service."""
        return NumberOfEntities(num_services=1)

    def add_to_wait_set(self, wait_set: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Have the executor wait for requests."""
        self._index = wait_set.add_service(self.service.handle)

    def is_ready(self, wait_set: Any) -> bool:  # noqa: ANN401 - rclpy's own
        """Tell whether a request has come."""
        return bool(wait_set.is_ready('service', self._index))

    def take_data(self) -> list[tuple[Any, Any]]:
        """Take the requests that have come, with their headers; at most one round's worth."""
        taken: list[tuple[Any, Any]] = []
        with contextlib.suppress(InvalidHandle), self.service.handle:
            while len(taken) < MOST_AT_ONCE:
                request, header = self.service.handle.service_take_request(self._kind.Request)
                if header is None:
                    break
                taken.append((request, header))
        return taken

    async def execute(self, taken: list[tuple[Any, Any]]) -> None:
        """Have requests wait for a thread, or refuse them."""
        now = time.monotonic()
        with self._lock:
            count = min(len(taken), max(0, MOST_WAITING - self._waiting))
            self._waiting += count
        with contextlib.suppress(RuntimeError):  # of a pool that was closed meanwhile
            for one in taken[:count]:
                self._pool.submit(self._respond, [one], now)
        if refused := taken[count:]:
            busy = f'busy: {MOST_WAITING} requests are waiting; {len(refused)} more were refused'
            self._logger.warning(busy, throttle_duration_sec=QUIET_SECONDS)
            self._respond(refused, now, busy)

    def _respond(self, requests: list[tuple[Any, Any]], arrived: float, busy: str = '') -> None:
        """Answer the first request, and all with its response."""
        if not busy:
            with self._lock:
                self._waiting -= 1
        try:
            response = self._answer(requests[0][0], self._kind.Response(), arrived, busy)
            for _, header in requests:
                self.service.send_response(response, header)
        except InvalidHandle:  # the node has left the graph
            pass
        except Exception:  # noqa: BLE001 - its thread serves others too
            if self._context.ok():  # else the process ends, and nobody is told
                self._logger.error(traceback.format_exc())


def ask(client: Client, request: Any, seconds: float, ask_again: float = ASK_AGAIN_S) -> Any:  # noqa: ANN401 - any service
    """Return the first response to a request, None if none comes within `seconds`.

    The request is sent again after `ask_again` seconds, so it must do no harm twice: a service
    that has not discovered its caller yet, while the caller has discovered it, drops the response.
    The caller's node has to be spun by somebody else.
    """
    deadline = time.monotonic() + seconds
    done = threading.Event()
    asked: list[Future] = []
    try:
        while not asked or time.monotonic() < deadline:
            asked.append(client.call_async(request))
            asked[-1].add_done_callback(lambda _: done.set())
            if done.wait(max(0.0, min(ask_again, deadline - time.monotonic()))):
                return next(future for future in asked if future.done()).result()
            ask_again *= 2.0
        return None
    finally:
        for future in asked:
            client.remove_pending_request(future)


def setting(values: Mapping[str, Any]) -> SetParameters.Request:
    """Return the request that sets parameters."""
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    return SetParameters.Request(parameters=[one.to_parameter_msg() for one in parameters])
