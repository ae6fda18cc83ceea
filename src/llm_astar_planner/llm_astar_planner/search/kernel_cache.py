# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Where numba keeps the compiled kernels: in a folder that this process can write.

numba writes next to the modules, else below the user's cache folder, and refuses to work where it
can write neither: in an installation of another user without a HOME, or on a read-only disk. There
this names another folder, and fills it with what was compiled at the installation.
A NUMBA_CACHE_DIR that can be written decides alone.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from llm_astar_planner.lazy import numba

NAME = 'llm_astar_planner'
# The folder that was chosen here, None while numba's own are good.
_CHOSEN: list[Path] = []
# Whether the kernels stay Python in this process: numba's own variable says so. For one plan on a
# map of a few thousand cells: to import numba and to load what it has compiled takes longer.
INTERPRETED = os.environ.get('NUMBA_DISABLE_JIT', '') not in {'', '0'}


def jit(loop: Callable[..., Any]) -> Any:  # noqa: ANN401 - numba is not typed
    """Return a loop that numba compiles at its first call and keeps; other threads run on."""
    if INTERPRETED:
        return loop
    folder = Path(loop.__code__.co_filename).parent
    prepare_cache(folder)
    compiled = numba.njit(cache=True, nogil=True)(loop)
    if _CHOSEN:
        copy_compiled(folder / '__pycache__', Path(compiled.stats.cache_path))
    return compiled


def inlined(loop: Callable[..., Any]) -> Any:  # noqa: ANN401 - numba is not typed
    """Return a small part of inner loops, which numba writes out where it is called."""
    return loop if INTERPRETED else numba.njit(inline='always')(loop)


@cache
def prepare_cache(folder: Path) -> None:
    """Make sure that numba can keep what it compiles of the modules in a folder."""
    config = numba.config
    if config.CACHE_DIR and not is_writable(Path(config.CACHE_DIR)):
        say(f'warning: NUMBA_CACHE_DIR={config.CACHE_DIR} cannot be written and is ignored')
        # Also for the processes that this one starts.
        os.environ.pop('NUMBA_CACHE_DIR', None)
        config.CACHE_DIR = ''
    if not (config.CACHE_DIR or is_writable(folder / '__pycache__')):
        _CHOSEN.append(writable_folder())
        config.CACHE_DIR = str(_CHOSEN[0])


def say(sentence: str) -> None:
    """Tell the user; this is too early for the log of a node."""
    sys.stderr.write(f'llm-astar: {sentence}\n')


def is_writable(folder: Path) -> bool:
    """Tell whether files can be written to a folder, which is made if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def writable_folder() -> Path:
    """Return a folder below the user's cache folder, else say so and return a temporary one.

    Raises OSError if there is no folder at all that can be written.
    """
    try:
        folder = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache', NAME)
    except RuntimeError:  # nobody's home
        pass
    else:
        if is_writable(folder):
            return folder
    folder = temporary_folder()
    words = 'neither the installation nor a home can be written, so compiled searches are kept in'
    say(f'{words} {folder}; NUMBA_CACHE_DIR may name another folder')
    return folder


def temporary_folder() -> Path:
    """Return a folder for temporary files of this user alone, the same one each time if possible.

    Raises OSError if there is no folder at all that can be written.
    """
    parent = tempfile.gettempdir()
    folder = Path(parent, f'{NAME}_{os.getuid()}')
    # numba unpickles what is there, so nobody else may write it.
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return Path(tempfile.mkdtemp(prefix=NAME, dir=parent))
    is_own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    if is_own and not found.st_mode & 0o077 and is_writable(folder):
        return folder
    return Path(tempfile.mkdtemp(prefix=NAME, dir=parent))


@cache
def copy_compiled(source: Path, target: Path) -> None:
    """Copy numba's files that are missing or older in `target`, each in one step.

    The indices come last: a process that starts at the same time finds what they name.
    """
    for pattern in ('*.nbc', '*.nbi'):
        for file in source.glob(pattern):
            copy = target / file.name
            if copy.exists() and copy.stat().st_mtime >= file.stat().st_mtime:
                continue
            target.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=target, delete=False) as half:
                pass
            shutil.copy2(file, half.name)
            os.replace(half.name, copy)
