# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The topics on which a node is asked what an instruction means, and who answers them."""

import math
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places, places_from_geojson
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from std_msgs.msg import String

from llm_astar_planner.instructions import messages
from llm_astar_planner.instructions.chain import BackgroundInterpreter, OnAnswer, make_interpreter
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Interpreter,
    Understanding,
)
from llm_astar_planner.instructions.text import clean_instruction
from llm_astar_planner.nodes.common.entities import RELIABLE, REPORTS, Entities

# Questions a second, of which so many may come at once: a flood must leave time to plan.
RATE, BURST = 50.0, 20

# Given a question with a clean text, returns what is understood now. If that is PENDING, the
# callback gets the rest, on any thread. May raise LlmAstarError.
Interpret = Callable[[messages.Question, OnAnswer], Interpretation]

# Seconds for one question to a model. No plan waits for it, and a small model on a processor
# takes half a minute for its first, or longer if the processor has other work.
LIMIT_S = 120.0


@dataclass(eq=False)
class QuestionServer:
    """Takes questions on `~/interpret` and answers on `~/interpretation`, with the id of each.

    Every question is answered: what cannot be read, or is too long, with an error. Of a flood the
    newest are, RATE a second; the middleware drops the others.
    """

    entities: Entities
    interpret: Interpret
    limit: int = messages.MAX_QUESTION
    waits: bool = False

    def __post_init__(self) -> None:
        """Serve. `limit` is in characters; `waits` publishes only the last answer."""
        entities = self.entities
        self._due = -math.inf
        self._lock = threading.Lock()
        self._is_closed = False
        self._publisher = entities.publisher(String, '~/interpretation', REPORTS)
        entities.on_close(self.close)
        # A group of its own: nothing may delay an answer.
        group = MutuallyExclusiveCallbackGroup()
        entities.subscription(String, '~/interpret', self.on_question, RELIABLE, group)

    def on_question(self, message: String) -> None:
        """Answer a question, or have it answered."""
        self.pace()
        asked = messages.Question(message.data)
        # What is found out later, on another thread, is not said before what is known now.
        turn = threading.RLock()
        with turn:
            try:
                asked = messages.parse_question(message.data, self.limit)
                question = messages.Question(clean_instruction(asked.text), asked.id, asked.places)
                reading = self.interpret(question, partial(self.answer, asked, turn))
            except LlmAstarError as error:
                self.publish(messages.error_text(asked, error))
                return
            if not (self.waits and reading.status is Understanding.PENDING):
                self.answer(asked, turn, reading)

    def pace(self) -> None:
        """Wait where questions come faster than they may."""
        now = time.monotonic()
        self._due = max(self._due + 1.0 / RATE, now - BURST / RATE)
        time.sleep(max(0.0, self._due - now))

    def answer(
        self,
        question: messages.Question,
        turn: AbstractContextManager[object],
        interpretation: Interpretation,
    ) -> None:
        """Publish an answer to a question, in its turn."""
        with turn:
            self.publish(messages.answer_text(question, interpretation))

    def publish(self, text: str) -> None:
        """Publish a text, unless the node has ended meanwhile."""
        with self._lock:
            if not self._is_closed:
                self._publisher.publish(String(data=text))

    def close(self) -> None:
        """Publish no more."""
        with self._lock:
            self._is_closed = True


class InterpretationServer:
    """Answers each question once: at once if it is read whole here, else by the model.

    The model is asked one question at a time, the newest first; what is too old to be asked is
    answered with what the grammar reads.
    """

    def __init__(self, entities: Entities, interpreter: Interpreter) -> None:
        """Serve."""
        self._logger = entities.node.get_logger()
        self._interpreter = interpreter
        self._background = BackgroundInterpreter(make_interpreter({}), interpreter, LIMIT_S)
        self._geojson: Mapping[str, Any] | None = None
        self._places = NO_PLACES
        QuestionServer(
            entities, self.interpret, limit=messages.MAX_QUESTION_WITH_PLACES, waits=True
        )
        entities.on_close(self._background.close)

    def adopt(self, interpreter: Interpreter) -> None:
        """Ask this interpreter from now on."""
        if interpreter is not self._interpreter:
            self._interpreter = interpreter
            self._background.ask(interpreter)

    def interpret(self, question: messages.Question, on_answer: OnAnswer) -> Interpretation:
        """Return what is understood here. Raises PlacesError for the question's places."""
        places = self.places_of(question)

        def answer(interpretation: Interpretation) -> None:
            self._logger.info(interpretation.summary())
            on_answer(interpretation)

        return self._background.interpret_now(question.text, places, answer)

    def places_of(self, question: messages.Question) -> Places:
        """Return the places of a question: often those of the last one. Raises PlacesError."""
        if question.places is None:
            return NO_PLACES
        if question.places != self._geojson:
            self._places = places_from_geojson(question.places, 'places')
            self._geojson = question.places
        return self._places
