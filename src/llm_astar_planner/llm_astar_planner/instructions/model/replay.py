"""Understands instructions by the recorded replies of a model."""

from __future__ import annotations

from pathlib import Path

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.model.reply import interpret_reply
from llm_astar_planner.instructions.transcript import read_exchanges


class ReplayInterpreter:
    """Answers from a transcript: by sentence and places, the last reply recorded of them."""

    name = 'replay'

    def __init__(self, path: str | Path, model: str = '') -> None:
        """Read the transcript; `model` takes the replies of one model, '' those of any.

        Raises TranscriptError where the file is malformed.
        """
        self._exchanges = {
            (exchange.text, exchange.places): exchange
            for exchange in read_exchanges(path)
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
