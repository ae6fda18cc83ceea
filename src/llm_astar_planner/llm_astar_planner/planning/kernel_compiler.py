"""Compiles the kernels in the background, those that a first plan needs first."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum

from numba.core import config as numba_config
from numba.core import event

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.compile import (
    compile_costmap,
    compile_for,
    compile_instruction_kernels,
    compile_kernels,
)
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.waypoints.replay import FixedReply

ANNOUNCEMENT = 'compiling the searches, once after an installation'
EXPECTED_SECONDS = 15
# Seconds between two sentences on how far it is.
REPORT_SECONDS = 4.0
WAYPOINTS = FixedReply('[[2, 2]]')
# Seconds between two looks at whether a plan may still wait.
POLL_SECONDS = 0.02
# Seconds to wait in `close` until the kernel that is being compiled is ready.
LONGEST_KERNEL = 3.0


class Compiled(IntEnum):
    """What is compiled so far, in this order."""

    NOTHING = 0
    USUAL = 1  # what plans under the settings of the start take, on costmaps
    UNIFORM = 2  # and on maps without graded costs
    MAP_CHANGES = 3
    INSTRUCTIONS = 4
    EVERYTHING = 5


class CompilationStopped(BaseException):
    """The compiler was closed; nothing in numba may catch it."""


class CompileListener(event.Listener):
    """Notices when a function is compiled on the thread that makes it: it was not in the cache."""

    def __init__(self, on_compile: Callable[[str], None]) -> None:
        """Take what to call each time with the name; what it raises ends the compilation."""
        self._on_compile = on_compile
        self._thread = threading.current_thread()

    def on_start(self, began: event.Event) -> None:
        """Call back."""
        if threading.current_thread() is self._thread:
            self._on_compile(began.data['dispatcher'].py_func.__name__)

    def on_end(self, _: event.Event) -> None:
        """Ignore the end."""


@contextmanager
def compilations(on_compile: Callable[[str], None]) -> Iterator[None]:
    """Call `on_compile` with the name of each function that this thread compiles meanwhile."""
    with event.install_listener('numba:compile', CompileListener(on_compile)):
        yield


def progress_line(seconds: float, function: str) -> str:
    """Return how far a compilation is that has taken so many seconds."""
    return f'compiling the searches: {seconds:.0f} s of about {EXPECTED_SECONDS} s ({function})'


class CompileReport:
    """Says in sentences when kernels begin to be compiled, how far that is, and when it ends."""

    def __init__(self, report: Callable[[str], None], who_waits: str) -> None:
        """Take what gets the sentences, and who waits for the kernels."""
        self.is_compiling = False
        self._report = report
        self._who_waits = who_waits
        self._began = self._reported = time.monotonic()

    def note(self, function: str, *, is_waited_for: bool = True) -> None:
        """Report that and how far it compiles, the latter only while somebody waits for it."""
        now = time.monotonic()
        if not self.is_compiling:
            self.is_compiling, self._reported = True, now
            folder = numba_config.CACHE_DIR
            where = f'; they are kept in {folder}' if folder else ''
            self._report(
                f'{ANNOUNCEMENT}: {self._who_waits} wait for about {EXPECTED_SECONDS} s{where}'
            )
        elif is_waited_for and now - self._reported >= REPORT_SECONDS:
            self._reported = now
            self._report(progress_line(now - self._began, function))

    def finish(self, what: str) -> None:
        """Report that `what` is compiled, if anything had to be."""
        if self.is_compiling:
            self._report(f'searches compiled in {time.monotonic() - self._began:.1f} s: {what}')


def compile_and_report(run: Callable[[], None], report: CompileReport, what: str) -> None:
    """Run what compiles kernels on this thread, and report it: `what` is ready then.

    Where it fails it is done when they are needed, which says what is wrong.
    """
    with compilations(report.note), suppress(Exception):
        run()
        report.finish(what)


class KernelCompiler:
    """Compiles the kernels on a thread of its own, or loads them from numba's cache.

    Where nothing has to be compiled that takes half a second. `report` gets a sentence when it
    begins to compile, every few seconds until plans can go on, and when they can.
    """

    def __init__(
        self,
        config: CostmapConfig,
        request: PlanRequest,
        is_guided: Callable[[], bool],
        report: Callable[[str], None],
    ) -> None:
        """Start; first comes what requests like this take on costmaps of `config`.

        Waypoints belong to that if `is_guided()` once the rest is compiled, else come next.
        """
        self.compiled = Compiled.NOTHING
        self._config = config
        self._request = request
        self._is_guided = is_guided
        self._report = report
        self._progress = CompileReport(report, 'the first plans')
        self._changed = threading.Condition()
        self._is_closed = False
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

    def has_substitute_for(self, needed: Compiled) -> bool:
        """Tell whether plans can do without what is needed: A* serves instead of jump points.

        Not where these are only loaded, which is soon done.
        """
        is_usual = needed is Compiled.UNIFORM and self.compiled >= Compiled.USUAL
        return is_usual and self._progress.is_compiling

    def close(self) -> None:
        """Stop compiling; what is compiled stays."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._thread.join(LONGEST_KERNEL)

    def work(self) -> None:
        """Compile everything, step by step, until closed."""
        with compilations(self.on_compile):
            try:
                self.step(self.compile_usual, Compiled.USUAL)
                self.step(self.compile_uniform, Compiled.UNIFORM)
                self.step(self.compile_next, Compiled.MAP_CHANGES)
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
        if compiled in (Compiled.USUAL, Compiled.EVERYTHING):
            self._progress.finish('plans go on' if compiled is Compiled.USUAL else 'all of them')

    def compile_usual(self) -> None:
        """Compile what a first plan takes under the settings of the start."""
        compile_for(self._config, self._request)
        if self._is_guided():
            compile_for(self._config, self._request, WAYPOINTS)

    def compile_uniform(self) -> None:
        """Compile what plans take where costs are uniform."""
        compile_for(self._config, self._request, is_graded=False)

    def compile_next(self) -> None:
        """Compile what the next plans take: waypoints, landmarks, and a map that changes."""
        compile_for(self._config, self._request, WAYPOINTS)
        compile_costmap(self._config)

    def on_compile(self, function: str) -> None:
        """Report that and how far it compiles. Raises CompilationStopped when closed."""
        if self._is_closed:
            raise CompilationStopped
        self._progress.note(function, is_waited_for=self.compiled < Compiled.USUAL)
