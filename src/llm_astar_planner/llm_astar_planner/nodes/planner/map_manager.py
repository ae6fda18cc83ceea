# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Keeps the newest map, and makes planners for it."""

from __future__ import annotations

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from rclpy.impl.rcutils_logger import RcutilsLogger

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.process import return_freed_memory
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
