"""Parameters of the waypoint client that the planner sets: GetPlan has no fields for them."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from llm_astar_msgs_adapter.messages.report import ExchangeReport
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from llm_astar_planner.costmap.config import CostmapConfig

INSTRUCTION = 'instruction'
# The client's services are discovered one after the other.
DISCOVERY_SECONDS = 1.0


class RemoteParameters:
    """Sets a client's instruction and costmap rules before it is asked. Thread-safe.

    What the client has is known from what was set, and from what its exchanges say. A client that
    was never set is assumed to have the defaults: no instruction and the default rules.
    """

    def __init__(self, node: Node, client: str) -> None:
        """Set the parameters of node `client` by `node`, which somebody else spins."""
        self._client_name = client
        self._client = node.create_client(SetParameters, f'{client}/set_parameters')
        self._lock = threading.Lock()
        self._instruction = ''
        self._config = CostmapConfig()

    def reset(self) -> None:
        """Assume the defaults again: the client was restarted."""
        with self._lock:
            self._instruction, self._config = '', CostmapConfig()

    def put(self, instruction: str, config: CostmapConfig, deadline: float) -> str | None:
        """Set what differs by `deadline` (monotonic); return why the instruction is not set.

        A client that does not take the rules is asked all the same, and its waypoints are checked
        as any.
        """
        with self._lock:
            if config != self._config:
                self.set(asdict(config), deadline)
                self._config = config  # once: a client without these parameters has no use of them
            if instruction == self._instruction:
                return None
            problem = self.set({INSTRUCTION: instruction}, deadline)
            if problem is None:
                self._instruction = instruction
            return problem

    def is_answered(self, instruction: str, exchange: ExchangeReport | None) -> bool:
        """Tell whether a reply is to this instruction; note which one the client has."""
        if exchange is None:
            return True
        with self._lock:
            self._instruction = exchange.instruction
        return exchange.instruction == instruction

    def set(self, values: Mapping[str, Any], deadline: float) -> str | None:
        """Set parameters; return None, or why that failed."""
        patience = min(DISCOVERY_SECONDS, max(0.0, deadline - time.monotonic()))
        if not self._client.wait_for_service(patience):
            return f'{self._client_name} takes no parameters'
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        done = threading.Event()
        future = self._client.call_async(
            SetParameters.Request(parameters=[one.to_parameter_msg() for one in parameters])
        )
        future.add_done_callback(lambda _: done.set())
        if not done.wait(max(0.0, deadline - time.monotonic())):
            self._client.remove_pending_request(future)
            return f'{self._client_name} did not take it in time'
        refused = [result.reason for result in future.result().results if not result.successful]
        return f'{self._client_name} refused it: {refused[0]}' if refused else None
