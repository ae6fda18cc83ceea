"""The results section of a README, written by a command and never by hand."""

from __future__ import annotations

from pathlib import Path

BEGIN, END = '<!-- results:begin -->', '<!-- results:end -->'


def replace_section(path: Path, section: str) -> None:
    """Put `section` between the marker lines of a text file; the rest stays as it is.

    Raises ValueError where the markers are missing or out of order, OSError where the file is.
    """
    text = path.read_text(encoding='utf-8')
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not (begin and end):
        message = f'{path}: the lines {BEGIN} and {END} are missing or out of order'
        raise ValueError(message)
    path.write_text(f'{head}{BEGIN}\n{section.strip()}\n{END}{tail}', encoding='utf-8')
