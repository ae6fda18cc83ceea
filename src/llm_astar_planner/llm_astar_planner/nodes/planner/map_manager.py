"""Keeps the newest map, and makes planners for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from rclpy.impl.rcutils_logger import RcutilsLogger

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.search.landmarks import LandmarkManager

# Seconds that a change of parameters waits for its planner; a map of 4000 x 4000 takes a few.
LONGEST_PREPARATION = 120.0


class MapManager:
    """Holds the `planner` for the newest good map; the previous one answers until it is ready.

    Maps are prepared on a thread of their own, only the newest one: maps, updates and changes of
    rules that arrive meanwhile are prepared together in the next round.
    """

    def __init__(
        self,
        logger: RcutilsLogger,
        config: Callable[[], CostmapConfig],
        on_planner: Callable[[Planner], None],
    ) -> None:
        """Start without a map; `on_planner` gets each new planner, on the preparing thread."""
        self.planner: Planner | None = None
        self._planner_arrived = 0.0
        self._logger = logger
        self._config = config
        self._on_planner = on_planner
        self._landmarks = LandmarkManager()
        self._grid_map: GridMap | None = None
        self._arrived = 0.0
        self._changed = threading.Condition()
        self._requested = self._prepared = 0
        self._closing = False
        self._thread = threading.Thread(target=self.work, name='maps', daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The map planned on, for a person."""
        if self.planner is None:
            return 'no map'
        grid_map = self.planner.grid_map
        return f'map {grid_map.digest} of {grid_map.width} x {grid_map.height} cells'

    @property
    def age(self) -> float | None:
        """Seconds since the map planned on arrived, None without one."""
        return None if self.planner is None else time.monotonic() - self._planner_arrived

    @property
    def landmark_bytes(self) -> int:
        """Memory of the landmarks in bytes."""
        return self._landmarks.nbytes

    def take(self, grid_map: GridMap) -> None:
        """Plan on this map as soon as it is ready."""
        with self._changed:
            self._grid_map, self._arrived = grid_map, time.monotonic()
            self._requested += 1
            self._changed.notify_all()

    def refresh(self) -> None:
        """Have the planner follow changed rules; return when it does."""
        with self._changed:
            self._requested += 1
            number = self._requested
            self._changed.notify_all()
            self._changed.wait_for(
                lambda: self._closing or self._prepared >= number, LONGEST_PREPARATION
            )

    def close(self) -> None:
        """Stop, the measuring of landmarks too."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()
        self._landmarks.close()

    def work(self) -> None:
        """Prepare what is newest, until closed."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._requested > self._prepared)
                if self._closing:
                    return
                number, grid_map, arrived = self._requested, self._grid_map, self._arrived
            planner = self.make_planner(grid_map)
            with self._changed:
                self.planner, self._planner_arrived = planner or self.planner, arrived
                self._prepared = number
                self._changed.notify_all()
            if planner is not None:
                self._on_planner(planner)

    def make_planner(self, grid_map: GridMap | None) -> Planner | None:
        """Return a planner that is ready, None if the current one serves already."""
        current = self.planner
        try:
            config = self._config()
            # The digest is computed here first, on this thread, so that no caller waits for it.
            if grid_map is None or (
                current is not None
                and current.grid_map.digest == grid_map.digest
                and current.config == config
            ):
                return None
            return Planner(grid_map, config, landmarks=self._landmarks).prepare(wait=False)
        except Exception as error:  # noqa: BLE001 - no map may end the thread
            problem = f'{type(error).__name__}: {error}'
            self._logger.error(f'map refused, {self.name} stays: {problem}')
            return None
