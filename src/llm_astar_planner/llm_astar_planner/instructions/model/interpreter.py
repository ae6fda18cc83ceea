# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Asks a language model what an instruction means, and trusts nothing that it answers."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions import transcript
from llm_astar_planner.instructions.interpretation import (
    COSTS,
    Interpretation,
    Understanding,
    not_understood,
    status_of,
)
from llm_astar_planner.instructions.model.answer import answer_schema, read_answer, read_sentence
from llm_astar_planner.instructions.model.check import grounded
from llm_astar_planner.instructions.model.prompt import prompt_messages
from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure


def interpret_reply(exchange: transcript.ModelCall, places: Places) -> Interpretation:
    """Return what a model's reply says of its instruction, held against the sentence.

    A reply without clauses that can be read gives status NONE.
    """
    answer = read_answer(exchange.reply, places)
    if answer is None:
        detail = 'the reply holds no list of clauses'
        found = not_understood(exchange.text, detail, exchange.model)
    else:
        specification, detail = grounded(answer.clauses, exchange.text, places)
        if answer.unreadable:
            detail = f'{detail}; {answer.unreadable} clauses were unreadable'.removeprefix('; ')
        status = status_of(specification)
        found = Interpretation(exchange.text, specification, exchange.model, status, detail)
    return replace(found, **{name: getattr(exchange, name) for name in COSTS})


class ReplayInterpreter:
    """Answers from a transcript: by sentence and places, the last reply recorded of them."""

    name = 'replay'

    def __init__(self, path: str | Path, model: str = '') -> None:
        """Read the transcript; `model` takes the replies of one model, '' those of any.

        Raises TranscriptError where the file is malformed.
        """
        self._exchanges = {
            (exchange.text, exchange.places): exchange
            for exchange in transcript.read_exchanges(path)
            if model in ('', exchange.model)
        }

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:  # noqa: ARG002 - at once
        """Return what the recorded reply says; NONE where there is no such exchange."""
        if not text:
            return Interpretation('', status=Understanding.IRRELEVANT)
        exchange = self._exchanges.get((text, places.digest))
        if exchange is None:
            return not_understood(text, 'the transcript has no reply to it', self.name)
        return interpret_reply(exchange, places)


@dataclass(eq=False)
class ModelInterpreter:
    """Understands instructions by a model behind an OpenAI-compatible endpoint.

    The reply is read as bounded data, and each of its clauses is held against the sentence. A
    request that brings no reply gives PENDING, 'not understood yet', with the reason. With a
    `recorder`, each exchange is appended to a transcript. Thread-safe.
    """

    client: ChatClient
    recorder: transcript.InstructionRecorder | None = None

    name = 'endpoint'

    @property
    def model(self) -> str:
        """The model's name, or the host's where none is configured."""
        return self.client.model or self.client.endpoint.host

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Ask the model, unless there is nothing to ask. Returns within `time_limit` seconds."""
        started = time.monotonic()
        if not text:
            return Interpretation('', status=Understanding.IRRELEVANT)
        messages = prompt_messages(text, places)
        schema = answer_schema(read_sentence(text, places), places)
        try:
            completion = self.client.complete(messages, started + time_limit, schema)
        except EndpointFailure as failure:
            return failed(text, self.model, failure, time.monotonic() - started)
        exchange = transcript.ModelCall(
            text, places.digest, self.model, completion.text,
            round(time.monotonic() - started, 3),
            completion.prompt_tokens, completion.completion_tokens,
        )  # fmt: skip
        interpretation = interpret_reply(exchange, places)
        if self.recorder is not None:
            self.recorder.write(exchange, interpretation)
        return interpretation


def failed(text: str, model: str, failure: EndpointFailure, seconds: float) -> Interpretation:
    """Return the interpretation of a text about which no reply came: not understood yet."""
    detail = f'{failure.status.value}: {failure}'
    nothing = not_understood(text, detail, model, Understanding.PENDING)
    return replace(nothing, seconds=seconds)
