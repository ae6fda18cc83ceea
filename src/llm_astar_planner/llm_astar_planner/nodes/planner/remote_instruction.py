"""The wish a waypoint client has: its parameter `instruction`, as GetPlan has no room for one."""

from __future__ import annotations

import threading
import time

from llm_astar_msgs_adapter.messages.diagnostics import ExchangeReport
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

# The client's parameter.
WISH = 'instruction'
# The client's services are found one after the other.
DISCOVERY_SECONDS = 1.0


class RemoteInstruction:
    """Sets a client's wish before it is asked, where it has another one. Thread-safe.

    What the client has is known from what was set, and from what its exchanges say. One that was
    never told of a wish is taken to have none until it says otherwise.
    """

    def __init__(self, node: Node, client: str) -> None:
        """Set the wish of `client` by `node`, which somebody else spins."""
        self._client_name = client
        self._client = node.create_client(SetParameters, f'{client}/set_parameters')
        self._lock = threading.Lock()
        self._known = ''

    def put(self, wish: str, deadline: float) -> str:
        """Have the client take a wish by `deadline` (monotonic); return '', or why it has not."""
        with self._lock:
            if wish == self._known:
                return ''
            problem = self._set(wish, deadline)
            if not problem:
                self._known = wish
            return problem

    def is_answered(self, wish: str, exchange: ExchangeReport | None) -> bool:
        """Tell whether an answer is to this wish, as far as one can; note what the client has."""
        if exchange is None:
            return True
        with self._lock:
            self._known = exchange.instruction
        return exchange.instruction == wish

    def _set(self, wish: str, deadline: float) -> str:
        patience = min(DISCOVERY_SECONDS, max(0.0, deadline - time.monotonic()))
        if not self._client.wait_for_service(patience):
            return f'{self._client_name} takes no parameters'
        parameter = Parameter(WISH, value=wish).to_parameter_msg()
        done = threading.Event()
        future = self._client.call_async(SetParameters.Request(parameters=[parameter]))
        future.add_done_callback(lambda _: done.set())
        if not done.wait(max(0.0, deadline - time.monotonic())):
            self._client.remove_pending_request(future)
            return f'{self._client_name} did not take it in time'
        result = future.result().results[0]
        return '' if result.successful else f'{self._client_name} refused it: {result.reason}'
