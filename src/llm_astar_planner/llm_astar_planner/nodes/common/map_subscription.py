"""Takes maps, and parts of maps, from the graph."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError
from llm_astar_msgs_adapter.messages.fields import stamp_of
from llm_astar_msgs_adapter.messages.map_update import is_outdated, updated
from llm_astar_msgs_adapter.messages.occupancy_grid import grid_from_message
from nav_msgs.msg import OccupancyGrid
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import LATCHED, UPDATES

try:
    from map_msgs.msg import OccupancyGridUpdate
except ImportError:
    OccupancyGridUpdate = None


class MapListener:
    """Hears `map`, and `map_updates` where map_msgs is there; what is malformed is refused."""

    def __init__(self, entities: Entities, on_map: Callable[[GridMap], None]) -> None:
        """Begin; `on_map` gets each new good map whole, one at a time."""
        self._logger = entities.node.get_logger()
        self._on_map = on_map
        self._grid_map: GridMap | None = None
        self._time = 0
        # Updates build on their map and on each other, so all are taken in turn.
        group = MutuallyExclusiveCallbackGroup()
        entities.subscription(OccupancyGrid, 'map', self._on_whole, LATCHED, group)
        if OccupancyGridUpdate is not None:
            entities.subscription(
                OccupancyGridUpdate, 'map_updates', self._on_part, UPDATES, group
            )

    def _on_whole(self, message: OccupancyGrid) -> None:
        if self._take('map', lambda: grid_from_message(message)):
            self._time = stamp_of(message)

    def _on_part(self, message: Any) -> None:  # noqa: ANN401 - map_msgs may not be there
        before = self._grid_map
        if before is None:
            self._logger.error('map update refused: it came before its map')
        elif not is_outdated(message, self._time):
            self._take('map update', lambda: updated(before, message))

    def _take(self, what: str, read: Callable[[], GridMap]) -> bool:
        """Take what is read, if it is a map; tell so, the last good one stays otherwise."""
        try:
            grid_map = read()
        except GridMapError as error:
            before = self._grid_map
            stays = 'there is none' if before is None else f'map {before.digest} stays'
            self._logger.error(f'{what} refused, {stays}: {error}')
            return False
        self._grid_map = grid_map
        self._on_map(grid_map)
        return True
