# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Which map a plan waits for, and for how long."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from geometry_msgs.msg import PoseStamped

from llm_astar_planner.nodes.planner.goals import PlanGoal
from llm_astar_planner.nodes.planner.map_manager import MapManager

# The part of the planning time that may pass before the newest map is ready.
MAP_SHARE = 0.5
# A request for the same poses, within so many metres, so many seconds after its failure is a
# retry: behaviour trees clear the costmap and ask again within milliseconds.
SAME_PLACE, RETRY_SECONDS = 0.25, 5.0
# How many failures are remembered, and how many retries wait at a time: the others plan at once,
# so that a flood of retries leaves threads for other callers.
MAX_FAILURES, MAX_WAITING = 32, 4
NO_MAP = 'no map has arrived yet'
# What is warned of where no map came in time: the first, a newer one, and the newest.
FIRST = '{problem}, after {seconds:.2f} s'
NEWER = 'no newer map was ready after {seconds:.2f} s: the last one is used'
NEWEST = 'the newest map was not ready after {seconds:.2f} s: the last one is used'


class Failure(NamedTuple):
    """A goal for which there was no path, and when that was known in monotonic seconds."""

    goal: PlanGoal
    time: float


class Waited(NamedTuple):
    """How long a request waited for a map, in seconds, and what to warn of.

    Of that time `extra` is not part of the planning time.
    """

    seconds: float = 0.0
    extra: float = 0.0
    warnings: tuple[str, ...] = ()


NOT_WAITED = Waited()


class CostmapWait:
    """Makes requests wait for the map that they are to be planned on.

    - Without a map, for the first one.
    - After a failure, the same request once more for a map that is newer than itself, if maps
      come periodically: the caller may have cleared the costmap, as behaviour trees do, which
      its publisher shows only in its next message. This is what Nav2's planner_server does in
      `waitForCostmap`.
    - Otherwise for the newest map that has arrived, if it is still being prepared.

    Maps are awaited for up to `timeout()` seconds (the parameter costmap_update_timeout), of
    which only the last kind of wait is part of the planning time.
    """

    def __init__(
        self,
        maps: MapManager,
        timeout: Callable[[], float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take the maps, the parameter and a clock."""
        # Read without a lock by requests, to which it says that there is nothing to look for.
        self.failures: deque[Failure] = deque(maxlen=MAX_FAILURES)
        self._maps = maps
        self._timeout = timeout
        self._clock = clock
        self._lock = threading.Lock()
        self._waiting = threading.Semaphore(MAX_WAITING)

    def note(self, goal: PlanGoal, *, failed: bool) -> None:
        """Remember that a goal failed on the newest map, or forget it since there is a path."""
        now = self._clock()
        with self._lock:
            kept = [one for one in self.failures if is_recent(one, now)]
            self.failures.clear()
            self.failures.extend(one for one in kept if not is_same(one.goal, goal))
            if failed:
                self.failures.append(Failure(goal, now))

    def is_retry(self, goal: PlanGoal) -> bool:
        """Tell whether this goal failed a moment ago."""
        now = self._clock()
        with self._lock:
            failures = list(self.failures)
        return any(is_recent(one, now) and is_same(one.goal, goal) for one in failures)

    def wait(
        self, begin: float, planning_time: float, may_wait: Callable[[], bool], *, is_retry: bool
    ) -> Waited:
        """Wait for the map of a request made at `begin`, in monotonic seconds.

        `planning_time` is all that it has. If there is no map after that, the first warning says
        so; another one that maps have stopped coming. Raises what `may_wait` raises.
        """
        maps, timeout = self._maps, self._timeout()
        waited, is_due = NOT_WAITED, timeout > 0.0 and maps.arrivals.is_due(timeout)
        if maps.newest is None:
            waited = self.wait_for(FIRST, begin, timeout, may_wait, newer_than=-math.inf)
        elif is_retry and is_due and self._waiting.acquire(blocking=False):
            # Not once none is expected any more.
            limit = min(timeout, maps.arrivals.latest - self._clock())
            try:
                waited = self.wait_for(NEWER, begin, limit, may_wait, newer_than=begin)
            finally:
                self._waiting.release()
        elif maps.is_preparing:
            limit = min(timeout, MAP_SHARE * planning_time)
            waited = self.wait_for(NEWEST, begin, limit, may_wait)._replace(extra=0.0)
        return waited._replace(warnings=(*waited.warnings, *maps.arrivals.warnings()))

    def wait_for(
        self,
        warning: str,
        begin: float,
        limit: float,
        may_wait: Callable[[], bool],
        newer_than: float | None = None,
    ) -> Waited:
        """Wait for up to `limit` seconds as `MapManager.wait` does; warn if that was in vain."""
        is_ready = self._maps.wait(limit, may_wait, newer_than=newer_than)
        seconds = self._clock() - begin
        if is_ready:
            return Waited(seconds, seconds)
        problem = 'the first map is not ready yet' if self._maps.is_preparing else NO_MAP
        said = warning.format(problem=problem, seconds=seconds)
        return Waited(seconds, seconds, (said,))


def is_recent(failure: Failure, now: float) -> bool:
    """Tell whether a request may still be a retry of one that failed."""
    return now - failure.time <= RETRY_SECONDS


def is_same(goal: PlanGoal, other: PlanGoal) -> bool:
    """Tell whether two goals are for the same poses, or nearly."""
    if (goal.start is None) != (other.start is None) or len(goal.goals) != len(other.goals):
        return False
    starts = [] if goal.start is None else [(goal.start, other.start)]
    return all(is_near(*pair) for pair in (*starts, *zip(goal.goals, other.goals)))


def is_near(pose: PoseStamped, other: PoseStamped) -> bool:
    """Tell whether two poses of one frame are at the same place, or nearly."""
    here, there = pose.pose.position, other.pose.position
    distance = math.hypot(here.x - there.x, here.y - there.y)
    return bool(pose.header.frame_id == other.header.frame_id and distance <= SAME_PLACE)
