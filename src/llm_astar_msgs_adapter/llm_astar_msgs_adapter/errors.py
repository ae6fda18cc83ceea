"""The base class of every error raised for bad input, bad files or a failed service."""

from __future__ import annotations

# The longest value that is shown in a message.
SHOWN = 60


class LlmAstarError(Exception):
    """An error that a user can correct; the message names the file, the entry and the field.

    Subclasses are also ValueError, RuntimeError and so on, where callers expect those.
    """


def short_repr(value: object) -> str:
    """Return the repr of a value for a message, cut off where it is long."""
    return shortened(repr(value))


def shortened(text: str, most: int = SHOWN) -> str:
    """Return a text for a message, cut off where it has more than `most` characters."""
    return text if len(text) <= most else text[: most - 3] + '...'
