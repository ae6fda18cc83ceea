"""Nav2's side of a managed node's life: the lifecycle manager's sequence and its bonds.

Written after nav2_lifecycle_manager, nav2_util's service clients and bondcpp (branch jazzy):
the same services, topics, waits, order and time limits.
"""

import threading
import time
import uuid
from enum import Enum, auto

from bond.msg import Status
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

BOND_TIMEOUT = 4.0
HEARTBEAT_PERIOD = 0.1
CONNECT_TIMEOUT = 10.0
DISCONNECT_TIMEOUT = 2.0
DEAD_PUBLISH_PERIOD = 0.05
CHECK_PERIOD = 0.2
RESPAWN_PERIOD = 1.0
SERVICE_SECONDS = 5.0
STATE_SECONDS = 2.0
# Where Nav2 waits for a transition without a limit.
TRANSITION_SECONDS = 60.0


class BondState(Enum):
    WAITING = auto()
    ALIVE = auto()
    AWAIT_DEATH = auto()
    DEAD = auto()


class Bond:
    """One end of a bond; both ends publish on `bond`, told apart by their instance ids."""

    def __init__(self, node, bond_id, heartbeat_timeout=BOND_TIMEOUT):
        """Start to publish and to listen. `heartbeat_timeout` in seconds; None: never dead."""
        self.state = BondState.WAITING
        self._changed = threading.Condition()
        self._node, self._id, self._instance = node, bond_id, str(uuid.uuid4())
        self._timeout = heartbeat_timeout
        self._last_heard = self._started = self._died = time.monotonic()
        self._last_sent = 0.0
        group = ReentrantCallbackGroup()
        self._publisher = node.create_publisher(Status, 'bond', 5, callback_group=group)
        self._subscription = node.create_subscription(
            Status, 'bond', self._on_status, 100, callback_group=group
        )
        self._timer = node.create_timer(DEAD_PUBLISH_PERIOD, self._on_time, callback_group=group)

    def wait_until_formed(self, seconds):
        return self._wait_for(lambda: self.state is not BondState.WAITING, seconds)

    def wait_until_broken(self, seconds):
        return self._wait_for(lambda: self.state is BondState.DEAD, seconds)

    @property
    def is_broken(self):
        return self.state is BondState.DEAD

    def close(self):
        """Break the bond, wait as bondcpp's destructor does, and leave the graph."""
        with self._changed:
            is_alive = self.state is BondState.ALIVE
            self._died = time.monotonic()
            self._set(BondState.AWAIT_DEATH if is_alive else BondState.DEAD)
        self._publish(False)
        self.wait_until_broken(0.1)
        self._node.destroy_timer(self._timer)
        self._node.destroy_subscription(self._subscription)
        self._node.destroy_publisher(self._publisher)

    def _wait_for(self, condition, seconds):
        with self._changed:
            return self._changed.wait_for(condition, seconds)

    def _set(self, state):
        with self._changed:
            self.state = state
            self._changed.notify_all()

    def _on_status(self, message):
        if message.id != self._id or message.instance_id == self._instance:
            return
        with self._changed:
            if not message.active:
                if self.state in (BondState.WAITING, BondState.ALIVE):
                    self._publish(False)
                self._set(BondState.DEAD)
            elif self.state in (BondState.WAITING, BondState.ALIVE):
                self._last_heard = time.monotonic()
                self._set(BondState.ALIVE)

    def _on_time(self):
        now = time.monotonic()
        with self._changed:
            if self.state is BondState.WAITING and now - self._started > CONNECT_TIMEOUT:
                self._set(BondState.DEAD)
            elif self.state is BondState.ALIVE and self._timeout is not None:
                if now - self._last_heard > self._timeout:
                    self._set(BondState.DEAD)
            elif self.state is BondState.AWAIT_DEATH and now - self._died > DISCONNECT_TIMEOUT:
                self._set(BondState.DEAD)
            state = self.state
        if state is BondState.AWAIT_DEATH:
            self._publish(False)
        elif state is not BondState.DEAD and now - self._last_sent >= HEARTBEAT_PERIOD:
            self._last_sent = now
            self._publish(True)

    def _publish(self, active):
        message = Status(id=self._id, instance_id=self._instance, active=active)
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.heartbeat_timeout = float(self._timeout or BOND_TIMEOUT)
        message.heartbeat_period = HEARTBEAT_PERIOD
        self._publisher.publish(message)


class ServiceError(RuntimeError):
    """What nav2_util's clients throw: a service that is not there or does not answer."""


class LifecycleClient:
    """The two services of one managed node; made once they are there."""

    def __init__(self, node, name):
        group = ReentrantCallbackGroup()
        self._change = node.create_client(
            ChangeState, f'{name}/change_state', callback_group=group
        )
        self._get = node.create_client(GetState, f'{name}/get_state', callback_group=group)
        deadline = time.monotonic() + TRANSITION_SECONDS
        while not self._get.wait_for_service(STATE_SECONDS):
            assert time.monotonic() < deadline, f'{name}/get_state never came'

    def change_state(self, transition):
        if not self._change.wait_for_service(SERVICE_SECONDS):
            raise ServiceError('change_state service is not available!')
        request = ChangeState.Request()
        request.transition.id = transition
        # Nav2 does not look at `success` either: the state afterwards decides.
        self._call(self._change, request, TRANSITION_SECONDS)

    def get_state(self):
        if not self._get.wait_for_service(STATE_SECONDS):
            raise ServiceError('get_state service is not available!')
        return self._call(self._get, GetState.Request(), STATE_SECONDS).current_state.id

    def _call(self, client, request, seconds):
        done = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        if not done.wait(seconds):
            client.remove_pending_request(future)
            raise ServiceError(f'{client.srv_name} service client: async_send_request failed')
        return future.result()


STATE_AFTER = {
    Transition.TRANSITION_CONFIGURE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_CLEANUP: State.PRIMARY_STATE_UNCONFIGURED,
    Transition.TRANSITION_ACTIVATE: State.PRIMARY_STATE_ACTIVE,
    Transition.TRANSITION_DEACTIVATE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN: State.PRIMARY_STATE_FINALIZED,
}
IN_REVERSE = {
    Transition.TRANSITION_DEACTIVATE,
    Transition.TRANSITION_CLEANUP,
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
}


class LifecycleManager(Node):
    """Brings nodes up in order, bonds with each, and takes all down when one is gone.

    Its methods are called from a thread of their own while the node is spun.
    """

    def __init__(self, node_names, bond_timeout=BOND_TIMEOUT, namespace=None):
        super().__init__('lifecycle_manager_navigation', namespace=namespace)
        self._names, self._bond_timeout = node_names, bond_timeout
        self.managed = {}
        self._bonds = {}
        self._is_checking = False
        self.is_active = False
        self.broken = None
        self.broken_at = None
        self.went_down = threading.Event()
        group = ReentrantCallbackGroup()
        self.create_timer(CHECK_PERIOD, self._check_bonds, callback_group=group)

    def connect(self):
        """Wait for the lifecycle services of each node, in order."""
        for name in self._names:
            self.managed[name] = LifecycleClient(self, name)

    def startup(self):
        """Configure all, then activate each and bond with it."""
        self.is_active = self._change_all(Transition.TRANSITION_CONFIGURE) and self._change_all(
            Transition.TRANSITION_ACTIVATE
        )
        return self._watch()

    def pause(self):
        self._is_checking = self.is_active = False
        return self._change_all(Transition.TRANSITION_DEACTIVATE)

    def resume(self):
        self.is_active = self._change_all(Transition.TRANSITION_ACTIVATE)
        return self._watch()

    def reset(self, hard=False):
        self._is_checking = self.is_active = False
        deactivated = self._change_all(Transition.TRANSITION_DEACTIVATE, hard)
        return deactivated and self._change_all(Transition.TRANSITION_CLEANUP, hard)

    def shutdown(self):
        self._is_checking = self.is_active = False
        self._change_all(Transition.TRANSITION_DEACTIVATE)
        self._change_all(Transition.TRANSITION_CLEANUP)
        return self._change_all(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)

    def wait_for_respawn(self, seconds):
        """Ask all nodes every second until all answer again; tell whether they do."""
        deadline = time.monotonic() + seconds
        while not self._all_answer():
            if time.monotonic() > deadline:
                return False
            time.sleep(RESPAWN_PERIOD)
        return True

    def _all_answer(self):
        try:
            return len(self.states()) == len(self._names)
        except ServiceError:
            return False

    def states(self):
        return [self.managed[name].get_state() for name in self._names]

    def destroy_node(self):
        self._is_checking = False
        for bond in self._bonds.values():
            bond.close()
        super().destroy_node()

    def _watch(self):
        self._is_checking = self.is_active and self._bond_timeout > 0.0
        return self.is_active

    def _change_all(self, transition, hard=False):
        names = self._names[::-1] if transition in IN_REVERSE else self._names
        try:
            for name in names:
                if not self._change(name, transition) and not hard:
                    return False
        except ServiceError as error:
            self.get_logger().error(f'failed to change state for node: {name}: {error}')
            return False
        return True

    def _change(self, name, transition):
        client = self.managed[name]
        client.change_state(transition)
        state = client.get_state()
        if state != STATE_AFTER[transition]:
            self.get_logger().error(f'{name} is in state {state} after transition {transition}')
            return False
        if transition == Transition.TRANSITION_ACTIVATE:
            return self._form_bond(name)
        if transition == Transition.TRANSITION_DEACTIVATE and name in self._bonds:
            self._bonds.pop(name).close()
        return True

    def _form_bond(self, name):
        if name in self._bonds or self._bond_timeout <= 0.0:
            return True
        self._bonds[name] = bond = Bond(self, name, self._bond_timeout)
        if bond.wait_until_formed(self._bond_timeout / 2.0):
            return True
        self.get_logger().error(f'server {name} was unable to be reached by bond')
        return False

    def _check_bonds(self):
        if not (self._is_checking and self.is_active):
            return
        broken = next((name for name in self._names if self._bonds[name].is_broken), None)
        if broken is None:
            return
        self._is_checking = False
        self.broken, self.broken_at = broken, time.monotonic()
        threading.Thread(target=self._take_down, daemon=True).start()

    def _take_down(self):
        # Nav2 asks the dead node too, and may wait until DDS has given it up.
        names, self._names = self._names, [name for name in self._names if name != self.broken]
        self.reset(hard=True)
        self._names = names
        for bond in self._bonds.values():
            bond.close()
        self._bonds.clear()
        self.went_down.set()
