"""Answers what instructions mean, for llm_client_node: `~/interpret`, `~/interpretation`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.maps.places_file import places_from_geojson

from llm_astar_planner.instructions.chain import BackgroundInterpreter
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import Interpretation, Interpreter
from llm_astar_planner.instructions.messages import MAX_QUESTION_WITH_PLACES, Question
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.question_server import OnAnswer, QuestionServer

# Seconds for one question to a model. No plan waits for it, and a small model on a processor
# takes half a minute for its first, or longer if the processor has other work.
LIMIT_S = 120.0


class InterpretationServer:
    """Answers each question once: at once if the grammar reads all of it, else by the model.

    The model is asked one question at a time, the newest first; what is too old to be asked is
    answered with what the grammar reads.
    """

    def __init__(self, entities: Entities, interpreter: Interpreter) -> None:
        """Serve."""
        self._logger = entities.node.get_logger()
        self._grammar = GrammarInterpreter()
        self._interpreter = interpreter
        self._background = BackgroundInterpreter(self._grammar, interpreter, LIMIT_S)
        self._geojson: Mapping[str, Any] | None = None
        self._places = NO_PLACES
        QuestionServer(entities, self.interpret, limit=MAX_QUESTION_WITH_PLACES, waits=True)
        entities.on_close(self.close)

    def adopt(self, interpreter: Interpreter) -> None:
        """Ask this interpreter from now on; questions that wait for another are dropped."""
        if interpreter is not self._interpreter:
            before, self._interpreter = self._background, interpreter
            self._background = BackgroundInterpreter(self._grammar, interpreter, LIMIT_S)
            before.close()

    def close(self) -> None:
        """Ask no more."""
        self._background.close()

    def interpret(self, question: Question, on_answer: OnAnswer) -> Interpretation:
        """Return what the grammar understands. Raises PlacesError for the question's places."""
        places = self.places_of(question)

        def answer(interpretation: Interpretation) -> None:
            self._logger.info(interpretation.summary())
            on_answer(interpretation)

        return self._background.interpret_now(question.text, places, answer)

    def places_of(self, question: Question) -> Places:
        """Return the places of a question: often those of the last one. Raises PlacesError."""
        if question.places is None:
            return NO_PLACES
        if question.places != self._geojson:
            self._places = places_from_geojson(question.places, 'places')
            self._geojson = question.places
        return self._places
