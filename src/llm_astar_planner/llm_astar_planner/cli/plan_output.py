"""What `llm-astar plan` prints of a plan, for programs and for people."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import Point

from llm_astar_planner.cli.coordinates import Coordinates
from llm_astar_planner.instructions.outcome import InstructionOutcome
from llm_astar_planner.instructions.specification import Unknown
from llm_astar_planner.planning.types import Plan, plan_report


def plan_to_json(plan: Plan, offset: Point) -> dict[str, Any]:
    """Return a plan as a JSON object, in map coordinates: cells counted from `offset`.

    `start_shift`, `goal_shift`, `unknown_length` and `clearance` (null: no obstacle) are in
    metres, the lengths and costs in cells.
    """
    x_min, y_min = offset
    shortened = plan.any_angle
    return plan.to_dict() | {
        'start': [plan.start[0] + x_min, plan.start[1] + y_min],
        'goal': [plan.goal[0] + x_min, plan.goal[1] + y_min],
        'path': (plan.path + offset).tolist(),
        'waypoints': [
            {'x': point.x + x_min, 'y': point.y + y_min, 'verdict': point.status.value}
            for point in plan.checked_waypoints
        ],
        'any_angle_path': None if shortened is None else (shortened.points + offset).tolist(),
    }


def plan_to_text(plan: Plan, coordinates: Coordinates, start: str = '', goal: str = '') -> str:
    """Return a plan as lines for a person: what came out, from where to where, and how.

    `start` and `goal` are the names of places, '' for points.
    """
    report = plan_report(plan, coordinates.grid_map)
    lines = [report.summary, *(f'warning    {warning}' for warning in plan.warnings)]
    via = [(f'via {number}', cell, '') for number, cell in enumerate(plan.via, start=1)]
    for name, cell, place in (('start', plan.start, start), *via, ('goal', plan.goal, goal)):
        at = f', {place}' if place else ''
        lines.append(f'{name:<10} {coordinates.describe(*cell)}{at}')
    lines.append(f'waypoints  {report.waypoint_summary}')
    for number, point in enumerate(plan.checked_waypoints, start=1):
        status = point.status.value.replace('_', ' ')
        lines.append(f'waypoint {number} {coordinates.describe(point.x, point.y)}: {status}')
    if plan.instruction is not None:
        lines += instruction_lines(plan.instruction)
    if plan.code == 0:
        lines += path_lines(plan, coordinates)
    milliseconds = (1000 * plan.seconds_source, 1000 * plan.seconds_search)
    lines.append('time       {:.2f} ms for waypoints, {:.2f} ms to search'.format(*milliseconds))
    return '\n'.join(lines)


def path_lines(plan: Plan, coordinates: Coordinates) -> list[str]:
    """Return the lines that only a plan with a path has."""
    turns = f'{plan.turns} turn{"" if plan.turns == 1 else "s"}'
    length = coordinates.describe_length(plan.length)
    lines = [
        f'length     {length}, {len(plan.path)} points, {turns}',
        f'expansions {plan.expansions}, {plan.storage} states stored',
    ]
    if math.isfinite(plan.clearance):
        clearance = coordinates.describe_distance(plan.clearance)
        lines.append(f'clearance  {clearance} to the nearest obstacle')
    if plan.unknown_length:
        unknown = coordinates.describe_distance(plan.unknown_length)
        lines.append(f'unknown    {unknown} through unknown cells')
    if plan.any_angle is not None:
        segments = len(plan.any_angle.points) - 1
        length = coordinates.describe_length(plan.any_angle.length)
        lines.append(f'any angle  {length}, in {segments} straight segments')
    return lines


def instruction_lines(outcome: InstructionOutcome) -> Iterator[str]:
    """Yield what was understood of an instruction, and a line for each of its clauses."""
    interpretation = outcome.interpretation
    yield f'instruction "{interpretation.text}"'
    if interpretation.specification.enforceable:
        yield f'understood as: {interpretation.sentence}'
    by = f' by {interpretation.understood_by}' if interpretation.understood_by else ''
    reason = f': {interpretation.detail}' if interpretation.detail else ''
    yield f'{interpretation.status.value}{by}{reason}'
    for number, clause in enumerate(outcome.clauses, start=1):
        entry = clause.to_json()
        detail = f' ({entry["detail"]})' if entry['detail'] else ''
        verdict = '' if isinstance(clause.clause, Unknown) else f': {entry["status"]}{detail}'
        yield f'clause {number:<3} {entry["clause"]}{verdict}'
    if outcome.note:
        yield f'note       {outcome.note}'
