"""A place as a goal: which place a name means, and which cell of it to go to."""

from __future__ import annotations

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Place, Places

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.enforcement import visit_cells
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import NamedPlace
from llm_astar_planner.parameter import nearest_name
from llm_astar_planner.search.result import Cell

# Names listed in an error.
MAX_LISTED = 30


class PlaceGoalError(LlmAstarError, ValueError):
    """A name that is no goal; the message lists the names that are."""


def find_place(name: str, places: Places) -> Place:
    """Return the place that a name, an alias, or a kind or tag of one place alone means.

    Raises PlaceGoalError with the names to choose from.
    """
    wanted = ' '.join(name.split())
    place = places.get(wanted)
    if place is not None:
        return place
    tagged = places.with_tag(wanted)
    if len(tagged) == 1:
        return tagged[0]
    if tagged:
        raise PlaceGoalError(f'{wanted!r} is said of several places: {listed(Places(tagged))}')
    if not len(places):
        raise PlaceGoalError(f'there is no place {wanted!r}, as no places are loaded')
    near = nearest_name(wanted, [place.name for place in places])
    raise PlaceGoalError(f'there is no place {wanted[:80]!r}{near}; there is {listed(places)}')


def listed(places: Places) -> str:
    """Return the names of places for an error."""
    names = [place.name for place in places]
    more = f' and {len(names) - MAX_LISTED} more' if len(names) > MAX_LISTED else ''
    return ', '.join(names[:MAX_LISTED]) + more


def goal_cell(place: Place, costmap: Costmap) -> Cell:
    """Return the cell to go to: the free one nearest to the centre of the place.

    In an area it is well inside, at an object near it, and where there is a choice in the largest
    part of the map that can be driven. Raises PlaceGoalError where no cell is free.
    """
    route = Route(costmap, (0, 0), (0, 0), Places([place]))
    cells = visit_cells(NamedPlace(place.name), route)
    if not cells.any():
        raise PlaceGoalError(f'no cell of {place.name!r} is free on this map')
    components = costmap.components
    sizes = np.bincount(components.ravel())
    sizes[0] = 0
    cells &= components == max(np.unique(components[cells]), key=lambda number: sizes[number])
    centre = place.geometry.centroid
    x, y = costmap.grid_map.world_to_grid([(centre.x, centre.y)])[0]
    rows, columns = np.nonzero(cells)
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return int(columns[nearest]), int(rows[nearest])
