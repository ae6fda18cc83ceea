"""Calls a running planner_node as another stack would: for a plan, or for what a text means."""

from __future__ import annotations

import contextlib
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.maps.places_file import places_from_geojson
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.report import PlanReport
from nav_msgs.msg import Path
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import String

from llm_astar_planner.instructions.interpretation import Understanding
from llm_astar_planner.instructions.messages import Question, QuestionError, parse_object
from llm_astar_planner.instructions.route import PlaceGoalError, find_place
from llm_astar_planner.nodes.common.names import check_names
from llm_astar_planner.nodes.common.qos import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.common.spin import joined
from llm_astar_planner.nodes.tools.planner_client import PlannerClient, PlannerClientError


@dataclass(frozen=True)
class CalledPlan:
    """A planner's answer: its path, the points of it in metres, report, round trip in seconds."""

    path: Path
    points: list[list[float]]
    report: PlanReport
    seconds: float


class PlannerCaller:
    """Calls one planner; every wait is at most `seconds` long and raises PlannerClientError."""

    def __init__(self, client: PlannerClient, planner: str, seconds: float) -> None:
        """Take the client of the node `planner`."""
        self.client = client
        self.planner = planner
        self.seconds = seconds
        self._answers: dict[str, list[dict[str, Any]]] = {}
        self._places: list[dict[str, Any]] = []
        self._questions = client.node.create_publisher(String, f'{planner}/interpret', RELIABLE)
        client.listen(String, f'{planner}/interpretation', self.on_answer, REPORTS)
        client.listen(String, f'{planner}/places_geojson', self.on_places, LATCHED)

    def on_answer(self, message: String) -> None:
        """Keep an answer to a question of this caller."""
        with contextlib.suppress(QuestionError):
            answer = parse_object(message.data)
            if answer.get('id') in self._answers:
                self._answers[answer['id']].append(answer)

    def on_places(self, message: String) -> None:
        """Keep the newest places."""
        with contextlib.suppress(QuestionError):
            self._places = [parse_object(message.data)]

    def wait_for_planner(self) -> None:
        """Wait until the planner is there and has a map."""
        self.client.wait_until_ready(seconds=self.seconds)

    def interpret(self, text: str) -> Iterator[dict[str, Any]]:
        """Yield what the planner understands of a text: now, and again if a model is asked."""
        id_ = uuid.uuid4().hex
        self.client.wait_for_subscriber(self._questions, self.seconds)
        answers = self._answers[id_] = []
        self._questions.publish(String(data=Question(text, id_).to_text()))
        what = f'the interpretation by {self.planner}'
        self.client.wait_for(lambda: len(answers) > 0, what, self.seconds)
        yield answers[0]
        if answers[0].get('status') == Understanding.PENDING.value:
            self.client.wait_for(lambda: len(answers) > 1, what, self.seconds)
            yield answers[1]

    def set_instruction(self, text: str) -> None:
        """Set the planner's instruction."""
        service = self.client.node.create_client(SetParameters, f'{self.planner}/set_parameters')
        value = Parameter('instruction', value=text).to_parameter_msg()
        response = self.client.ask(
            service, SetParameters.Request(parameters=[value]), self.seconds
        )
        if not response.results[0].successful:
            raise PlannerClientError(response.results[0].reason)

    def place(self, name: str) -> Pose2D:
        """Return the goal of a place. Raises PlaceGoalError with the names to choose from."""
        place, collection = find_place(name, self.places()), self._places[-1]
        if place.name not in collection['goals']:
            raise PlaceGoalError(f'no cell of {place.name!r} is free on the map')
        return Pose2D(*collection['goals'][place.name])

    def places(self) -> Places:
        """Return the planner's places."""
        what = f'the places of {self.planner}'
        self.client.wait_for(self.has_places, what, self.seconds)
        return places_from_geojson(self._places[-1], what)

    def has_places(self) -> bool:
        """Tell whether the places have arrived, with their goals if there are any."""
        newest = self._places[-1] if self._places else None
        return newest is not None and ('goals' in newest or not newest.get('features'))

    def plan(self, start: Pose2D, goal: Pose2D, frame_id: str) -> CalledPlan:
        """Ask for a plan."""
        path, report, seconds = self.client.call(start, goal, frame_id, self.seconds)
        return CalledPlan(path, path_from_message(path).tolist(), report, seconds)


@contextlib.contextmanager
def calling(namespace: str, planner: str, seconds: float) -> Iterator[PlannerCaller]:
    """Join the graph in `namespace` to call `planner`. Raises NodeNameError."""
    with joined('llm_astar_call', check_names(namespace, planner)) as node:
        client = PlannerClient(node, planner)
        caller = PlannerCaller(client, planner, seconds)
        with client:
            caller.wait_for_planner()
            yield caller
