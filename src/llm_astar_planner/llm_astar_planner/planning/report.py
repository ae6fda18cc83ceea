"""Plans as reports, in metres of the map's frame."""

from __future__ import annotations

from dataclasses import fields

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.report import PlanReport

from llm_astar_planner.planning.types import Plan, finite_or_none


def plan_report(plan: Plan, grid_map: GridMap | None, map_age: float | None = None) -> PlanReport:
    """Report a plan on a map; without a map, a request that could not be planned at all.

    `map_age` is how many seconds before the plan the map arrived, None where it never did.
    """
    values = plan.to_dict()
    waypoints: tuple[tuple[float, float, str], ...] = ()
    if grid_map is not None:
        points = [(point.x, point.y) for point in plan.checked_waypoints]
        waypoints = tuple(
            (x, y, point.status.value)
            for (x, y), point in zip(
                grid_map.grid_to_world(points).tolist(), plan.checked_waypoints
            )
        )
        values['length'] = finite_or_none(plan.length * grid_map.resolution)
    values |= {
        'waypoints': waypoints,
        'map_digest': grid_map.digest if grid_map else '',
        'zones': grid_map.zones if grid_map else (),
        'map_age': None if map_age is None else round(map_age, 4),
    }
    return PlanReport(**{field.name: values[field.name] for field in fields(PlanReport)})
