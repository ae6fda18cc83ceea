"""The file that a command draws into, checked before any work is done for it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

# What matplotlib writes; importing it only to ask takes most of a second.
FORMATS = ('.png', '.svg', '.pdf', '.jpg', '.jpeg', '.webp', '.tif', '.tiff', '.eps', '.ps')
ANIMATIONS = ('.gif',)


def picture_file(text: str) -> str:
    """Return the name of a picture. Raises ArgumentTypeError for an ending that none has."""
    return checked(text, FORMATS)


def picture_or_animation(text: str) -> str:
    """Return the name of a picture or an animation. Raises ArgumentTypeError for another."""
    return checked(text, (*ANIMATIONS, *FORMATS))


def checked(text: str, endings: tuple[str, ...]) -> str:
    """Return the name of a file with one of the endings. Raises ArgumentTypeError otherwise."""
    path = Path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f'{text}: Is a directory; a file is expected')
    if path.suffix.lower() not in endings:
        named = f'ends in {path.suffix!r}' if path.suffix else 'has no ending'
        allowed = ', '.join(endings)
        raise argparse.ArgumentTypeError(f'{text} {named}; the ending is one of {allowed}')
    return text


def add_picture_option(group: Any, text: str, default: str | None = None) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--png`, which may be called `--out` as in other commands; `text` says what is drawn."""
    shown = ' (default: %(default)s)' if default else ''
    group.add_argument(
        '--png',
        type=picture_file,
        default=default,
        metavar='FILE',
        help=f'{text}, into a file whose ending says how: .png, .svg, .pdf, .jpg{shown}',
    )
    hidden = argparse.SUPPRESS
    group.add_argument('--out', dest='png', type=picture_file, default=hidden, help=hidden)
