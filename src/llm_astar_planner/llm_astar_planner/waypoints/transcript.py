"""Transcripts: JSON Lines, one exchange with a model a line, appended and read back.

A line holds `map, pair, scale, model, prompt, messages, response, prompt_tokens,
completion_tokens, seconds, status`. The coordinates are the lattice coordinates of the map;
where a big map was described on a coarser lattice, `unit` says how many cells one step is, and
where the question came with a wish in plain language, `instruction` is that wish.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_planner.waypoints.prompts.message import Message
from llm_astar_planner.waypoints.source import SampleKey, SourceStatus

_LOG = logging.getLogger(__name__)


class TranscriptError(ValueError):
    """A transcript that cannot be used; the message names the file, the line and the field."""


@dataclass(frozen=True)
class Exchange:
    """One question to a model and its answer.

    `map` is a map id of a dataset, or the digest of a live grid; `pair` the index of the
    start-goal pair, or `x0,y0->x1,y1` in cells. `response` is the text as the model wrote it.
    """

    map: int | str
    pair: int | str
    scale: int
    model: str
    prompt: str
    messages: tuple[Message, ...]
    response: str
    prompt_tokens: int
    completion_tokens: int
    seconds: float
    status: SourceStatus
    unit: int = 1
    instruction: str = ''

    @property
    def sample(self) -> SampleKey:
        """Which sample it was asked for."""
        return SampleKey(self.map, self.pair, self.scale)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object of a transcript line."""
        record = {name: getattr(self, name) for name in _FIELDS}
        record['messages'] = [message._asdict() for message in self.messages]
        record['status'] = self.status.value
        if self.unit != 1:
            record['unit'] = self.unit
        if self.instruction:
            record['instruction'] = self.instruction
        return record


_FIELDS: dict[str, tuple[type, ...]] = {
    'map': (int, str),
    'pair': (int, str),
    'scale': (int,),
    'model': (str,),
    'prompt': (str,),
    'messages': (list,),
    'response': (str,),
    'prompt_tokens': (int,),
    'completion_tokens': (int,),
    'seconds': (int, float),
    'status': (str,),
}


def read_transcript(path: str | Path) -> list[Exchange]:
    """Read every exchange of a transcript, in the order they were recorded.

    A last line without its line end that does not parse was cut off while it was written: it is
    left out with a logged warning. Raises TranscriptError for anything else that is malformed.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding='utf-8', errors='replace')
    except OSError as error:
        raise TranscriptError(f'{path}: {error.strerror or error}') from None
    lines = text.split('\n')
    exchanges: list[Exchange] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        where = f'{path}: line {number}'
        try:
            record = json.loads(line)
        except (ValueError, RecursionError) as error:
            if number == len(lines):
                _LOG.warning('%s: cut off while it was written; left out', where)
                continue
            raise TranscriptError(f'{where}: not JSON: {error}') from None
        exchanges.append(parse_exchange(record, where))
    return exchanges


def parse_exchange(record: object, where: str = 'exchange') -> Exchange:
    """Validate one record. Raises TranscriptError that begins with `where` and names the field."""
    if not isinstance(record, dict):
        raise TranscriptError(f'{where}: an object is expected, not {str(record)[:60]!r}')
    for name, types in _FIELDS.items():
        if name not in record:
            raise TranscriptError(f'{where}: {name}: is missing')
        _check(record[name], types, f'{where}: {name}')
    unit = record.get('unit', 1)
    _check(unit, (int,), f'{where}: unit')
    for name, value in (('scale', record['scale']), ('unit', unit)):
        if value < 1:
            raise TranscriptError(f'{where}: {name}: {value} is not 1 or more')
    values = {name: record[name] for name in _FIELDS}
    values['messages'] = tuple(
        _message(message, f'{where}: messages[{index}]')
        for index, message in enumerate(record['messages'])
    )
    try:
        values['status'] = SourceStatus(record['status'])
    except ValueError:
        known = ', '.join(status.value for status in SourceStatus)
        message = f'{where}: status: {record["status"]!r} is none of {known}'
        raise TranscriptError(message) from None
    instruction = record.get('instruction', '')
    _check(instruction, (str,), f'{where}: instruction')
    return Exchange(**values, unit=unit, instruction=instruction)


def _check(value: object, types: tuple[type, ...], name: str) -> None:
    if isinstance(value, bool) or not isinstance(value, types):
        expected = ' or '.join(kind.__name__ for kind in types)
        raise TranscriptError(f'{name}: {expected} is expected, not {str(value)[:60]!r}')


def _message(value: object, name: str) -> Message:
    if not isinstance(value, dict):
        raise TranscriptError(f'{name}: an object is expected, not {str(value)[:60]!r}')
    for field in ('role', 'content'):
        _check(value.get(field), (str,), f'{name}: {field}')
    return Message(value['role'], value['content'])


class TranscriptWriter:
    """Append exchanges to a transcript; each is on disk before `write` returns. Thread-safe."""

    def __init__(self, path: str | Path) -> None:
        """Append to `path`; a cut-off last line is removed, so that the rest stays good.

        Raises TranscriptError where the file cannot be written.
        """
        self.path = Path(path)
        self._lock = threading.Lock()
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            _end_last_line(self.path)
            with self.path.open('a', encoding='utf-8'):
                pass
        except OSError as error:
            raise TranscriptError(f'{self.path}: {error.strerror or error}') from None

    def write(self, exchange: Exchange) -> None:
        """Append one exchange, whole or not at all. Raises OSError where the disk refuses it."""
        line = json.dumps(exchange.to_json(), allow_nan=False).encode() + b'\n'
        # Opened anew for each: answers are rare, and no file is left open by a source replaced.
        # Without a buffer it is one write, which another process's line cannot part.
        with self._lock, self.path.open('ab', buffering=0) as file:
            end = file.tell()
            if file.write(line) != len(line):
                file.truncate(end)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _end_last_line(path: Path) -> None:
    """Make the file end with a line end: finish a whole last line, remove a cut-off one."""
    if not path.exists():
        return
    data = path.read_bytes()
    if not data or data.endswith(b'\n'):
        return
    start = data.rfind(b'\n') + 1
    try:
        json.loads(data[start:])
    except (ValueError, RecursionError):
        with path.open('r+b') as file:
            file.truncate(start)
    else:
        with path.open('ab') as file:
            file.write(b'\n')
