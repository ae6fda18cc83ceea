# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Reads and sets the parameters of running nodes, of this package or of others."""

import contextlib
import time
from collections.abc import Iterator, Sequence
from typing import Any

import yaml
from llm_astar_msgs_adapter.errors import LlmAstarError, nearest_name
from rcl_interfaces.msg import Parameter as Message
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter

from llm_astar_planner.nodes.common.entities import ask
from llm_astar_planner.nodes.common.spin import SpinThread, check_names, joined

Type = Parameter.Type
TYPE_NAMES = {
    Type.BOOL: 'true or false',
    Type.INTEGER: 'a whole number',
    Type.DOUBLE: 'a number',
    Type.STRING: 'a text',
}
SERVICES = {
    ListParameters: 'list_parameters',
    GetParameters: 'get_parameters',
    SetParameters: 'set_parameters',
}
# Seconds without a new node after which a graph is taken to be known.
QUIET_SECONDS = 0.5
POLL_SECONDS = 0.05


class RemoteParameterError(LlmAstarError, ValueError):
    """A node or a parameter that is not there, or a refused value; the message names it."""


class ParameterClient:
    """Asks the parameter services of nodes; each wait is at most `seconds` long.

    Raises RemoteParameterError for what is not there and what does not answer.
    """

    def __init__(self, node: Node, namespace: str, seconds: float) -> None:
        """Take a node that is spun, and the namespace of relative names."""
        self._node = node
        self._namespace = namespace
        self._seconds = seconds

    def nodes(self) -> list[str]:
        """Return the full names of the nodes that have parameters, once no new one appears."""
        known: list[str] = []
        quiet_since = time.monotonic()
        deadline = quiet_since + self._seconds
        while time.monotonic() < deadline:
            found = sorted(
                f'{namespace.rstrip("/")}/{name}'
                for name, namespace in self._node.get_node_names_and_namespaces()
                if not name.startswith('_') and self.has_parameters(name, namespace)
            )
            if found != known:
                known, quiet_since = found, time.monotonic()
            elif known and time.monotonic() - quiet_since > QUIET_SECONDS:
                break
            time.sleep(POLL_SECONDS)
        return known

    def has_parameters(self, name: str, namespace: str) -> bool:
        """Tell whether a node has parameter services."""
        try:
            services = self._node.get_service_names_and_types_by_node(name, namespace)
        except NodeNameNonExistentError:  # it has just ended
            return False
        return any(service.endswith('/get_parameters') for service, _ in services)

    def parameters(self, name: str) -> dict[str, Parameter]:
        """Return all parameters of a node by name."""
        names = sorted(self.ask(name, ListParameters).result.names)
        values = self.ask(name, GetParameters, names=names).values
        messages = (Message(name=one, value=value) for one, value in zip(names, values))
        return {one.name: Parameter.from_parameter_msg(one) for one in messages}

    def parameter(self, node: str, name: str) -> Parameter:
        """Return one parameter of a node."""
        found = self.parameters(node)
        if name not in found:
            near = nearest_name(name, found)
            raise RemoteParameterError(f'{node} has no parameter {name}{near}')
        return found[name]

    def set(self, node: str, name: str, text: str) -> tuple[Any, Any]:
        """Set a parameter to a value written as text; return the value before and after."""
        before = self.parameter(node, name)
        after = typed(name, text, before.type_)
        result = self.ask(node, SetParameters, parameters=[after.to_parameter_msg()]).results[0]
        if not result.successful:
            raise RemoteParameterError(f'{node} refused it: {result.reason}')
        return before.value, after.value

    def ask(self, name: str, kind: Any, **fields: Any) -> Any:  # noqa: ANN401 - of the service
        """Ask one of a node's parameter services and return its response."""
        full = name if name.startswith('/') else f'{self._namespace.rstrip("/")}/{name}'
        client = self._node.create_client(kind, f'{full}/{SERVICES[kind]}')
        deadline = time.monotonic() + self._seconds
        while not client.service_is_ready():
            if time.monotonic() > deadline:
                raise RemoteParameterError(self.missing(full))
            time.sleep(POLL_SECONDS)
        response = ask(client, kind.Request(**fields), self._seconds)
        if response is None:
            raise RemoteParameterError(f'{name} did not respond within {self._seconds:g} s')
        return response

    def missing(self, name: str) -> str:
        """Return why a node cannot be asked, in a sentence."""
        known = self.nodes()
        if name in known:
            return f'{name} runs, but its parameters did not respond within {self._seconds:g} s'
        running = f'; running: {", ".join(known)}' if known else '; no node is running'
        return f'there is no node {name}{nearest_name(name, known) or running}'


def typed(name: str, text: str, kind: Parameter.Type) -> Parameter:
    """Return a parameter with the value that a text means as one of a type.

    Raises RemoteParameterError for a text that is none.
    """
    value: Any = text
    try:
        if kind is not Type.STRING:
            value = yaml.safe_load(text)
        if kind is Type.DOUBLE and not isinstance(value, bool):
            value = float(value)
        return Parameter(name, kind, value)
    except (TypeError, ValueError, yaml.YAMLError):
        expected = TYPE_NAMES.get(kind, f'a list ({kind.name.lower()}), such as [1, 2]')
        raise RemoteParameterError(f'{name}: {expected} is expected, not {text!r}') from None


@contextlib.contextmanager
def parameter_client(
    namespace: str, names: Sequence[str], seconds: float
) -> Iterator[ParameterClient]:
    """Join the graph to ask for parameters. Raises NodeNameError for an impossible name."""
    namespace = check_names(namespace, *names)
    with joined('llm_astar_param') as node, contextlib.closing(SpinThread(node)):
        yield ParameterClient(node, namespace, seconds)
