"""Guide the search by waypoints of your own; every one is checked, and the bound still holds."""

import numpy as np
from llm_astar_planner.waypoints.source import WaypointQuery, WaypointReply

from llm_astar_planner import Planner, PlanRequest


class Corners:
    """A waypoint source: anything with a name and this method; plugin/ has an installable one."""

    name = 'corners'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the cells (x, y) to pass; those that do not fit the map are not used."""
        return WaypointReply(((40, 5), (query.goal[0], 99)))


obstacles = np.zeros((60, 80), dtype=bool)
obstacles[10:, 40] = True
plan = Planner(obstacles).prepare().plan(PlanRequest((5, 50), (75, 50), source=Corners()))
print(plan.message)
print(*(f'({point.x:g}, {point.y:g}): {point.status.value}' for point in plan.checked_waypoints))
