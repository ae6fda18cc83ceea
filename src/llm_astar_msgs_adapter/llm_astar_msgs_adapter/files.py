"""Reads files that somebody else wrote: regular ones of a bounded size, and every error named.

What a parameter or a field of a file names may be a device, a FIFO or a file of many gigabytes,
and its contents may be made to take all time or memory.
"""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import Any

import yaml

from llm_astar_msgs_adapter.errors import LlmAstarError

# Larger than any dataset or transcript; a prompt or a yaml file of this size is none.
MAX_BYTES = 64 * 2**20
MAX_YAML_BYTES = 2**20


def read_bytes(path: str | Path, kind: type[LlmAstarError], limit: int = MAX_BYTES) -> bytes:
    """Return the contents of a regular file of at most `limit` bytes.

    Raises an error of this kind, which names the file.
    """
    try:
        # Before it is opened: a FIFO would be waited for until somebody writes to it.
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise kind(f'{path}: is not a regular file')
        with open(path, 'rb') as file:
            contents = file.read(limit + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, kind):
            raise
        raise kind(f'{path}: {getattr(error, "strerror", None) or error}') from None
    if len(contents) > limit:
        raise kind(f'{path}: is over {limit / 1e6:.3g} MB')
    return contents


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
    try:
        text = contents.decode(encoding, errors)
    except UnicodeDecodeError as error:
        raise kind(f'{path}: {error}') from None
    return text.replace('\r\n', '\n').replace('\r', '\n')


def read_json(path: str | Path, kind: type[LlmAstarError], limit: int = MAX_BYTES) -> Any:  # noqa: ANN401 - any JSON value
    """Return the value in a JSON file. Raises an error of this kind."""
    contents = read_bytes(path, kind, limit)
    try:
        return json.loads(contents)
    except RecursionError:
        raise kind(f'{path}: not JSON: is nested too deeply') from None
    except ValueError as error:
        raise kind(f'{path}: not JSON: {error}') from None


class PlainLoader(yaml.SafeLoader):  # type: ignore[misc] # yaml has no types
    """Reads yaml without aliases, with which few bytes stand for a value without end."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose a node. Raises ComposerError for an alias."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.composer.ComposerError(None, None, 'aliases are not supported', mark)
        return super().compose_node(parent, index)


def read_yaml(path: str | Path, kind: type[LlmAstarError], limit: int = MAX_YAML_BYTES) -> Any:  # noqa: ANN401 - any yaml value
    """Return the value in a yaml file without aliases, which ROS does not read either.

    Raises an error of this kind.
    """
    text = read_text(path, kind, limit=limit)
    try:
        return yaml.load(text, PlainLoader)  # noqa: S506 - a SafeLoader
    except RecursionError:
        raise kind(f'{path}: not yaml: is nested too deeply') from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        # Values too are read here: "month must be in 1..12" is one of a date.
        raise kind(f'{path}: not yaml: {" ".join(str(error).split())}') from None
