# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Find the files that come with the package, however it was installed, and those of the user."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from llm_astar_msgs_adapter.errors import nearest_name

PACKAGE = 'llm_astar_planner'
# Our 1000 samples on 100 maps.
SAMPLES_FILE = 'samples_1000.json'


def share_folders() -> Iterator[Path]:
    """Yield the folders that may hold `maps/` and `config/`: installed ones, then a checkout."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in [*filter(None, prefixes), sys.prefix]:
        yield Path(prefix) / 'share' / PACKAGE
    yield Path(__file__).resolve().parents[3]


def state_file(name: str) -> Path:
    """Return where a file is kept that the user's programs remember something in."""
    state = os.environ.get('XDG_STATE_HOME') or Path.home() / '.local' / 'state'
    path = Path(state, 'llm_astar', name)
    with suppress(OSError):  # who writes it says so
        path.parent.mkdir(parents=True, exist_ok=True)
    return path


def find_file(name: str, folder: str) -> Path:
    """Return the path of a file: `name` if it exists, else the file of that name in `folder`.

    Its ending `.yaml` may be left out there: `depot` is the map of maps/depot.yaml. Raises
    FileNotFoundError naming the files that the folder holds.
    """
    folders = [share / folder for share in share_folders()]
    shipped = (place / file for place in folders for file in (name, f'{name}.yaml'))
    for path in (Path(name).expanduser(), *shipped):
        if path.is_file():
            return path
    known = sorted({file.name for place in folders for file in place.glob('*')})
    near = nearest_name(name, [Path(file).stem for file in known])
    holds = f'{", ".join(known) or "nothing"}{near}'
    raise FileNotFoundError(f'{name!r} is not a file, and {folder}/ holds {holds}')
