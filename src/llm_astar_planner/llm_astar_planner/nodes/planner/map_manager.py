"""Keeps the map, and makes planners of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from rclpy.impl.rcutils_logger import RcutilsLogger

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.search.landmarks import LandmarkManager

# What a change of parameters waits for its planner, in seconds; a 4000 x 4000 map takes a few.
LONGEST_PREPARATION = 120.0


class MapManager:
    """Holds the planner of the latest good map; the one before answers until it is ready.

    Maps are prepared on a thread of their own, the latest only: what comes meanwhile, whole maps
    or updates, is prepared together in the next round.
    """

    def __init__(
        self,
        logger: RcutilsLogger,
        rules: Callable[[], CostmapConfig],
        on_planner: Callable[[Planner], None],
    ) -> None:
        """Keep no map yet; `on_planner` gets each new planner, on the preparing thread."""
        self.planner: Planner | None = None
        self._planner_arrived = 0.0
        self._logger = logger
        self._rules = rules
        self._on_planner = on_planner
        self._landmarks = LandmarkManager()
        self._grid_map: GridMap | None = None
        self._arrived = 0.0
        self._changed = threading.Condition()
        self._wanted = self._made = 0
        self._closing = False
        self._thread = threading.Thread(target=self._work, name='maps', daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """Name the map planned on, for a person."""
        if self.planner is None:
            return 'no map'
        grid_map = self.planner.grid_map
        return f'map {grid_map.digest} of {grid_map.width} x {grid_map.height} cells'

    @property
    def age(self) -> float | None:
        """Return the seconds since the map planned on arrived, None without one."""
        return None if self.planner is None else time.monotonic() - self._planner_arrived

    @property
    def landmark_bytes(self) -> int:
        """Return what the landmarks take of memory."""
        return self._landmarks.nbytes

    def refresh(self) -> None:
        """Have the planner follow changed rules; return when it does."""
        with self._changed:
            self._want()
            number = self._wanted
            self._changed.wait_for(
                lambda: self._closing or self._made >= number, LONGEST_PREPARATION
            )

    def close(self) -> None:
        """End, the measuring of landmarks included."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()
        self._landmarks.close()

    def take(self, grid_map: GridMap) -> None:
        """Plan on this map as soon as it is ready."""
        with self._changed:
            self._grid_map, self._arrived = grid_map, time.monotonic()
            self._want()

    def _want(self) -> None:
        self._wanted += 1
        self._changed.notify_all()

    def _work(self) -> None:
        """Prepare what is latest, for as long as there is something new."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._wanted > self._made)
                if self._closing:
                    return
                number, grid_map, arrived = self._wanted, self._grid_map, self._arrived
            planner = self._prepared(grid_map)
            with self._changed:
                self.planner, self._planner_arrived = planner or self.planner, arrived
                self._made = number
                self._changed.notify_all()
            if planner is not None:
                self._on_planner(planner)

    def _prepared(self, grid_map: GridMap | None) -> Planner | None:
        """Return a planner ready to plan, None where the one there is serves already."""
        current = self.planner
        try:
            rules = self._rules()
            if grid_map is None or (current and _is_made_of(current, grid_map, rules)):
                return None
            return Planner(grid_map, rules, landmarks=self._landmarks).prepare(wait=False)
        except Exception as error:  # noqa: BLE001 - no map may end the keeping of maps
            problem = f'{type(error).__name__}: {error}'
            self._logger.error(f'map refused, {self.name} stays: {problem}')
            return None


def _is_made_of(planner: Planner, grid_map: GridMap, rules: CostmapConfig) -> bool:
    # The digest first: it is worked out here, aside, and not while a caller waits.
    return planner.grid_map.digest == grid_map.digest and planner.config == rules
