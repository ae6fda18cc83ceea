# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Receives maps and map updates."""

from collections.abc import Callable
from typing import Any

from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError
from llm_astar_msgs_adapter.messages import fields
from nav_msgs.msg import OccupancyGrid
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from llm_astar_planner.nodes.common.entities import LATCHED, UPDATES, Entities

try:
    from map_msgs.msg import OccupancyGridUpdate
except ImportError:
    OccupancyGridUpdate = None

# A stamp that is older than this, in seconds, does not say when a message was sent.
LONGEST_TRANSIT = 0.5
# The year 2001: no clock of a machine is before it, and no simulated time after it.
OLDEST_NS = 10**18
QUIET_SECONDS = 10.0


class MapSubscription:
    """Subscribes to `map`, and to `map_updates` if map_msgs is installed.

    Malformed messages are logged and dropped; the last good map stays.
    """

    def __init__(
        self,
        entities: Entities,
        on_map: Callable[[GridMap, float], None],
        parent: Node | None = None,
    ) -> None:
        """Subscribe; `on_map` is called with each new map, one at a time.

        It also gets the seconds since the message was sent, 0 where that is not known. `parent`,
        the node itself by default, remaps the names and logs.
        """
        parent = parent or entities.node
        self._logger = parent.get_logger()
        self._clock = parent.get_clock()
        self._on_map = on_map
        self._grid_map: GridMap | None = None
        self._time = 0
        # An update changes the map before it, so messages are handled in order.
        group = MutuallyExclusiveCallbackGroup()
        whole, part = map(parent.resolve_topic_name, ('map', 'map_updates'))
        entities.subscription(OccupancyGrid, whole, self._on_whole, LATCHED, group)
        if OccupancyGridUpdate is not None:
            entities.subscription(OccupancyGridUpdate, part, self._on_part, UPDATES, group)

    def _on_whole(self, message: OccupancyGrid) -> None:
        if self._accept('map', message, lambda: fields.grid_from_message(message)):
            self._time = fields.stamp_of(message)

    def _on_part(self, message: Any) -> None:  # noqa: ANN401 - map_msgs may not be there
        before = self._grid_map
        if before is None:
            self._logger.error('map update refused: it came before its map')
        elif not fields.is_outdated(message, self._time):
            self._accept('map update', message, lambda: fields.updated(before, message))

    def _accept(self, what: str, message: Any, read: Callable[[], GridMap]) -> bool:  # noqa: ANN401
        """Make what `read` returns the current map; return False where it raises."""
        try:
            grid_map = read()
        except Exception as error:  # noqa: BLE001 - no message may end the thread of the maps
            before = self._grid_map
            kept = 'there is none' if before is None else f'map {before.digest} stays'
            name = '' if isinstance(error, GridMapError) else f'{type(error).__name__}: '
            self._logger.error(f'{what} refused, {kept}: {name}{error}')
            return False
        self._grid_map = grid_map
        problem = clock_problem(fields.stamp_of(message), self._clock.now().nanoseconds)
        if problem is not None:
            self._logger.warning(f'{what}: {problem}', throttle_duration_sec=QUIET_SECONDS)
        self._on_map(grid_map, self._transit(message))
        return True

    def _transit(self, message: Any) -> float:  # noqa: ANN401 - map_msgs may not be there
        """Return the seconds since a message was sent, by its stamp; 0 for one that says it not.

        Reading a map of 4000 x 4000 cells takes a tenth of a second, in which a costmap may be
        cleared.
        """
        seconds = (self._clock.now().nanoseconds - fields.stamp_of(message)) * 1e-9
        return seconds if 0.0 < seconds < LONGEST_TRANSIT else 0.0


def clock_problem(stamp: int, now: int) -> str | None:
    """Say why a stamp is not of the clock that says `now`, both in ns; None where it may be.

    A stamp of 0 is none. A map that is published once may have any age.
    """
    if 0 < stamp < OLDEST_NS < now or now < OLDEST_NS < stamp:
        return 'its stamp is of another clock than the one of this node; see use_sim_time'
    seconds = (stamp - now) * 1e-9
    return f'its stamp is {seconds:.1f} s in the future' if seconds > LONGEST_TRANSIT else None
