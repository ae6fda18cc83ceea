# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What an instruction is about: a route on a map, and the places that names mean."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, nearest_name
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Place, Places
from numpy.typing import NDArray

if TYPE_CHECKING:  # clients that only look up a name need not wait for numba
    from llm_astar_planner.costmap.costmap import Costmap
    from llm_astar_planner.search.result import Cell

# Names listed in an error.
MAX_LISTED = 30


def not_driven() -> NDArray[np.float64]:
    """Return a way of no points, [0, 2]."""
    return np.empty((0, 2))


@dataclass(frozen=True, eq=False)
class Route:
    """A costmap, its places, and the cells to plan between.

    `driven`: float64 [n, 2] metres, the way driven to the start since the goal and the
    instruction were given; empty at the beginning.
    """

    costmap: Costmap
    start: Cell
    goal: Cell
    places: Places = NO_PLACES
    driven: NDArray[np.float64] = field(default_factory=not_driven)

    @property
    def begin(self) -> tuple[float, float]:
        """Where the drive began, (x, y) in metres: the first point driven, or the start."""
        if not len(self.driven):
            return self.position(self.start)
        x, y = self.driven[0]
        return float(x), float(y)

    def position(self, cell: Cell) -> tuple[float, float]:
        """Return the centre (x, y) of a cell in metres, in the map's frame."""
        x, y = self.costmap.grid_map.grid_to_world([cell])[0]
        return float(x), float(y)


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
        raise PlaceGoalError(
            f'there is no place {wanted[:80]!r}, as no places are loaded: name their file with '
            '--places, or places_file in the node'
        )
    near = nearest_name(wanted, [name for p in places for name in (p.name, *p.aliases)])
    raise PlaceGoalError(f'there is no place {wanted[:80]!r}{near}; there is {listed(places)}')


def listed(places: Places) -> str:
    """Return the names of places for an error."""
    names = [place.name for place in places]
    more = f' and {len(names) - MAX_LISTED} more' if len(names) > MAX_LISTED else ''
    return ', '.join(names[:MAX_LISTED]) + more
