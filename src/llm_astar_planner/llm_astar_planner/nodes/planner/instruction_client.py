"""Asks llm_client_node what an instruction means, over its topics."""

from __future__ import annotations

import threading
import time
import uuid

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Places
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from std_msgs.msg import String

from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.messages import (
    MAX_QUESTION_WITH_PLACES,
    Question,
    QuestionAnswer,
    parse_answer,
)
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import RELIABLE, REPORTS

# How often to look whether the node that is asked is still there, in seconds.
POLL_SECONDS = 0.5
# Questions that go on waiting when the node's parameters change; each is a thread.
MOST_WAITING = 4


class InstructionClient:
    """An interpreter in another node: `<client>/interpret`, `<client>/interpretation`.

    Answers are found by the id of their question. What is no answer to one is ignored.
    """

    def __init__(self, entities: Entities, client: str) -> None:
        """Join the graph to ask the node `client`."""
        self.name = client
        self._logger = entities.node.get_logger()
        self._arrived = threading.Condition()
        self._answers: dict[str, QuestionAnswer | None] = {}
        self._is_closed = False
        self._publisher = entities.publisher(String, f'{client}/interpret', RELIABLE)
        group = MutuallyExclusiveCallbackGroup()
        entities.subscription(String, f'{client}/interpretation', self.on_answer, REPORTS, group)
        entities.on_close(self.close)

    @property
    def ready(self) -> bool:
        """Whether the node is there."""
        return not self._is_closed and bool(self._publisher.get_subscription_count())

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Ask, and wait for the answer; PENDING, with the reason, where none came."""
        id_ = uuid.uuid4().hex
        question = Question(text, id_, places.to_geojson()).to_text()
        if len(question) > MAX_QUESTION_WITH_PLACES:
            return pending(text, f'the places are too many to ask {self.name}')
        with self._arrived:
            self._answers[id_] = None
        try:
            self._publisher.publish(String(data=question))
            return self.wait_for(text, id_, time.monotonic() + time_limit)
        finally:
            with self._arrived:
                del self._answers[id_]

    def wait_for(self, text: str, id_: str, deadline: float) -> Interpretation:
        """Return the answer to a question; PENDING at the deadline, or when the node is gone."""
        while time.monotonic() < deadline:
            with self._arrived:
                self._arrived.wait_for(
                    lambda: self._is_closed or self._answers[id_] is not None, POLL_SECONDS
                )
                answer = self._answers[id_]
            if answer is not None:
                return answer.interpretation or pending(text, f'{self.name}: {answer.error}')
            if not self.ready:
                return pending(text, f'{self.name} went away while it was asked')
        return pending(text, f'{self.name} did not answer')

    def on_answer(self, message: String) -> None:
        """Take an answer, if it is one to a question of this node."""
        try:
            answer = parse_answer(message.data)
        except LlmAstarError as error:
            self._logger.warning(f'{self.name}/interpretation: {error}', throttle_duration_sec=1.0)
            return
        with self._arrived:
            if answer.id in self._answers:
                self._answers[answer.id] = answer
                self._arrived.notify_all()

    def drop_oldest(self) -> None:
        """End the waiting for all but the newest questions."""
        with self._arrived:
            for id_ in list(self._answers)[:-MOST_WAITING]:
                self._answers[id_] = QuestionAnswer(id_, error='was changed while it was asked')
            self._arrived.notify_all()

    def close(self) -> None:
        """End the waiting."""
        with self._arrived:
            self._is_closed = True
            self._arrived.notify_all()


def pending(text: str, detail: str) -> Interpretation:
    """Return the interpretation of a text that nobody has answered yet."""
    nothing = not_understood(text, detail)
    return Interpretation(text, nothing.specification, '', Understanding.PENDING, detail)
