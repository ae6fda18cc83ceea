# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Transcripts of instructions: what a model was asked and replied, as JSON Lines.

A line holds `text, places` (their digest), `model, reply, interpretation, seconds,
prompt_tokens, output_tokens, time`. A replay reads the reply again, so the checks of today hold
for the replies of yesterday; `interpretation` is for people. The lines may lie in one file with
those about waypoints.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from llm_astar_planner.instructions.interpretation import Interpretation
from llm_astar_planner.waypoints import transcript as transcripts

_LOG = logging.getLogger(__name__)
_TYPES: dict[str, tuple[type, ...]] = {'str': (str,), 'float': (int, float), 'int': (int,)}


@dataclass(frozen=True)
class ModelCall:
    """One question to a model about an instruction, and its reply as the model wrote it.

    `places` is the digest of the map's places.
    """

    text: str
    places: str
    model: str
    reply: str
    seconds: float = 0.0
    prompt_tokens: int = 0
    output_tokens: int = 0


class InstructionRecorder:
    """Appends exchanges to a transcript. Thread-safe; a write that fails is logged."""

    def __init__(self, path: str | Path) -> None:
        """Open the file for appending. Raises TranscriptError where it cannot be written."""
        self._writer = transcripts.TranscriptWriter(path)

    def write(self, exchange: ModelCall, interpretation: Interpretation) -> None:
        """Append one exchange and what was made of it."""
        time = datetime.now(timezone.utc).isoformat(timespec='seconds')
        made = {'interpretation': interpretation.to_json(), 'time': time}
        try:
            self._writer.write(vars(exchange) | made)
        except (OSError, ValueError) as error:
            _LOG.warning('%s: cannot be written: %s', self._writer.path, error)


def read_exchanges(path: str | Path) -> list[ModelCall]:
    """Read the exchanges about instructions of a transcript, in their order.

    Raises TranscriptError, which names the file, the line and the field.
    """
    return [
        parse_exchange(record, where)
        for where, record in transcripts.read_records(Path(path))
        if transcripts.is_about_instruction(record)
    ]


def parse_exchange(record: Mapping[str, Any], where: str) -> ModelCall:
    """Validate one line. Raises TranscriptError that begins with `where` and names the field."""
    for field in fields(ModelCall):
        name = f'{where}: {field.name}'
        if field.name not in record:
            raise transcripts.TranscriptError(f'{name}: is missing')
        transcripts.check_type(record[field.name], _TYPES[str(field.type)], name)
    transcripts.check_names(record, where, 'model')
    return ModelCall(**{field.name: record[field.name] for field in fields(ModelCall)})
