# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Keeps the newest map, makes planners for it, and says which map a plan waits for."""

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from rclpy.impl.rcutils_logger import RcutilsLogger

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.process import return_freed_memory
from llm_astar_planner.nodes.planner.goals import PlanGoal
from llm_astar_planner.planning.compile import KernelCompiler
from llm_astar_planner.planning.path_validator import CollisionChecker
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.search.landmarks import LandmarkManager

# Seconds that a change of parameters waits for its planner; a map of 4000 x 4000 takes a few.
LONGEST_PREPARATION = 120.0
# Seconds between two looks at whether a plan may still wait for its map.
POLL_SECONDS = 0.01
# A costmap changes every second: that it is planned on is logged once in so many seconds.
QUIET_SECONDS = 10.0

# How many of the last intervals are kept; from how many on another message is expected, and from
# how many on one that does not come is worth a warning.
KEPT, FEWEST, REGULAR = 8, 2, 4
# Another message is expected for so many of the usual intervals, and for this many seconds: a
# costmap that is cleared may take longer than usual. Regular are intervals up to as many times
# the usual one.
LATE_PERIODS, LATE_SECONDS = 3.0, 2.0

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


class PlanningMap(NamedTuple):
    """A map that can be planned on: its planner, and when it arrived, in monotonic seconds."""

    planner: Planner
    arrived: float


class MapManager:
    """Holds the `newest` good map that is ready, and says whether a newer one `is_preparing`.

    Maps are prepared on a thread of their own, only the newest one: maps, updates and changes of
    rules that arrive meanwhile are prepared together in the next round. A map that is refused
    changes nothing. `arrivals` notes when they came.
    """

    def __init__(
        self,
        logger: RcutilsLogger,
        config: Callable[[], CostmapConfig],
        on_planner: Callable[[Planner], None],
        compiler: KernelCompiler | None = None,
    ) -> None:
        """Start without a map; `on_planner` gets each new planner, on the preparing thread.

        A map that arrives while `compiler` compiles what it takes is prepared after that.
        """
        self.newest: PlanningMap | None = None
        self.is_preparing = False
        self.arrivals = MapArrivals()
        self._logger = logger
        self._config = config
        self._on_planner = on_planner
        self._compiler = compiler
        self.landmarks = LandmarkManager()
        self._grid_map: GridMap | None = None
        self._arrived = 0.0
        self._changed = threading.Condition()
        self._requested = self._prepared = 0
        self._closing = False
        self._thread = threading.Thread(target=self.work, name='maps', daemon=True)
        self._thread.start()

    @property
    def planner(self) -> Planner | None:
        """The planner of the newest map that is ready, None without one."""
        return self.newest.planner if self.newest else None

    @property
    def name(self) -> str:
        """The map planned on, for a person."""
        if self.newest is None:
            return 'no map'
        grid_map = self.newest.planner.grid_map
        return f'map {grid_map.digest} of {grid_map.width} x {grid_map.height} cells'

    @property
    def age(self) -> float | None:
        """Seconds since the map planned on arrived, None without one."""
        newest = self.newest
        return None if newest is None else time.monotonic() - newest.arrived

    def newest_arrived(self) -> tuple[Costmap, CollisionChecker] | None:
        """Return the costmap of the newest map, ready or not, and what checks paths on it.

        Nothing is prepared for it. None before the first map is ready: until then what checks
        paths may not be compiled.
        """
        newest, grid_map = self.newest, self._grid_map
        if newest is None or grid_map is None:
            return None
        if not self.is_preparing:
            return newest.planner.costmap, newest.planner.checker
        config = self._config()
        return Costmap(grid_map, config), CollisionChecker(grid_map, config)

    def take(self, grid_map: GridMap, transit: float | None = 0.0) -> None:
        """Plan on this map as soon as it is ready.

        It was sent `transit` seconds ago; None for the last one with other zones, which is as old
        as that.
        """
        if transit is not None:
            self.arrivals.note(transit)
        with self._changed:
            self._arrived = self.arrivals.last
            self._grid_map = grid_map
            self._request()

    def wait(
        self, seconds: float, may_wait: Callable[[], bool], newer_than: float | None = None
    ) -> bool:
        """Wait until what has arrived so far is prepared or refused; tell whether it is.

        With `newer_than`, in monotonic seconds, until a map that arrived after that is ready.
        That takes at most `seconds`, and only while `may_wait()`. Raises what that raises.
        """
        deadline = time.monotonic() + seconds
        with self._changed:
            number = self._requested
            while not (is_done := self.is_done(number, newer_than)) and not self._closing:
                time_left = deadline - time.monotonic()
                if time_left <= 0.0 or not may_wait():
                    break
                self._changed.wait(min(POLL_SECONDS, time_left))
            return is_done

    def is_done(self, number: int, newer_than: float | None) -> bool:
        """Tell whether a preparation is done, or with `newer_than` whether such a map is ready."""
        if newer_than is None:
            return self._prepared >= number
        return self.newest is not None and self.newest.arrived > newer_than

    def refresh(self) -> None:
        """Have the planner follow changed rules; return when it does."""
        with self._changed:
            number = self._request()
            self._changed.wait_for(
                lambda: self._closing or self._prepared >= number, LONGEST_PREPARATION
            )

    def _request(self) -> int:
        self._requested += 1
        self.is_preparing = True
        self._changed.notify_all()
        return self._requested

    def close(self) -> None:
        """Stop, the measuring of landmarks too."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()
        self.landmarks.close()

    def work(self) -> None:
        """Prepare what is newest, until closed."""
        shape: tuple[int, ...] = ()
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._requested > self._prepared)
                if self._closing:
                    return
            self.prepare_newest()
            newest = self.newest
            if newest is not None and newest.planner.grid_map.cells.shape != shape:
                shape = newest.planner.grid_map.cells.shape
                return_freed_memory()

    def prepare_newest(self) -> None:
        """Prepare what is newest. No planner but the newest is held afterwards."""
        with self._changed:
            number, grid_map, arrived = self._requested, self._grid_map, self._arrived
        before = self.planner
        if grid_map is not None and self._compiler is not None:
            self._compiler.wait(lambda: not self._closing)
        planner = self.make_planner(grid_map, before)
        with self._changed:
            if planner is not None:
                self.newest = PlanningMap(planner, arrived)
            self._prepared = number
            self.is_preparing = self._requested > number
            self._changed.notify_all()
        if planner is not None and planner is not before:
            message = f'planning on {self.name}'
            self._logger.info(message, throttle_duration_sec=QUIET_SECONDS)
            self._on_planner(planner)

    def make_planner(self, grid_map: GridMap | None, before: Planner | None) -> Planner | None:
        """Return a planner that is ready, `before` if that serves; None for a map refused."""
        try:
            config = self._config()
            if grid_map is None:
                return None
            is_same = before is not None and before.grid_map.is_equal_to(grid_map)
            if before is not None and is_same and before.config == config:
                return before
            planner = Planner(grid_map, config, landmarks=self.landmarks, previous=before)
            return planner.prepare(wait=False)
        except Exception as error:  # noqa: BLE001 - no map may end the thread
            problem = f'{type(error).__name__}: {error}'
            self._logger.error(f'map refused, {self.name} stays: {problem}')
            return None


class MapArrivals:
    """Notes when messages with a map or an update arrived, equal ones included.

    All times are monotonic seconds. `last` is when the last one was made, `period` the usual
    interval. The next one is expected until `latest`; it is overdue after `overdue_at`, if they
    came at regular times. Each is infinite where it is not known.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without any; `clock` tells the time."""
        self.last = -math.inf
        self.period = math.inf
        self.overdue_at = math.inf
        self._soonest = self.latest = math.inf
        self._clock = clock
        self._intervals: deque[float] = deque(maxlen=KEPT)

    def note(self, transit: float = 0.0) -> None:
        """Note a message that has just arrived, `transit` seconds after it was made."""
        before, self.last = self.last, max(self.last, self._clock() - transit)
        if math.isfinite(before):
            self._intervals.append(self.last - before)
        count = len(self._intervals)
        if count < FEWEST:
            return
        self.period = statistics.median(self._intervals)
        self._soonest = self.last + min(self._intervals)
        self.latest = self.last + max(LATE_PERIODS * self.period, LATE_SECONDS)
        is_regular = count >= REGULAR and max(self._intervals) <= LATE_PERIODS * self.period
        self.overdue_at = self.latest if is_regular else math.inf

    def is_due(self, seconds: float) -> bool:
        """Tell whether another message can be expected within so many seconds.

        False for a map that is published once, and for a publisher that has stopped.
        """
        now = self._clock()
        return self._soonest <= now + seconds and now <= self.latest < math.inf

    def warnings(self, after: float = 0.0) -> tuple[str, ...]:
        """Say that the next message is overdue; empty if it is not.

        With `after`, only once nothing has come for so many seconds.
        """
        now = self._clock()
        if now <= max(self.overdue_at, self.last + after):
            return ()
        return (
            f'no map or update has come for {now - self.last:.1f} s; '
            f'before, one came every {self.period:.2f} s',
        )


class Failure(NamedTuple):
    """A goal for which there was no path, and when that was known in monotonic seconds."""

    goal: PlanGoal
    time: float


class MapWait(NamedTuple):
    """How long a request waited for a map, in seconds, and what to warn of.

    Of that time `extra` is not part of the planning time.
    """

    seconds: float = 0.0
    extra: float = 0.0
    warnings: tuple[str, ...] = ()


NOT_WAITED = MapWait()


@dataclass(eq=False)
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

    maps: MapManager
    timeout: Callable[[], float]
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        """Know of no failure yet."""
        # Read without a lock by requests, to which it says that there is nothing to look for.
        self.failures: deque[Failure] = deque(maxlen=MAX_FAILURES)
        self._lock = threading.Lock()
        self._waiting = threading.Semaphore(MAX_WAITING)

    def note(self, goal: PlanGoal, *, failed: bool) -> None:
        """Remember that a goal failed on the newest map, or forget it since there is a path."""
        now = self.clock()
        with self._lock:
            kept = [one for one in self.failures if is_recent(one, now)]
            self.failures.clear()
            self.failures.extend(one for one in kept if not is_same(one.goal, goal))
            if failed:
                self.failures.append(Failure(goal, now))

    def is_retry(self, goal: PlanGoal) -> bool:
        """Tell whether this goal failed a moment ago."""
        now = self.clock()
        with self._lock:
            failures = list(self.failures)
        return any(is_recent(one, now) and is_same(one.goal, goal) for one in failures)

    def wait(
        self, begin: float, planning_time: float, may_wait: Callable[[], bool], *, is_retry: bool
    ) -> MapWait:
        """Wait for the map of a request made at `begin`, in monotonic seconds.

        `planning_time` is all that it has. If there is no map after that, the first warning says
        so; another one that maps have stopped coming. Raises what `may_wait` raises.
        """
        maps, timeout = self.maps, self.timeout()
        waited, is_due = NOT_WAITED, timeout > 0.0 and maps.arrivals.is_due(timeout)
        if maps.newest is None:
            waited = self.wait_for(FIRST, begin, timeout, may_wait, newer_than=-math.inf)
        elif is_retry and is_due and self._waiting.acquire(blocking=False):
            # Not once none is expected any more.
            limit = min(timeout, maps.arrivals.latest - self.clock())
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
    ) -> MapWait:
        """Wait for up to `limit` seconds as `MapManager.wait` does; warn if that was in vain."""
        is_ready = self.maps.wait(limit, may_wait, newer_than=newer_than)
        seconds = self.clock() - begin
        if is_ready:
            return MapWait(seconds, seconds)
        problem = 'the first map is not ready yet' if self.maps.is_preparing else NO_MAP
        said = warning.format(problem=problem, seconds=seconds)
        return MapWait(seconds, seconds, (said,))


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
