"""A plan on the terminal: as JSON for programs, as lines for a person."""

from __future__ import annotations

import math
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import Point

from llm_astar_planner.planning.types import Plan


def plan_to_json(plan: Plan, offset: Point) -> dict[str, Any]:
    """Return a plan as a JSON object, in map coordinates: cells counted from `offset`.

    `start_shift`, `goal_shift`, `unknown_length` and `clearance` (null: no obstacle) are in
    metres, the lengths and costs in cells.
    """
    x_min, y_min = offset
    return {
        'code': int(plan.code),
        'code_name': plan.code.name,
        'message': plan.message,
        'warnings': list(plan.warnings),
        'method': plan.method,
        'guided_by': plan.guided_by,
        'source': plan.source,
        'source_status': plan.source_status.value,
        'source_detail': plan.reply.detail,
        'instruction': plan.instruction,
        'start': [plan.start[0] + x_min, plan.start[1] + y_min],
        'goal': [plan.goal[0] + x_min, plan.goal[1] + y_min],
        'start_shift': plan.start_shift,
        'goal_shift': plan.goal_shift,
        'path': (plan.path + offset).tolist(),
        'waypoints': [
            {'x': point.x + x_min, 'y': point.y + y_min, 'verdict': point.status.value}
            for point in plan.waypoints
        ],
        'operation': plan.expansions,
        'storage': plan.storage,
        'first_operation': plan.first_expansions,
        'length': _finite(plan.length),
        'cost': _finite(plan.cost),
        'ratio': _finite(plan.suboptimality_bound),
        'clearance': _finite(plan.clearance),
        'turns': plan.turns,
        'unknown_length': plan.unknown_length,
        'any_angle_path': None
        if plan.any_angle is None
        else (plan.any_angle.points + offset).tolist(),
        'seconds_source': plan.seconds_source,
        'seconds_search': plan.seconds_search,
    }


def plan_to_text(plan: Plan, offset: Point) -> str:
    """Return a plan as a few lines for a person."""
    lines = [f'{plan.code.name} ({int(plan.code)}): {plan.message}']
    lines += [f'warning    {warning}' for warning in plan.warnings]
    asked = f'{plan.source}, {plan.source_status.value}'
    lines.append(f'guided by  {plan.guided_by} (source {asked})')
    for number, point in enumerate(plan.waypoints, start=1):
        place = f'[{point.x + offset[0]:g}, {point.y + offset[1]:g}]'
        lines.append(f'waypoint {number} {place} {point.status.value.replace("_", " ")}')
    if plan.code == 0:
        lines += _path_lines(plan)
    milliseconds = (1000 * plan.seconds_source, 1000 * plan.seconds_search)
    lines.append('time       {:.2f} ms in source, {:.2f} ms in search'.format(*milliseconds))
    return '\n'.join(lines)


def _path_lines(plan: Plan) -> list[str]:
    turns = f'{plan.turns} turn{"" if plan.turns == 1 else "s"}'
    lines = [
        f'operation  {plan.expansions}',
        f'storage    {plan.storage}',
        f'length     {plan.length:.3f} cells over {len(plan.path)} points, {turns}',
    ]
    if math.isfinite(plan.clearance):
        lines.append(f'clearance  {plan.clearance:.2f} m')
    if plan.unknown_length:
        lines.append(f'unknown    {plan.unknown_length:.2f} m through unknown cells')
    if plan.any_angle is not None:
        legs = len(plan.any_angle.points) - 1
        lines.append(f'any angle  {plan.any_angle.length:.3f} cells in {legs} straight legs')
    return lines


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
