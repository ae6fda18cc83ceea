"""What `llm-astar plan` prints of a plan, for programs and for people."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import Point

from llm_astar_planner.instructions.outcome import InstructionOutcome
from llm_astar_planner.instructions.specification import Unknown
from llm_astar_planner.planning.types import Plan


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


def plan_to_text(plan: Plan, offset: Point) -> str:
    """Return a plan as a few lines for a person."""
    lines = [f'{plan.code.name} ({int(plan.code)}): {plan.message}']
    lines += [f'warning    {warning}' for warning in plan.warnings]
    asked = f'{plan.source}, {plan.source_status.value}'
    lines.append(f'guided by  {plan.guided_by} (source {asked})')
    for number, point in enumerate(plan.checked_waypoints, start=1):
        place = f'[{point.x + offset[0]:g}, {point.y + offset[1]:g}]'
        lines.append(f'waypoint {number} {place} {point.status.value.replace("_", " ")}')
    if plan.instruction is not None:
        lines += instruction_lines(plan.instruction)
    if plan.code == 0:
        lines += path_lines(plan)
    milliseconds = (1000 * plan.seconds_source, 1000 * plan.seconds_search)
    lines.append('time       {:.2f} ms in source, {:.2f} ms in search'.format(*milliseconds))
    return '\n'.join(lines)


def path_lines(plan: Plan) -> list[str]:
    """Return the lines that only a plan with a path has."""
    turns = f'{plan.turns} turn{"" if plan.turns == 1 else "s"}'
    lines = [
        f'expansions {plan.expansions}',
        f'storage    {plan.storage}',
        f'length     {plan.length:.3f} cells over {len(plan.path)} points, {turns}',
    ]
    if math.isfinite(plan.clearance):
        lines.append(f'clearance  {plan.clearance:.2f} m')
    if plan.unknown_length:
        lines.append(f'unknown    {plan.unknown_length:.2f} m through unknown cells')
    if plan.any_angle is not None:
        segments = len(plan.any_angle.points) - 1
        lines.append(
            f'any angle  {plan.any_angle.length:.3f} cells in {segments} straight segments'
        )
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
