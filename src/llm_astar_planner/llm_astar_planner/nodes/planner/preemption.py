"""Cancel what is being planned, from another thread."""

from __future__ import annotations

import threading

from llm_astar_planner.search.stop import no_stop


class CancellationToken:
    """One plan's way out: `stop` is what the search looks at, `reason` why it was raised."""

    def __init__(self) -> None:
        """Nothing is canceled yet."""
        self.stop = no_stop()
        self.reason = ''

    def __call__(self, reason: str) -> None:
        """Cancel, once and for all; the first reason counts."""
        self.reason = self.reason or reason
        self.stop[0] = 1


class PreemptingGoalSlot:
    """Lets only the newest of its kind go on: to begin one is to cancel the one before."""

    def __init__(self) -> None:
        """Nothing has begun yet."""
        self._lock = threading.Lock()
        self._current = CancellationToken()

    def begin(self, reason: str, cancel: CancellationToken | None = None) -> CancellationToken:
        """Cancel the one before for that reason; return the token of the new one, or take it."""
        with self._lock:
            before, self._current = self._current, cancel or CancellationToken()
            before(reason)
            return self._current

    def cancel(self, reason: str) -> None:
        """Cancel the one that goes on, if any does."""
        with self._lock:
            self._current(reason)
