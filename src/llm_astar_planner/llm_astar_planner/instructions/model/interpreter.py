"""Asks a language model what an instruction means, and trusts nothing that it answers."""

from __future__ import annotations

import time
from dataclasses import KW_ONLY, dataclass, field

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.model.answer import answer_schema
from llm_astar_planner.instructions.model.mentions import read
from llm_astar_planner.instructions.model.prompt import (
    Examples,
    prompt_messages,
    shipped_examples,
)
from llm_astar_planner.instructions.model.reply import interpret_reply
from llm_astar_planner.instructions.transcript import Exchange, InstructionRecorder
from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure


@dataclass(eq=False)
class ModelInterpreter:
    """Understands instructions by a model behind an OpenAI-compatible endpoint.

    The reply is read as bounded data, and each of its clauses is held against the sentence. A
    request that brings no reply gives PENDING, 'not understood yet', with the reason. With a
    `recorder`, each exchange is appended to a transcript. Thread-safe.
    """

    client: ChatClient
    _: KW_ONLY
    examples: Examples = field(default_factory=shipped_examples)
    recorder: InstructionRecorder | None = None

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
        messages = prompt_messages(text, places, self.examples)
        schema = answer_schema(read(text, places), places)
        try:
            completion = self.client.complete(messages, started + time_limit, schema)
        except EndpointFailure as failure:
            return failed(text, self.model, failure, time.monotonic() - started)
        exchange = Exchange(
            text,
            places.digest,
            self.model,
            completion.text,
            seconds=round(time.monotonic() - started, 3),
            prompt_tokens=completion.prompt_tokens,
            output_tokens=completion.completion_tokens,
        )
        interpretation = interpret_reply(exchange, places)
        if self.recorder is not None:
            self.recorder.write(exchange, interpretation)
        return interpretation


def failed(text: str, model: str, failure: EndpointFailure, seconds: float) -> Interpretation:
    """Return the interpretation of a text about which no reply came: not understood yet."""
    detail = f'{failure.status.value}: {failure}'
    nothing = not_understood(text, detail, model)
    return Interpretation(
        text, nothing.specification, model, Understanding.PENDING, detail, seconds
    )
