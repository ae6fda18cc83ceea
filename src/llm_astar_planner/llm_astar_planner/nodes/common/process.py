# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a process asks of the kernel and of the C library: to end with its parent, to keep little.

glibc has up to eight heaps a core, one for each thread, and keeps in them what was freed. Arrays
of another size than those before do not fit into the gaps, so all heaps grow with every map of
another size: by 1.8 MB a map, of 600 x 600 cells in the mean. Arrays of their own from the system
(M_MMAP_THRESHOLD) would end that too, but plans would take up to five times as long, since the
system clears their pages each time.
"""

import ctypes
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

# Process id of the parent to end with; `llm-astar run` sets it.
PARENT_VARIABLE = 'LLM_ASTAR_PARENT_PID'
# Of Linux's <sys/prctl.h>.
PR_SET_PDEATHSIG = 1

M_ARENA_MAX = -8  # of malloc.h
# One for Python's threads, which share a lock anyway, and one more.
MOST_HEAPS = 2


@contextmanager
def handling(numbers: Iterable[int], handler: Callable[[int, object], object]) -> Iterator[None]:
    """Handle signals of these numbers in the block, and as before it afterwards."""
    before = [(number, signal.signal(number, handler)) for number in numbers]
    try:
        yield
    finally:
        for number, own in before:
            signal.signal(number, own)


def follow_parent() -> None:
    """Have the kernel send SIGTERM when the parent that PARENT_VARIABLE names ends.

    Raises SystemExit where it has ended already. Without the variable this does nothing.
    """
    parent = os.environ.get(PARENT_VARIABLE)
    if parent is None:
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGTERM))
    if parent != str(os.getppid()):
        raise SystemExit(0)


def limit_heaps() -> None:
    """Have all threads share few heaps; call it before they are started."""
    set_option = getattr(ctypes.CDLL(None), 'mallopt', None)
    if set_option is not None:
        set_option(M_ARENA_MAX, MOST_HEAPS)


def return_freed_memory() -> None:
    """Return freed memory to the operating system.

    It takes milliseconds, and so does the next plan, for which the system clears pages.
    """
    trim = getattr(ctypes.CDLL(None), 'malloc_trim', None)
    if trim is not None:
        trim(0)
