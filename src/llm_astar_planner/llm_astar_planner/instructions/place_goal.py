"""A place as a goal: which cell of it to go to."""

from __future__ import annotations

import numpy as np
from llm_astar_msgs_adapter.maps.places import Place, Places

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.enforcement import visit_cells
from llm_astar_planner.instructions.place_names import PlaceGoalError
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import NamedPlace
from llm_astar_planner.search.result import Cell


def goal_cell(place: Place, costmap: Costmap) -> Cell:
    """Return the cell to go to: the free one nearest to the centre of the place.

    In an area it is well inside, at an object near it, and where there is a choice in the largest
    part of the map that can be driven. Raises PlaceGoalError where no cell is free.
    """
    route = Route(costmap, (0, 0), (0, 0), Places([place]))
    cells = visit_cells(NamedPlace(place.name), route)
    if not cells.any():
        raise PlaceGoalError(f'no cell of {place.name!r} is free on this map')
    components = costmap.components[:, :]
    sizes = np.bincount(components.ravel())
    sizes[0] = 0
    cells &= components == max(np.unique(components[cells]), key=lambda number: sizes[number])
    centre = place.geometry.centroid
    x, y = costmap.grid_map.world_to_grid([(centre.x, centre.y)])[0]
    rows, columns = np.nonzero(cells)
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return int(columns[nearest]), int(rows[nearest])
