"""Find the maps and parameter files that come with the package, however it was installed."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGE = 'llm_astar_planner'


def share_folders() -> Iterator[Path]:
    """Yield where `maps/` and `config/` may be: installed prefixes, then a source checkout."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in [*filter(None, prefixes), sys.prefix]:
        yield Path(prefix) / 'share' / PACKAGE
    yield Path(__file__).resolve().parents[3]


def find_file(name: str, folder: str) -> Path:
    """Return the file `name` is: a path that exists, else a file of that name in `folder`.

    Raises FileNotFoundError naming the files there are.
    """
    path = Path(name).expanduser()
    if path.is_file():
        return path
    for share in share_folders():
        if (share / folder / name).is_file():
            return share / folder / name
    known = sorted({file.name for share in share_folders() for file in (share / folder).glob('*')})
    there = ', '.join(known) or 'nothing'
    raise FileNotFoundError(f'{name!r} is no file, and {folder}/ holds {there}')
