"""What a running planner_node plans with: its map, places and parameters, and who understands."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Places
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

from llm_astar_planner.instructions.interpretation import Interpretation, not_understood
from llm_astar_planner.instructions.messages import interpretation_from_json
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.tools.call import PlannerCaller, calling
from llm_astar_planner.nodes.tools.planner_client import PlannerClientError


class PlannerState:
    """The state of one planner, read when asked for; it changes nothing in the graph.

    It is an Interpreter too: what the graph understands of a text.
    """

    name = 'graph'

    def __init__(self, caller: PlannerCaller) -> None:
        """Take a caller of the planner."""
        self._caller = caller
        self._maps: list[GridMap] = []
        node = caller.client.node
        self._parameters = node.create_client(GetParameters, f'{caller.planner}/get_parameters')
        self._subscription = MapSubscription(Entities(node), self.on_map)

    def on_map(self, grid_map: GridMap) -> None:
        """Keep the newest map."""
        self._maps = [grid_map]

    def grid_map(self) -> GridMap:
        """Return the newest map. Raises PlannerClientError."""
        self._caller.client.wait_for(lambda: bool(self._maps), 'a map', self._caller.seconds)
        return self._maps[-1]

    def places(self) -> Places:
        """Return the planner's places. Raises PlannerClientError."""
        return self._caller.places()

    def values(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the planner's parameters of these names. Raises PlannerClientError."""
        request = GetParameters.Request(names=list(names))
        found = self._caller.client.ask(self._parameters, request, self._caller.seconds).values
        if len(found) != len(names):
            raise PlannerClientError(f'{self._caller.planner} lacks some of {", ".join(names)}')
        return {name: parameter_value_to_python(value) for name, value in zip(names, found)}

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Return what the graph understands of a text; its own places and limits hold."""
        del places, time_limit
        try:
            *_, answer = self._caller.interpret(text)
            if answer.get('error'):
                return not_understood(text, str(answer['error']))
            return interpretation_from_json(answer)
        except LlmAstarError as error:
            return not_understood(text, str(error))


@contextlib.contextmanager
def planner_state(namespace: str, planner: str, seconds: float) -> Iterator[PlannerState]:
    """Join the graph in `namespace` to read the state of `planner`. Raises NodeNameError."""
    with calling(namespace, planner, seconds) as caller:
        yield PlannerState(caller)
