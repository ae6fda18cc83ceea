"""What enforcement and verification know of the route that an instruction is about."""

from __future__ import annotations

from dataclasses import dataclass

from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.result import Cell


@dataclass(frozen=True, eq=False)
class Route:
    """A costmap, its places, and the cells to plan between.

    `visited`: the regions already visited on the way, as (index of the clause, index of the
    region in it).
    """

    costmap: Costmap
    start: Cell
    goal: Cell
    places: Places = NO_PLACES
    visited: frozenset[tuple[int, int]] = frozenset()

    def position(self, cell: Cell) -> tuple[float, float]:
        """Return the centre (x, y) of a cell in metres, in the map's frame."""
        x, y = self.costmap.grid_map.grid_to_world([cell])[0]
        return float(x), float(y)
