"""Cancelling a plan from another thread, and new goals that preempt old ones."""

from __future__ import annotations

import threading

from llm_astar_planner.search.stop import no_stop


class CancellationToken:
    """Cancellation of one plan: the search polls `stop`; `reason` says why, '' while it runs."""

    def __init__(self) -> None:
        """Make a token that is not cancelled."""
        self.stop = no_stop()
        self.reason = ''

    def cancel(self, reason: str) -> None:
        """Cancel, once and for all; the first reason counts."""
        self.reason = self.reason or reason
        self.stop[0] = 1


class PreemptingGoalSlot:
    """A new goal preempts the previous one."""

    def __init__(self) -> None:
        """Make an empty slot."""
        self._lock = threading.Lock()
        self._current = CancellationToken()

    def begin(self, reason: str, token: CancellationToken | None = None) -> CancellationToken:
        """Cancel the previous goal for this reason; return the token of the new one."""
        with self._lock:
            previous, self._current = self._current, token or CancellationToken()
            previous.cancel(reason)
            return self._current

    def cancel(self, reason: str) -> None:
        """Cancel the current goal, if there is one."""
        with self._lock:
            self._current.cancel(reason)
