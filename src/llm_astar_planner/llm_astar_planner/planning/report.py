"""Plans as reports, in metres of the map's frame, and reports as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
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


def report_lines(
    report: PlanReport, endpoints: tuple[Pose2D, Pose2D], poses: int, seconds: float
) -> Iterator[str]:
    """Yield for a person what a planner reported of a request from start to goal.

    The path has `poses` poses, and the answer came after `seconds`.
    """
    yield report.summary
    yield from (f'warning    {warning}' for warning in report.warnings)
    for name, place in zip(('start', 'goal'), endpoints):
        yield f'{name:<10} ({place.x:g}, {place.y:g}) m'
    yield f'waypoints  {report.waypoint_summary}'
    for number, (x, y, status) in enumerate(report.waypoints, start=1):
        yield f'waypoint {number} ({x:.4g}, {y:.4g}) m: {status.replace("_", " ")}'
    if report.instruction_report:
        yield from instruction_lines(report.instruction_report)
    if report.length is not None:
        turns = f'{report.turns} turn{"" if report.turns == 1 else "s"}'
        yield f'length     {report.length:.2f} m, {poses} poses, {turns}'
    yield f'expansions {report.operation}, {report.storage} states stored'
    parts = (1000 * seconds, 1000 * report.seconds_source, 1000 * report.seconds_search)
    yield (
        'time       {:.1f} ms round trip, of it {:.1f} ms for waypoints, {:.2f} ms to search'
    ).format(*parts)


def instruction_lines(outcome: Mapping[str, Any]) -> Iterator[str]:
    """Yield what became of an instruction, as `PlanReport.instruction_report` has it."""
    yield f'instruction {interpretation_line(outcome["interpretation"])}'
    for clause in outcome['clauses']:
        detail = f' ({clause["detail"]})' if clause['detail'] else ''
        yield f'  {clause["status"]:<14} {clause["clause"]}{detail}'
    if outcome['note']:
        yield f'  {outcome["note"]}'


def interpretation_line(interpretation: Mapping[str, Any]) -> str:
    """Return what was understood, and by whom, in one line."""
    by = f' by {interpretation["understood_by"]}' if interpretation['understood_by'] else ''
    sentence = f': {interpretation["sentence"]}' if interpretation['sentence'] else ''
    detail = f' ({interpretation["detail"]})' if interpretation['detail'] else ''
    return f'{interpretation["status"]}{by}{sentence}{detail}'
