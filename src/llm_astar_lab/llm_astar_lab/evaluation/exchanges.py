"""Exchanges with language models that were recorded in bags, as a transcript to replay."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.messages.fields import values_of_report
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.source import Message, SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter

from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.evaluation.topics import TopicSelection, topic_roles


def write_exchanges(bags: Sequence[Bag], selection: TopicSelection, transcript: Path) -> int:
    """Write every exchange in bags to a new transcript, in their order; return their number.

    Raises TranscriptError or OSError where the file cannot be written.
    """
    transcript.unlink(missing_ok=True)
    writer = TranscriptWriter(transcript)
    count = 0
    for bag in bags:
        roles = topic_roles(bag, selection)
        for message in bag.messages([name for name, role in roles.items() if role == 'exchange']):
            exchange = exchange_from_values(values_of_report(message.value))
            if exchange is not None:
                writer.write(exchange)
                count += 1
    return count


def exchange_from_values(values: Mapping[str, Any]) -> Exchange | None:
    """Make an exchange of a message's values; None where they are not those of an exchange."""
    try:
        response, unit = response_of(values)
        return Exchange(
            map=str(values['map_digest']),
            pair=str(values['pair']),
            scale=1,
            model=str(values['model']),
            prompt=str(values['prompt']),
            messages=tuple(Message(str(role), str(text)) for role, text in values['messages']),
            response=response,
            prompt_tokens=int(values['prompt_tokens']),
            completion_tokens=int(values['completion_tokens']),
            seconds=float(values['seconds']),
            status=SourceStatus(values['status']),
            unit=unit,
        )
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def response_of(values: Mapping[str, Any]) -> tuple[str, int]:
    """Return the reply's text, and how many cells one step of its coordinates is.

    The message has the waypoints too. Where the text does not give the same ones, since it was
    cut, is in other units, or the source has no text, the response is their list in cells.
    """
    text, unit = str(values['text']), int(values['unit'])
    points = tuple((float(x), float(y)) for x, y in values['waypoints'])
    if not points or (unit == 1 and read_answer(text).waypoints == points):
        return text, unit
    return json.dumps(points), 1
