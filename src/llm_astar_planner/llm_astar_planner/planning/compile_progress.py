"""Shows on stderr that the searches are being compiled, which takes seconds the first time."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Iterator
from typing import TextIO

from llm_astar_planner.planning.kernel_compiler import (
    ANNOUNCEMENT,
    EXPECTED_SECONDS,
    compilations,
    progress_line,
)

REFRESH_SECONDS = 0.2
# The ANSI sequence that clears a line from the cursor on.
CLEAR = '\r\x1b[K'


@contextlib.contextmanager
def compile_progress(stream: TextIO | None = None) -> Iterator[None]:
    """Show what this thread compiles: a live line on a terminal, else when it begins and ends."""
    progress = CompileProgress(stream or sys.stderr)
    try:
        with compilations(progress.on_compile):
            yield
    finally:
        progress.close()


class CompileProgress:
    """Writes nothing before the first compilation."""

    def __init__(self, stream: TextIO) -> None:
        """Take where to write."""
        self._stream = stream
        self._is_live = stream.isatty() and os.environ.get('TERM', 'dumb') != 'dumb'
        self._function = ''
        self._began = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self.refresh, daemon=True)

    def on_compile(self, function: str) -> None:
        """Note which function is compiled now."""
        self._function = function
        if self._began:
            return
        self._began = time.monotonic()
        if self._is_live:
            self._thread.start()
        else:
            self._stream.write(f'{ANNOUNCEMENT}, about {EXPECTED_SECONDS} s\n')

    def refresh(self) -> None:
        """Rewrite the live line until closed."""
        while not self._ended.wait(REFRESH_SECONDS):
            line = progress_line(time.monotonic() - self._began, self._function)
            self._stream.write(CLEAR + line)
            self._stream.flush()

    def close(self) -> None:
        """Say how long it took, if anything was compiled."""
        if not self._began:
            return
        self._ended.set()
        if self._is_live:
            self._thread.join()
            self._stream.write(CLEAR)
        self._stream.write(f'searches compiled in {time.monotonic() - self._began:.1f} s\n')
        self._stream.flush()
