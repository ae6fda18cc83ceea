# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What is said of a plan: its report for other programs, and lines for a person."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D

from llm_astar_planner.planning.types import Plan, finite_or_none

if TYPE_CHECKING:
    from llm_astar_msgs_adapter.messages.report import PlanReport

# Kinds of clauses that ask nothing of a path.
UNKNOWN, UNSUPPORTED = 'unknown', 'unsupported'


def plan_report(plan: Plan, grid_map: GridMap | None, map_age: float | None = None) -> PlanReport:
    """Report a plan on a map; without a map, a request that could not be planned at all.

    `map_age` is how many seconds before the plan the map arrived, None where it never did.
    """
    # A planner that reports nothing needs it not.
    from llm_astar_msgs_adapter.messages.report import PlanReport  # noqa: PLC0415

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
    ends = [(n, f'({end.x:g}, {end.y:g}) m') for n, end in zip(('start', 'goal'), endpoints)]
    yield from first_lines(report, ends, [f'({x:.4g}, {y:.4g}) m' for x, y, _ in report.waypoints])
    if report.length is not None:
        turns = f'{report.turns} turn{"" if report.turns == 1 else "s"}'
        yield f'length     {report.length:.2f} m, {poses} poses, {turns}'
    yield f'expansions {report.operation}, {report.storage} states stored'
    parts = (1000 * seconds, 1000 * report.seconds_source, 1000 * report.seconds_search)
    yield (
        'time       {:.1f} ms round trip, of it {:.1f} ms for waypoints, {:.2f} ms to search'
    ).format(*parts)


def first_lines(
    report: PlanReport, ends: Iterable[tuple[str, str]], points: Iterable[str]
) -> Iterator[str]:
    """Yield how the report of a plan begins for a person, up to its instruction.

    `ends` are the names and places of start, via points and goal, `points` the waypoints' places.
    """
    yield report.summary
    yield from (f'warning    {warning}' for warning in report.warnings)
    yield from (f'{name:<10} {place}' for name, place in ends)
    yield f'waypoints  {report.waypoint_summary}'
    for number, (point, (*_, status)) in enumerate(zip(points, report.waypoints), start=1):
        yield f'waypoint {number} {point}: {status.replace("_", " ")}'
    if report.instruction_report:
        yield from instruction_lines(report.instruction_report)


def instruction_lines(outcome: Mapping[str, Any]) -> Iterator[str]:
    """Yield what became of an instruction, as `InstructionOutcome.to_json` has it."""
    interpretation = outcome['interpretation']
    yield f'instruction "{interpretation["text"]}"'
    if {clause['kind'] for clause in outcome['clauses']} - {UNKNOWN, UNSUPPORTED}:
        yield f'understood as: {interpretation["sentence"]}'
    yield interpretation_line({**interpretation, 'sentence': '', 'questions': ()})
    for number, clause in enumerate(outcome['clauses'], start=1):
        yield f'clause {number:<3} {clause_line(clause)}'
    said = str(outcome.get('sentence', ''))
    if outcome['note'] not in said:
        yield f'note       {outcome["note"]}'
    if said:
        yield f'verdict    {said}'


def clause_line(clause: Mapping[str, Any]) -> str:
    """Return what became of a clause: 'avoid the lab: kept (0.0 m inside), costs 4.2 m'."""
    if clause['kind'] == UNKNOWN:
        return str(clause['clause'])
    if clause['kind'] == UNSUPPORTED:
        return f'{clause["status"]}: {clause["clause"]}'
    return f'{clause["clause"]}: {clause["status"]}{clause_facts(clause)}'


def clause_facts(clause: Mapping[str, Any]) -> str:
    """Return what was measured of a clause and what it costs: ' (0.0 m inside), costs 4.2 m'."""
    detail, price = clause['detail'], clause.get('price')
    facts = f' ({detail})' if detail else ''
    return facts if price is None else f'{facts}, costs {price:.1f} m'


def interpretation_line(interpretation: Mapping[str, Any]) -> str:
    """Return what was understood, and by whom, and what is asked, in one line."""
    by = f' by {interpretation["understood_by"]}' if interpretation['understood_by'] else ''
    sentence = f': {interpretation["sentence"]}' if interpretation['sentence'] else ''
    detail = f' ({interpretation["detail"]})' if interpretation['detail'] else ''
    asked = ''.join(f'; {question}' for question in interpretation.get('questions', ()))
    return f'{interpretation["status"]}{by}{sentence}{detail}{asked}'
