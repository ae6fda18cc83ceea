"""How the values of options are read; argparse shows the errors that these raise."""

from __future__ import annotations

import argparse
from pathlib import Path

from llm_astar_planner.resources import find_file

from llm_astar_lab.analysis.thresholds import Threshold, parse_threshold


def names(text: str) -> list[str]:
    """Parse one or more names, separated by commas."""
    found = [name for name in text.split(',') if name]
    if not found:
        raise argparse.ArgumentTypeError('names are expected, separated by commas')
    return found


def file_names(text: str) -> list[str]:
    """Parse paths of files or names in maps/, separated by commas unless one has a comma."""
    if Path(text).is_file():
        return [text]
    return [str(find_file(name, 'maps')) for name in names(text)]


def threshold(text: str) -> Threshold:
    """Parse VARIANT:METRIC=LIMIT."""
    try:
        return parse_threshold(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def count(text: str) -> int:
    """Parse a whole number, 1 or more."""
    return whole_number(text, 1)


def seed(text: str) -> int:
    """Parse a whole number, 0 or more."""
    return whole_number(text, 0)


def whole_number(text: str, least: int) -> int:
    """Parse a whole number of at least `least`."""
    try:
        number = int(text)
    except ValueError:
        number = least - 1
    if number < least:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number of at least {least}')
    return number
