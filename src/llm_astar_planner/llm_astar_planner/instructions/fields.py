# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Fields of specifications in JSON: read with errors that name the clause and the field."""

from collections.abc import Collection, Mapping
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr

MAX_NAME_CHARS = 80
# Of what a person is asked about a clause.
MAX_QUESTION_CHARS = 300
MAX_METRES = 1000.0
# Metres. No map is farther away than this.
FAR = 1e6
Fields = Mapping[str, Any]


class SpecificationError(LlmAstarError, ValueError):
    """A malformed specification; the message names the clause and the field."""


def as_mapping(value: object, where: str) -> Fields:
    """Return a JSON object. Raises SpecificationError otherwise."""
    if not isinstance(value, Mapping):
        raise SpecificationError(f'{where}: is not an object')
    return value


def as_text(value: object, where: str, most: int = MAX_NAME_CHARS) -> str:
    """Return a text of 1 to `most` characters. Raises SpecificationError otherwise."""
    if not isinstance(value, str) or not 1 <= len(value) <= most:
        raise SpecificationError(f'{where}: is not a text of 1 to {most} characters')
    return value


def as_choice(value: object, where: str, choices: Collection[str]) -> str:
    """Return one of some texts. Raises SpecificationError otherwise."""
    if not isinstance(value, str) or value not in choices:
        raise SpecificationError(
            f'{where}: {short_repr(value)} is not one of {", ".join(choices)}'
        )
    return value


def as_number(value: object, where: str, least: float, most: float) -> float:
    """Return a number within limits. Raises SpecificationError otherwise."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:  # type: ignore[operator]
        raise SpecificationError(
            f'{where}: {short_repr(value)} is not a number from {least:g} to {most:g}'
        )
    return float(value)  # type: ignore[arg-type]


def as_numbers(value: object, where: str, count: int) -> list[float]:
    """Return a list of numbers within FAR. Raises SpecificationError otherwise."""
    return [as_number(item, where, -FAR, FAR) for item in as_list(value, where, 'numbers', count)]


def as_list(value: object, where: str, what: str = 'regions', count: int = 0) -> list[Any]:
    """Return a list of `count` elements, 0: of one at least. Raises SpecificationError."""
    if not isinstance(value, list) or not value or len(value) != (count or len(value)):
        raise SpecificationError(f'{where}: is not a list of {f"{count} " if count else ""}{what}')
    return value


def as_count(value: object, where: str, most: int) -> int:
    """Return a whole number from 0. Raises SpecificationError otherwise."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= most:
        raise SpecificationError(
            f'{where}: {short_repr(value)} is not a whole number from 0 to {most}'
        )
    return value
