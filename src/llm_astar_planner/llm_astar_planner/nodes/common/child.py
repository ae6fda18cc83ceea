"""Nodes that end with the process that started them, even if that one is killed."""

from __future__ import annotations

import ctypes
import os
import signal

# Process id of the parent to end with; `llm-astar demo` and `llm-astar run` set it.
PARENT_VARIABLE = 'LLM_ASTAR_PARENT_PID'
# Of Linux's <sys/prctl.h>.
PR_SET_PDEATHSIG = 1


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
