"""Parameters of the waypoint client that the planner sets: GetPlan has no fields for them."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.nodes.common.asking import ask

# The client's services are discovered one after the other.
DISCOVERY_SECONDS = 1.0


class RemoteParameters:
    """Sets a client's costmap rules before it is asked. Thread-safe.

    What the client has is known from what was set. A client that was never set is assumed to have
    the default rules.
    """

    def __init__(self, node: Node, client: str) -> None:
        """Set the parameters of node `client` by `node`, which somebody else spins."""
        self._client_name = client
        self._client = node.create_client(SetParameters, f'{client}/set_parameters')
        self._lock = threading.Lock()
        self._config = CostmapConfig()

    def reset(self) -> None:
        """Assume the defaults again: the client was restarted."""
        with self._lock:
            self._config = CostmapConfig()

    def put(self, config: CostmapConfig, deadline: float) -> None:
        """Set the rules by `deadline` (monotonic) if they differ.

        A client that does not take them is asked all the same, and its waypoints are checked as
        any.
        """
        with self._lock:
            if config != self._config:
                self.set(asdict(config), deadline)
                self._config = config  # once: a client without these parameters has no use of them

    def set(self, values: Mapping[str, Any], deadline: float) -> str | None:
        """Set parameters; return None, or why that failed."""
        patience = min(DISCOVERY_SECONDS, max(0.0, deadline - time.monotonic()))
        if not self._client.wait_for_service(patience):
            return f'{self._client_name} takes no parameters'
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        request = SetParameters.Request(parameters=[one.to_parameter_msg() for one in parameters])
        response = ask(self._client, request, deadline - time.monotonic())
        if response is None:
            return f'{self._client_name} did not take it in time'
        refused = [result.reason for result in response.results if not result.successful]
        return f'{self._client_name} refused it: {refused[0]}' if refused else None
