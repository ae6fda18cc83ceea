# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The instruction of the planner: set, understood, previewed, and carried by each request."""

import threading
import time
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Thread
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.messages.fields import path_from_message
from nav_msgs.msg import Path
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Bool, String

from llm_astar_planner.instructions import current, messages
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.progress import Progress
from llm_astar_planner.instructions.text import clean_instruction
from llm_astar_planner.nodes.common.entities import RELIABLE, REPORTS, Entities
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.questions import QuestionServer
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.questions import read_question
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.resources import state_file

ASK_AGAIN_PERIOD = 1.0

# How often to look whether the node that is asked is still there, in seconds.
POLL_SECONDS = 0.5
# Questions that go on waiting when the node's parameters change; each is a thread.
MOST_WAITING = 4


@dataclass(eq=False)
class InstructionServer:
    """What the planner node does with instructions.

    `~/instruction` sets one, as the parameter does, and `~/confirm` answers the questions about
    it. `~/interpret` asks what a text means, and
    `~/interpretation` answers: at once by the grammar, and once more if a model is asked, or if
    the text is a question about the last plan.
    """

    entities: Entities
    side: Node
    settings: Parameters
    places: Callable[[], Places]
    on_understood: Callable[[], None]
    answer: Callable[[str], str]

    def __post_init__(self) -> None:
        """Make the parts; `start` joins the graph.

        `on_understood` is called on any thread when something else is understood. `answer`
        answers a question about the last plan; it may raise LlmAstarError.
        """
        entities, name = self.entities, self.settings['llm_client']
        self._node = entities.node
        self._is_answering = threading.Lock()
        self._reader = current.InstructionReader(
            InstructionClient(entities, name) if name else None,
            current.Confirmations(state_file('confirmations.json')),
        )
        entities.on_close(self._reader.close)
        self.current = current.CurrentInstruction(self._reader, self.on_change)
        self._progress = Progress()
        self._client_changed = False
        self._prepared = NO_PLACES

    def start(self) -> None:
        """Serve the topics, and understand the instruction that the parameters have."""
        entities = self.entities
        group = MutuallyExclusiveCallbackGroup()
        entities.subscription(String, '~/instruction', self.on_instruction, RELIABLE, group)
        entities.subscription(Bool, '~/confirm', self.on_confirm, RELIABLE, group)
        QuestionServer(entities, self.interpret)
        # On a thread where little else waits: each second it would wake the executor of the node.
        Entities(self.side).timer(ASK_AGAIN_PERIOD, self.ask_again, group)
        self.refresh()

    def interpret(
        self, question: messages.Question, on_answer: Callable[[Interpretation], None]
    ) -> Interpretation:
        """Return what a text means now; a question about the last plan is answered soon."""
        if read_question(question.text) is None:
            return self._reader.read(question.text, self.places(), on_answer)
        arguments = question.text, on_answer
        Thread(target=self.answer_question, args=arguments, daemon=True).start()
        return pending(question.text, 'it is a question about the last plan')

    def answer_question(self, text: str, on_answer: Callable[[Interpretation], None]) -> None:
        """Answer a question about the last plan: the sentence is the detail of the answer."""
        with self._is_answering:
            try:
                detail = self.answer(text)
            except LlmAstarError as error:
                detail = str(error)
        about = Understanding.IRRELEVANT
        on_answer(Interpretation(text, understood_by='planner', status=about, detail=detail))

    def refresh(self) -> None:
        """Follow changed parameters and places."""
        text, places = self.settings['instruction'], self.places()
        if places is not self._prepared:
            self._prepared = places
            self._reader.prepare(places)
        self.current.set(text, places)

    def on_confirm(self, message: Bool) -> None:
        """Answer the questions about the instruction that is set."""
        logger, questions = self._node.get_logger(), ' '.join(self.current.questions)
        try:
            is_asked = self.current.confirm(message.data)
        except (OSError, current.ConfirmationsError) as error:
            is_asked = True
            logger.warning(f'the answer is not kept: {error}')
        answer = 'yes' if message.data else 'no'
        logger.info(f'{questions} {answer}' if is_asked else 'nothing was asked')

    def on_client_change(self) -> None:
        """Ask again soon: the node that understands may answer differently from now on."""
        self._client_changed = True

    def ask_again(self) -> None:
        """Ask what was not answered, and all once more where the client has changed."""
        anew, self._client_changed = self._client_changed, False
        self.current.ask_again(anew=anew)

    def on_change(self) -> None:
        """Log what is understood."""
        instruction = self.current.instruction
        if instruction is None:
            self._progress.reset()
        else:
            summary = instruction.interpretation.summary()
            self._node.get_logger().info(f'instruction {summary}')
            for question in self.current.questions:
                self._node.get_logger().warning(f'{question} (true or false on ~/confirm)')
        self.on_understood()

    def on_instruction(self, message: String) -> None:
        """Set the parameter `instruction`; an empty message clears it."""
        result = self._node.set_parameters([Parameter('instruction', value=message.data)])[0]
        logger = self._node.get_logger()
        if not result.successful:
            logger.error(f'instruction refused, the last one stays: {result.reason}')
        elif message.data:
            logger.info(f'instruction from now on: {clean_instruction(message.data)}')
        else:
            logger.info('no instruction any more')

    def add_to(
        self, request: PlanRequest, planner: Planner, start: Pose2D, goals: Sequence[Pose2D]
    ) -> PlanRequest:
        """Return a request with the instruction that is set, if there is one."""
        instruction = self.current.instruction
        if instruction is None:
            return request
        places, text = [goal[:2] for goal in goals], instruction.interpretation.text
        driven = self._progress.at(start[:2], places, text, planner.grid_map.resolution)
        policy = self.settings['instruction_policy']
        instruction = replace(instruction, policy=policy, driven=driven, want_prices=False)
        return replace(request, instruction=instruction)

    def follow(self, path: Path) -> None:
        """Take the path that the robot follows from now on."""
        self._progress.follow(path_from_message(path))

    def values(self) -> dict[str, Any]:
        """Return what /diagnostics says."""
        instruction = self.current.instruction
        understood = instruction.interpretation if instruction else None
        return {
            'instruction': self.settings['instruction'],
            'instruction_status': understood.status.value if understood else None,
            'instruction_understood': understood.sentence if understood else None,
            'instruction_understood_by': understood.understood_by if understood else None,
            'instruction_driven': round(self._progress.metres, 1),
            'places': len(self.places()),
        }


class InstructionClient:
    """An interpreter in another node: `<client>/interpret`, `<client>/interpretation`.

    Answers are found by the id of their question. What is no answer to one is ignored.
    """

    def __init__(self, entities: Entities, client: str) -> None:
        """Join the graph to ask the node `client`."""
        self.name = client
        self._logger = entities.node.get_logger()
        self._arrived = threading.Condition()
        self._answers: dict[str, Interpretation | str | None] = {}
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
        question = messages.Question(text, id_, places.to_geojson()).to_text()
        if len(question) > messages.MAX_QUESTION_WITH_PLACES:
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
            if isinstance(answer, Interpretation):
                return answer
            if answer is not None:
                return pending(text, f'{self.name}: {answer}')
            if not self.ready:
                return pending(text, f'{self.name} went away while it was asked')
        return pending(text, f'{self.name} did not answer')

    def on_answer(self, message: String) -> None:
        """Take an answer, if it is one to a question of this node."""
        try:
            id_, answer = messages.parse_answer(message.data)
        except LlmAstarError as error:
            self._logger.warning(f'{self.name}/interpretation: {error}', throttle_duration_sec=1.0)
            return
        with self._arrived:
            if id_ in self._answers:
                self._answers[id_] = answer
                self._arrived.notify_all()

    def drop_oldest(self) -> None:
        """End the waiting for all but the newest questions."""
        with self._arrived:
            for id_ in list(self._answers)[:-MOST_WAITING]:
                self._answers[id_] = 'was changed while it was asked'
            self._arrived.notify_all()

    def close(self) -> None:
        """End the waiting."""
        with self._arrived:
            self._is_closed = True
            self._arrived.notify_all()


def pending(text: str, detail: str) -> Interpretation:
    """Return the interpretation of a text that nobody has answered yet."""
    return not_understood(text, detail, status=Understanding.PENDING)
