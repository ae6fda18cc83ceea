"""Keeps the memory of nodes that run for long from growing, where the C library is glibc.

glibc has up to eight heaps a core, one for each thread, and keeps in them what was freed. Arrays
of another size than those before do not fit into the gaps, so all heaps grow with every map of
another size: by 1.8 MB a map, of 600 x 600 cells in the mean. Arrays of their own from the system
(M_MMAP_THRESHOLD) would end that too, but plans would take up to five times as long, since the
system clears their pages each time.
"""

from __future__ import annotations

import ctypes

M_ARENA_MAX = -8  # of malloc.h
# One for Python's threads, which share a lock anyway, and one more.
MOST_HEAPS = 2


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
