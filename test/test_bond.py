"""The bond of a managed node, seen from the end of the lifecycle manager.

The manager's own sequence, and what it does about a node that is killed: test_nav2_clients.py.
"""

import contextlib
import time
import uuid

import pytest
import rclpy
from graph_tools import GOAL, START, calling, running, wait_for
from llm_astar_planner.nodes.common import bond
from llm_astar_planner.nodes.common.spin import SpinThread
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from rclpy.parameter import Parameter

needs_bond = pytest.mark.skipif(
    bond.Status is None, reason='bond is not installed, of which there is no wheel'
)
# The manager's own (nav2_lifecycle_manager).
MANAGER_PERIOD = 0.1


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


class ManagerBond:
    """The manager's end of a bond: publishes heartbeats, and keeps those of the node."""

    def __init__(self, namespace, name):
        self.heard = []  # (monotonic time, whether it was a heartbeat)
        self._name = name
        self._instance = str(uuid.uuid4())
        self._node = rclpy.create_node('lifecycle_manager', namespace=namespace)
        self._publisher = self._node.create_publisher(bond.Status, 'bond', 5)
        self._node.create_subscription(bond.Status, 'bond', self._on_status, 100)
        self._alive = self._node.create_timer(MANAGER_PERIOD, lambda: self.publish(is_active=True))
        self._thread = SpinThread(self._node)

    def _on_status(self, status):
        if status.id == self._name and status.instance_id != self._instance:
            self.heard.append((time.monotonic(), status.active))

    def publish(self, *, is_active):
        self._publisher.publish(
            bond.Status(id=self._name, instance_id=self._instance, active=is_active)
        )

    def be_silent(self):
        self._alive.cancel()

    def end(self):
        """Break the bond, as a manager that is shut down does."""
        self.be_silent()
        self.publish(is_active=False)

    @property
    def is_formed(self):
        return bool(self.heard) and self.heard[-1][1]

    def close(self):
        self._thread.close()
        self._node.destroy_node()


@contextlib.contextmanager
def bonded(namespace, name='planner_node'):
    manager = ManagerBond(namespace, name)
    try:
        yield manager
    finally:
        manager.close()


def make_node(namespace, **parameters):
    values = {'autostart': False, 'llm_client': '', **parameters}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return PlannerNode(namespace=namespace, parameter_overrides=overrides)


@needs_bond
def test_an_active_node_is_bonded_and_breaks_the_bond_when_it_is_deactivated():
    node = make_node('/bonded')
    with running(node), calling('/bonded') as caller:
        node.trigger_configure()
        for _ in range(2):
            with bonded('/bonded') as manager:
                node.trigger_activate()
                wait_for(lambda manager=manager: manager.is_formed, 'the bond')
                wait_for(lambda manager=manager: len(manager.heard) > 5, 'more heartbeats')
                assert all(is_active for _, is_active in manager.heard)
                node.trigger_deactivate()
                wait_for(lambda manager=manager: not manager.heard[-1][1], 'the farewell')
        wait_for(lambda: not caller.node.count_publishers('bond'), 'its leaving')


@needs_bond
def test_heartbeats_need_no_thread_of_the_executor():
    node = make_node('/busy')  # spun by nobody
    with bonded('/busy') as manager:
        node.trigger_configure()
        node.trigger_activate()
        wait_for(lambda: len(manager.heard) > 5, 'heartbeats')
        node.destroy_node()
        wait_for(lambda: not manager.heard[-1][1], 'the farewell')


@needs_bond
def test_a_node_whose_manager_ends_the_bond_stays_active_and_is_bonded_with_the_next():
    node = make_node('/orphaned')
    with running(node), calling('/orphaned') as caller:
        with bonded('/orphaned') as manager:
            node.trigger_configure()
            node.trigger_activate()
            wait_for(lambda: manager.is_formed, 'the bond')
            manager.end()
        assert 'no map' in caller.call(START, GOAL)[1].message
        with bonded('/orphaned') as another:
            node.trigger_deactivate()
            node.trigger_activate()
            wait_for(lambda: another.is_formed, 'a bond with the next manager')


@needs_bond
def test_heartbeats_end_where_no_manager_comes_and_none_begin_without_a_period(monkeypatch):
    monkeypatch.setattr(bond, 'CONNECT_TIMEOUT_S', 1.0)
    alone = rclpy.create_node('alone', namespace='/alone')
    with bonded('/alone', 'alone') as listener:
        listener.be_silent()
        held = bond.make_bond(alone, 0.05)
        wait_for(lambda: len(listener.heard) > 1, 'heartbeats')
        wait_for(lambda: time.monotonic() - listener.heard[-1][0] > 1.0, 'their end')
        held.close()
        assert all(is_active for _, is_active in listener.heard)
    assert bond.make_bond(alone, 0.0) is None
    assert bond.make_bond(alone, -1.0) is None
    alone.destroy_node()


def test_without_the_message_a_node_works_and_says_once_what_a_manager_needs(monkeypatch):
    monkeypatch.setattr(bond, 'Status', None)
    said = []
    node = make_node('/unbonded')
    logger = node.get_logger()
    monkeypatch.setattr(
        type(logger), 'info', lambda _, text, **options: said.append((text, options))
    )
    node.trigger_configure()
    node.trigger_activate()
    assert [options for text, options in said if 'bond_timeout: 0.0' in text] == [{'once': True}]
    assert node.count_publishers('bond') == 0
    node.destroy_node()
