# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The base class of every error raised for bad input, bad files or a failed service."""

import reprlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

_T = TypeVar('_T')
# The longest value that is shown in a message.
SHOWN = 60


# The repr of a nested or long value is written no further than it is shown.
BOUNDED = reprlib.Repr()
BOUNDED.maxstring = BOUNDED.maxother = BOUNDED.maxlong = 2 * SHOWN
BOUNDED.maxlist = BOUNDED.maxtuple = BOUNDED.maxdict = SHOWN // 2


class LlmAstarError(Exception):
    """An error that a user can correct; the message names the file, the entry and the field.

    Subclasses are also ValueError, RuntimeError and so on, where callers expect those.
    """


@contextmanager
def raising(kind: Callable[..., Exception], head: str, *caught: type[Exception]) -> Iterator[None]:
    """Raise an error of this kind in the place of others that a block raises.

    Its message is theirs, behind the head.
    """
    try:
        yield
    except caught as error:
        raise kind(f'{head}{error}') from None


def short_repr(value: object) -> str:
    """Return the repr of a value for a message, cut off where it is long."""
    return shortened(BOUNDED.repr(value))


def shortened(text: str, most: int = SHOWN) -> str:
    """Return a text for a message, cut off where it has more than `most` characters."""
    return text if len(text) <= most else text[: most - 3] + '...'


def printable(text: str) -> str:
    """Return `text` in one line, with a question mark for each character that cannot be shown.

    So no control byte or text direction of a file or a server reaches a terminal.
    """
    line = ' '.join(text.split())
    return ''.join(letter if letter.isprintable() else '?' for letter in line)


def nearest_name(name: str, known: Iterable[str], likeness: float = 0.5) -> str:
    """Return the end of a sentence about an unknown name: which known one may be meant."""
    import difflib  # noqa: PLC0415 - for errors alone

    near = difflib.get_close_matches(name, list(known), n=1, cutoff=likeness)
    return f'; did you mean {near[0]}?' if near else ''


def expect(
    value: object, kind: type[_T], where: str, words: str, error: type[LlmAstarError]
) -> _T:
    """Return a JSON value of a kind; true is no number.

    Raises an error that begins with `where`, says that `words` are expected, and shows the value.
    """
    if isinstance(value, kind) and (kind is bool or not isinstance(value, bool)):
        return value
    raise error(f'{where}: {words} is expected, not {short_repr(value)}')
