"""Compiles the kernels in the background, those that a first plan needs first."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

from numba.core import config as numba_config
from numba.core import event

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.compile import (
    compile_costmap,
    compile_for,
    compile_instruction_kernels,
    compile_kernels,
)

EXPECTED_SECONDS = 15
# Seconds between two looks at whether a plan may still wait.
POLL_SECONDS = 0.02
# Seconds to wait in `close` until the kernel that is being compiled is ready.
LONGEST_KERNEL = 3.0


class Compiled(IntEnum):
    """What is compiled so far, in this order."""

    NOTHING = 0
    USUAL = 1  # what plans under the settings of the start take
    MAP_CHANGES = 2
    INSTRUCTIONS = 3
    EVERYTHING = 4


class CompilationStopped(BaseException):
    """The compiler was closed; nothing in numba may catch it."""


class KernelCompiler(event.Listener):
    """Compiles the kernels on a thread of its own, or loads them from numba's cache.

    Where nothing has to be compiled that takes half a second. `report` gets a sentence when it
    begins to compile, and one when plans can go on.
    """

    def __init__(
        self, config: CostmapConfig, fields: Mapping[str, Any], report: Callable[[str], None]
    ) -> None:
        """Start; what plans on costmaps of `config` with requests of `fields` take comes first."""
        self.compiled = Compiled.NOTHING
        self._config = config
        self._fields = fields
        self._report = report
        self._changed = threading.Condition()
        self._began = time.monotonic()
        self._is_compiling = self._is_closed = False
        self._thread = threading.Thread(target=self.work, name='compiler', daemon=True)
        self._thread.start()

    def wait(self, needed: Compiled, may_wait: Callable[[], bool] = lambda: True) -> bool:
        """Wait until what is `needed` is compiled, while `may_wait()`; tell whether it is.

        Raises what `may_wait` raises.
        """
        with self._changed:
            while self.compiled < needed and not self._is_closed and may_wait():
                self._changed.wait(POLL_SECONDS)
            return self.compiled >= needed

    def close(self) -> None:
        """Stop compiling; what is compiled stays."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._thread.join(LONGEST_KERNEL)

    def work(self) -> None:
        """Compile everything, step by step, until closed."""
        with event.install_listener('numba:compile', self):
            try:
                self.step(lambda: compile_for(self._config, self._fields), Compiled.USUAL)
                self.step(lambda: compile_costmap(self._config), Compiled.MAP_CHANGES)
                self.step(compile_instruction_kernels, Compiled.INSTRUCTIONS)
                self.step(compile_kernels, Compiled.EVERYTHING)
            except CompilationStopped:
                pass

    def step(self, run: Callable[[], None], compiled: Compiled) -> None:
        """Run one step and say that it is done.

        Where it fails, plans go on: each compiles on its own then, and says what is wrong.
        """
        try:
            run()
        except Exception as error:  # noqa: BLE001 - whatever numba raises
            self._report(f'the searches do not compile: {type(error).__name__}: {error}')
        with self._changed:
            self.compiled = compiled
            self._changed.notify_all()
        if self._is_compiling and compiled in (Compiled.USUAL, Compiled.EVERYTHING):
            what = 'plans go on' if compiled is Compiled.USUAL else 'all of them'
            self._report(f'searches compiled in {time.monotonic() - self._began:.1f} s: {what}')

    def on_start(self, _: event.Event) -> None:
        """Notice that a function is not in the cache. Raises CompilationStopped when closed."""
        if threading.current_thread() is not self._thread:
            return
        if self._is_closed:
            raise CompilationStopped
        if not self._is_compiling:
            self._is_compiling = True
            folder = numba_config.CACHE_DIR
            where = f'; they are kept in {folder}' if folder else ''
            self._report(
                'compiling the searches, once after an installation: the first plans wait for '
                f'about {EXPECTED_SECONDS} s{where}'
            )

    def on_end(self, _: event.Event) -> None:
        """Ignore that a function is compiled."""
