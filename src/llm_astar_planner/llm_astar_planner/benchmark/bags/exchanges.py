"""The traffic with models that bags recorded, as a transcript to replay."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.bags.reading import Bag
from llm_astar_msgs_adapter.messages.fields import values_of_report

from llm_astar_planner.benchmark.bags.topics import Wanted, parts
from llm_astar_planner.waypoints.llm.source import read_answer
from llm_astar_planner.waypoints.source import Message, SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter


def write_exchanges(bags: Sequence[Bag], wanted: Wanted, transcript: Path) -> int:
    """Write every exchange in bags to a new transcript, in their order; return how many there are.

    Raises TranscriptError or OSError where the file cannot be written.
    """
    transcript.unlink(missing_ok=True)
    writer = TranscriptWriter(transcript)
    count = 0
    for bag in bags:
        for exchange in _exchanges(bag, wanted):
            writer.write(exchange)
            count += 1
    return count


def _exchanges(bag: Bag, wanted: Wanted) -> Iterator[Exchange]:
    topics = [name for name, part in parts(bag, wanted).items() if part == 'exchange']
    for message in bag.messages(topics):
        exchange = _exchange(values_of_report(message.value))
        if exchange is not None:
            yield exchange


def _exchange(values: Mapping[str, Any]) -> Exchange | None:
    """Read the values of an exchange message; None where it is none, or of no request."""
    try:
        response, unit = _response(values)
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
            instruction=str(values.get('instruction', '')),
        )
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def _response(values: Mapping[str, Any]) -> tuple[str, int]:
    """Return a reply's text and the cells a step of its coordinates is.

    The waypoints as they came count: where the text does not say them itself, being cut, on
    another lattice or none at all, they are its list, in cells.
    """
    text, unit = str(values['text']), int(values['unit'])
    points = tuple((float(x), float(y)) for x, y in values['waypoints'])
    if not points or (unit == 1 and read_answer(text).waypoints == points):
        return text, unit
    return json.dumps(points), 1
