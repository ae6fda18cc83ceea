# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Reads files and JSON that somebody else wrote: bounded in size, and every error named.

What a parameter or a field of a file names may be a device, a FIFO or a file of many gigabytes,
and its contents may be made to take all time or memory.
"""

import contextlib
import json
import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml

from llm_astar_msgs_adapter.errors import LlmAstarError, raising

# Larger than any dataset or transcript; a prompt or a yaml file of this size is none.
MAX_BYTES = 64 * 2**20
MAX_YAML_BYTES = 2**20
# Of JSON: values, which take up to 300 bytes each as Python's, by the signs that begin or follow
# one.
MAX_VALUES = 800_000
SIGNS = '[{,'
# Of yaml: collections in one another, values and ends of collections, which take 30 us each, and
# characters of one value.
MAX_DEPTH = 50
MAX_EVENTS = 100_000
MAX_SCALAR = 2**12
# The one in C is ten times as fast.
YAML_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


@contextlib.contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Name the file that is written in an OSError that does not: a full disk raises such a one."""
    try:
        yield
    except OSError as error:
        if error.filename is not None or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


def read_bytes(path: str | Path, kind: type[LlmAstarError], limit: int = MAX_BYTES) -> bytes:
    """Return the contents of a regular file of at most `limit` bytes.

    Raises an error of this kind, which names the file.
    """
    try:
        # Before it is opened: a FIFO would be waited for until somebody writes to it.
        about = os.stat(path)
        if stat.S_ISREG(about.st_mode) and about.st_size <= limit:
            with open(path, 'rb') as file:
                # Not up to the limit: Python takes the memory for as much as is asked for.
                return file.read(about.st_size)
    except (OSError, ValueError) as error:
        raise kind(f'{path}: {getattr(error, "strerror", None) or error}') from None
    if not stat.S_ISREG(about.st_mode):
        raise kind(f'{path}: is not a regular file')
    raise kind(f'{path}: is over {limit / 1e6:.3g} MB')


def read_text(
    path: str | Path,
    kind: type[LlmAstarError],
    encoding: str = 'utf-8',
    errors: str = 'strict',
    limit: int = MAX_BYTES,
) -> str:
    """Return the contents of a text file as `read_bytes` does, with the line ends of Unix.

    `encoding` and `errors` are those of `open`.
    """
    contents = read_bytes(path, kind, limit)
    with raising(kind, f'{path}: ', UnicodeDecodeError):
        text = contents.decode(encoding, errors)
    return text.replace('\r\n', '\n').replace('\r', '\n')


def read_json(path: str | Path, kind: type[LlmAstarError], limit: int = MAX_BYTES) -> Any:  # noqa: ANN401 - any JSON value
    """Return the value in a JSON file. Raises an error of this kind."""
    contents = read_bytes(path, kind, limit)
    with raising(kind, f'{path}: not JSON: ', ValueError):
        return parse_json(contents)


def read_yaml(path: str | Path, kind: type[LlmAstarError], limit: int = MAX_YAML_BYTES) -> Any:  # noqa: ANN401 - any yaml value
    """Return the value in a yaml file without aliases, which ROS does not read either.

    Raises an error of this kind.
    """
    return parse_yaml(read_text(path, kind, limit=limit), path, kind)


def parse_yaml(text: str, path: str | Path, kind: type[LlmAstarError]) -> Any:  # noqa: ANN401 - any yaml value
    """Return the value in a yaml text, as `read_yaml` does; messages name `path`."""
    try:
        check_events(yaml.parse(text, YAML_LOADER))
        return yaml.load(text, YAML_LOADER)  # noqa: S506 - a safe loader
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        # Values too are read here: "month must be in 1..12" is one of a date.
        raise kind(f'{path}: not yaml: {" ".join(str(error).split())}') from None


def check_events(events: Iterable[yaml.Event]) -> None:
    """Raise ValueError for what few bytes of yaml make costly, before values are made of it.

    These are aliases, with which few bytes stand for a value without end, deep nesting, very many
    values, and numbers of many digits, which `1:30:00` may be as well.
    """
    depth = 0
    for count, event in enumerate(events):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        problem = 'is nested too deeply' if depth > MAX_DEPTH else ''
        if isinstance(event, yaml.AliasEvent):
            problem = 'aliases are not supported'
        elif isinstance(event, yaml.ScalarEvent) and len(event.value) > MAX_SCALAR:
            problem = f'over {MAX_SCALAR} characters'
        if problem:
            raise ValueError(f'line {event.start_mark.line + 1}: {problem}')
        if count > MAX_EVENTS:
            raise ValueError(f'over {MAX_EVENTS} values')


def parse_json(text: str | bytes) -> Any:  # noqa: ANN401 - any JSON value
    """Return a JSON value. Raises ValueError, also where it is too deep or has too many values."""
    signs: Any = SIGNS if isinstance(text, str) else SIGNS.encode()
    if sum(map(text.count, signs)) > MAX_VALUES:
        raise ValueError(f'over {MAX_VALUES} values')
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError('is nested too deeply') from None
