# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Transcripts: exchanges with a model as JSON Lines, read and written.

A line holds `map, pair, scale, model, prompt, messages, response, prompt_tokens,
completion_tokens, seconds, status`, and what is known of the fields of `Provenance`. Coordinates
in it are the map's lattice coordinates. Where a big map was described on a coarser lattice, `unit`
is its step in cells.
"""

import errno
import json
import logging
import mmap
import os
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, TypeGuard

from llm_astar_msgs_adapter.errors import LlmAstarError, expect, short_repr
from llm_astar_msgs_adapter.files import parse_json, read_text

from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.source import Message, Provenance, SampleKey, SourceStatus

_LOG = logging.getLogger(__name__)
# Of a transcript: a few thousand exchanges with long prompts.
MAX_BYTES = 32_000_000
MAX_LINES = 100_000
# Tokens, seconds and a temperature, so that sums of them are numbers.
MAX_NUMBER = 1e15
# What is wrong with a last line that is not whole.
CUT_OFF = 'cut off while it was written'
# The first field of a line: one about waypoints, and one about an instruction.
FIRST_FIELDS = (b'"map"', b'"text"')


class TranscriptError(LlmAstarError, ValueError):
    """A transcript cannot be used; the message names the file, the line and the field."""


@dataclass(frozen=True)
class Exchange:
    """One query to a model and its answer.

    `map` is a map id of a dataset, or the digest of a live grid; `pair` is the index of the
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
    provenance: Provenance = sources.UNKNOWN_PROVENANCE

    @property
    def sample(self) -> SampleKey:
        """The sample that the query was about."""
        return SampleKey(self.map, self.pair, self.scale)

    @property
    def is_answered(self) -> bool:
        """Whether the model answered, if only with an empty text."""
        return bool(self.response) or self.status.is_answer

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object of a transcript line."""
        record = vars(self) | self.provenance._asdict()
        del record['provenance']
        record['messages'] = [message._asdict() for message in self.messages]
        record['status'] = self.status.value
        return {name: value for name, value in record.items() if value != _DEFAULTS.get(name)}


# The fields of a line, and the types of those that are no texts.
_FIELDS = tuple(field.name for field in fields(Exchange) if field.name != 'provenance')
_TYPES: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(('map', 'pair'), (int, str)),
    **dict.fromkeys(('scale', 'unit', 'prompt_tokens', 'completion_tokens', 'seed'), (int,)),
    **dict.fromkeys(('seconds', 'temperature'), (int, float)),
    'messages': (list,),
}
# The least values of numbers; the greatest is MAX_NUMBER.
_LEAST = {
    **dict.fromkeys(('scale', 'unit'), 1),
    **dict.fromkeys(('prompt_tokens', 'completion_tokens', 'seconds'), 0),
    **dict.fromkeys(('seed', 'temperature'), -MAX_NUMBER),
}
# The fields that stand in logs and tables, and those that a line may leave out.
_NAMES = {'model', 'prompt', *Provenance._fields}
_DEFAULTS: dict[str, Any] = {'unit': 1, **sources.UNKNOWN_PROVENANCE._asdict()}


def read_transcript(path: str | Path) -> list[Exchange]:
    """Read every exchange about waypoints of a transcript, in the order they were recorded.

    Raises TranscriptError for anything malformed; see `read_records`.
    """
    return [
        parse_exchange(record, where)
        for where, record in read_records(Path(path))
        if not is_about_instruction(record)
    ]


def is_about_instruction(record: object) -> TypeGuard[dict[str, Any]]:
    """Return whether a line holds the reply to an instruction, which lies in the same file."""
    return isinstance(record, dict) and 'reply' in record


def read_records(path: Path) -> Iterator[tuple[str, object]]:
    """Read the lines of a JSON Lines file: where each is, for errors, and its value.

    A last line that was cut off is skipped with a logged warning. Raises TranscriptError for
    anything else that is malformed.
    """
    for where, record, problem in read_lines(path):
        if problem == CUT_OFF:
            _LOG.warning('%s: %s: %s; skipped', path, where, problem)
        elif problem:
            raise TranscriptError(f'{path}: {where}: {problem}')
        else:
            yield f'{path}: {where}', record


def read_lines(path: Path) -> Iterator[tuple[str, object, str]]:
    """Yield for each line that is not blank where it is, its value, and what is wrong with it.

    That is '' for nothing, and CUT_OFF for a last line that has no line end and does not parse.
    Raises TranscriptError where the file cannot be read or is too long.
    """
    text = read_text(path, TranscriptError, errors='replace', limit=MAX_BYTES)
    if text.count('\n') > MAX_LINES:
        raise TranscriptError(f'{path}: over {MAX_LINES} lines')
    lines = text.split('\n')
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                record, problem = parse_json(line), ''
            except ValueError as error:
                problem = CUT_OFF if number == len(lines) else f'not JSON: {error}'
                record = None
            yield f'line {number}', record, problem


def parse_exchange(record: object, where: str = 'exchange') -> Exchange:
    """Validate one record. Raises TranscriptError that begins with `where` and names the field."""
    held = expect(record, dict, where, 'an object', TranscriptError)
    known = {name: held[name] for name in Provenance._fields if held.get(name) is not None}
    values = _DEFAULTS | held | known
    for name in (*_FIELDS, *known):
        if name not in values:
            raise TranscriptError(f'{where}: {name}: is missing')
        check_field(name, values[name], where)
    values['messages'] = tuple(
        parse_message(message, f'{where}: messages[{index}]')
        for index, message in enumerate(values['messages'])
    )
    values['status'] = SourceStatus(values['status'])
    return Exchange(**{name: values[name] for name in _FIELDS}, provenance=Provenance(**known))


def check_field(name: str, value: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
    """Raise TranscriptError where a field of an exchange cannot have a value."""
    check_type(value, _TYPES.get(name, (str,)), f'{where}: {name}')
    if name in _LEAST and not _LEAST[name] <= value <= MAX_NUMBER:
        words = f'{_LEAST[name]:g} to {MAX_NUMBER:g}'
        raise TranscriptError(f'{where}: {name}: {short_repr(value)} is not {words}')
    if name in _NAMES and isinstance(value, str):
        check_names({name: value}, where, name)
    if name == 'status' and value not in SourceStatus.__members__:
        known = ', '.join(SourceStatus.__members__)
        raise TranscriptError(f'{where}: status: {short_repr(value)} is none of {known}')
    if name == 'time':
        try:
            parse_time(value)
        except ValueError:
            problem = f'{short_repr(value)} is no time such as 2026-01-31T12:00:00+00:00'
            raise TranscriptError(f'{where}: time: {problem}') from None


def parse_time(text: str) -> datetime:
    """Read a time in ISO 8601, UTC where it names no zone. Raises ValueError."""
    # Python 3.10 does not read a Z.
    time = datetime.fromisoformat(text.replace('Z', '+00:00'))
    return time if time.tzinfo else time.replace(tzinfo=timezone.utc)


def check_type(value: object, types: tuple[type, ...], name: str) -> None:
    """Raise TranscriptError where a JSON value has none of the types; true is not a number."""
    if isinstance(value, bool) or not isinstance(value, types):
        expected = ' or '.join(kind.__name__ for kind in types)
        raise TranscriptError(f'{name}: {expected} is expected, not {str(value)[:60]!r}')


def check_names(values: Mapping[str, Any], where: str, *fields: str) -> None:
    """Raise TranscriptError where a field is no name: it stands in logs and tables."""
    for field in fields:
        problem = sources.name_problem(values[field])
        if problem:
            raise TranscriptError(f'{where}: {field}: {problem}')


def parse_message(value: object, name: str) -> Message:
    """Validate one message of a chat. Raises TranscriptError that begins with `name`."""
    held = expect(value, dict, name, 'an object', TranscriptError)
    for field in ('role', 'content'):
        check_type(held.get(field), (str,), f'{name}: {field}')
    return Message(held['role'], held['content'])


class TranscriptWriter:
    """Appends exchanges to a transcript; each is on disk before `write` returns. Thread-safe."""

    def __init__(self, path: str | Path) -> None:
        """Open `path` for appending, after setting a last line aside that was cut off.

        Raises TranscriptError where the file is no transcript or cannot be written.
        """
        self.path = Path(path)
        self._lock = threading.Lock()
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            repair_last_line(self.path)
            with self.path.open('a', encoding='utf-8'):
                pass
        except OSError as error:
            raise TranscriptError(f'{self.path}: {error.strerror or error}') from None

    def write(self, record: Mapping[str, Any]) -> None:
        """Append the JSON object of one exchange, whole or not at all.

        Raises OSError where the disk refuses it, ValueError for a number that JSON does not have.
        """
        line = json.dumps(record, allow_nan=False).encode() + b'\n'
        # The file is opened for each write: answers are rare, and a source that is replaced
        # leaves no open file behind. An unbuffered write is one system call, so lines of
        # several processes do not mix.
        with self._lock, self.path.open('ab', buffering=0) as file:
            end = file.tell()
            if file.write(line) != len(line):
                file.truncate(end)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))


def repair_last_line(path: Path) -> None:
    """Make a transcript end with a line end: complete a whole last line, set a cut-off one aside.

    The cut-off line is kept in a file beside it, `<name>.cut`. Raises TranscriptError for a file
    that is no transcript, which is left as it is.
    """
    if not path.exists():
        return
    if not path.is_file():
        raise TranscriptError(f'{path}: is not a regular file')
    if not path.stat().st_size:
        return
    with path.open('rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        first = file.readline(MAX_BYTES)
        if not first.startswith(b'{') or not any(name in first for name in FIRST_FIELDS):
            raise TranscriptError(f'{path}: is no transcript, and is left as it is')
        start = data.rfind(b'\n', 0) + 1
        if len(data) - start > MAX_BYTES:
            raise TranscriptError(f'{path}: its last line is over {MAX_BYTES / 1e6:.3g} MB')
        last = data[start:]
    if not last:
        return
    try:
        parse_json(last)
    except ValueError:
        with path.with_name(f'{path.name}.cut').open('ab') as aside:
            aside.write(last + b'\n')
        os.truncate(path, start)
        _LOG.warning('%s: its last line was cut off and is kept in %s.cut', path, path.name)
    else:
        with path.open('ab') as whole:
            whole.write(b'\n')
