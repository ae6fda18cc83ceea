"""A request's own via points as a waypoint source: they guide the search instead of another's."""

from __future__ import annotations

import time
from dataclasses import dataclass

from llm_astar_planner.costmap.inflation import squared_cells
from llm_astar_planner.planning.endpoints import nearest_labelled
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import WaypointQuery, WaypointReply

NAME = 'viapoints'


@dataclass(frozen=True)
class ViapointSource:
    """Returns given cells (x, y); one that the start does not reach is moved as a goal would be.

    That is to the nearest cell that it reaches, at most `tolerance` metres away. Where there is
    none it stays where it is, for the check of waypoints to drop it and say why.
    """

    viapoints: tuple[Cell, ...]
    tolerance: float = 0.0
    name: str = NAME

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the via points; the detail says how many were moved and which had to stay."""
        deadline = time.monotonic() + query.time_limit
        places = [self.place(cell, query, deadline) for cell in self.viapoints]
        lost = [number for number, place in enumerate(places, start=1) if place is None]
        moved = sum(place not in (None, cell) for place, cell in zip(places, self.viapoints))
        detail = f'{len(places) - len(lost)} of {len(places)} via points can be reached'
        if moved:
            detail += f', {moved} of them moved to a free cell near by'
        if lost:
            shown = ', '.join(map(str, lost[:5])) + (', ...' if len(lost) > 5 else '')
            detail += f'; not within {self.tolerance:g} m: number {shown}'
        kept = tuple(place or cell for place, cell in zip(places, self.viapoints))
        return WaypointReply(kept, NAME, detail=detail)

    def place(self, cell: Cell, query: WaypointQuery, deadline: float) -> Cell | None:
        """Return the cell itself or the nearest one that the start reaches, None without one.

        After the deadline (monotonic seconds) no other cell is looked for.
        """
        components, grid_map = query.costmap.components, query.grid_map
        component = int(components[query.start[1], query.start[0]])
        if grid_map.contains(cell) and components[cell[1], cell[0]] == component:
            return cell
        if self.tolerance == 0.0 or time.monotonic() > deadline:
            return None
        reach = squared_cells(self.tolerance, grid_map.resolution)
        return nearest_labelled(components, component, cell, reach)
