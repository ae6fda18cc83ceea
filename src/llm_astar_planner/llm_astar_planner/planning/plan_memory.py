"""Nothing is searched twice for the same question: one search for all who ask it, and memory."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning.instruction import NOT_HONOURED
from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode
from llm_astar_planner.search.stop import POLL_PERIOD_S
from llm_astar_planner.waypoints.source import SourceStatus

REMEMBERED = 'remembered from before on this map'
SHARED = "taken from another caller's search"
# What a source said of a plan that asking again would not change.
_SETTLED = (SourceStatus.OK, SourceStatus.NONE)
# A suboptimality_bound of floats that is above the bound by less than this meets it.
_ROUNDING = 1e-9
_NO_PICTURE = np.zeros((0, 0), dtype=np.bool_)


class _Flight:
    """A question being answered; `plan` stays None where the one who searches gives up."""

    def __init__(self) -> None:
        self.done = threading.Event()
        self.plan: Plan | None = None


class PlanMemory:
    """Answers each question once: callers of the same one at a time share its search.

    At most `size` plans are remembered and the one longest not asked for goes first; 0 remembers
    none. Which questions are the same is the key's matter: map, rules and request. Thread-safe.
    """

    def __init__(self, size: int) -> None:
        """Make an empty memory."""
        self._size = size
        self._lock = threading.Lock()
        self._plans: OrderedDict[Hashable, Plan] = OrderedDict()
        self._flights: dict[Hashable, _Flight] = {}

    def resize(self, size: int) -> None:
        """Remember at most so many plans from now on."""
        with self._lock:
            self._size = size
            self._drop_oldest()

    def forget(self) -> None:
        """Forget every plan; those under way will not be remembered either."""
        with self._lock:
            self._plans.clear()
            self._flights.clear()

    def answer(
        self,
        key: Hashable,
        make: Callable[[], Plan],
        stop: NDArray[np.uint8],
        seconds: float,
        is_kept: Callable[[Plan], bool],
    ) -> tuple[Plan | None, str]:
        """Return the plan for a question, and how it was come by: '' for a search of its own.

        `make` searches, where the question is neither remembered (REMEMBERED) nor under way
        (SHARED). A caller waits for another's search no longer than `seconds` or until its own
        `stop[0]` is raised, and gets no plan then; where the other one gives up, it searches
        itself. `is_kept` tells whether a plan is worth remembering.
        """
        deadline = time.monotonic() + seconds
        while True:
            plan, flight, is_first = self._look_up(key)
            if plan is not None:
                return _for_nothing(plan), REMEMBERED
            if is_first:
                return self._search(key, flight, make, stop, is_kept), ''
            if not _landed(flight, stop, deadline):
                return None, SHARED
            if flight.plan is not None:
                return _for_nothing(flight.plan), SHARED

    def _look_up(self, key: Hashable) -> tuple[Plan | None, _Flight, bool]:
        with self._lock:
            plan = self._plans.get(key)
            if plan is not None:
                self._plans.move_to_end(key)
                return plan, _Flight(), False
            is_first = key not in self._flights
            return None, self._flights.setdefault(key, _Flight()), is_first

    def _search(
        self,
        key: Hashable,
        flight: _Flight,
        make: Callable[[], Plan],
        stop: NDArray[np.uint8],
        is_kept: Callable[[Plan], bool],
    ) -> Plan:
        try:
            plan = make()
            if not stop[0]:
                flight.plan = plan
        finally:
            with self._lock:
                # It may have been forgotten meanwhile, and another one begun.
                is_current = self._flights.get(key) is flight
                if is_current:
                    del self._flights[key]
                if is_current and flight.plan is not None and is_kept(flight.plan):
                    self._plans[key] = replace(flight.plan, expanded=_NO_PICTURE)
                    self._drop_oldest()
            flight.done.set()
        return plan

    def _drop_oldest(self) -> None:
        while len(self._plans) > self._size:
            self._plans.popitem(last=False)


def is_settled(plan: Plan, request: PlanRequest) -> bool:
    """Tell whether asking again could do no better: found, heard, proven, no wish lost.

    A request for the picture of expanded cells is answered with one every time.
    """
    heard = plan.source_status in _SETTLED and not plan.instruction.startswith(NOT_HONOURED)
    proven = not plan.suboptimality_bound > (request.max_suboptimality or np.inf) + _ROUNDING
    return plan.code is ResultCode.NONE and heard and proven and not request.want_expanded


def _landed(flight: _Flight, stop: NDArray[np.uint8], deadline: float) -> bool:
    while not flight.done.wait(POLL_PERIOD_S):
        if stop[0] or time.monotonic() >= deadline:
            return False
    return True


def _for_nothing(plan: Plan) -> Plan:
    """Return a plan as one that cost nothing this time."""
    return replace(plan, seconds_source=0.0, seconds_search=0.0)
