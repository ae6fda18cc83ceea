# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plan from start to goal on a map, without ROS.

Without options it plans the first start-goal pair of the demo map. Start and goal are points
(metres on a robot's map, cells on other maps) or names of places. The first line says whether a
path was found, the others how long it is, what became of the waypoints, and how much was searched.
The parameters of the nodes are flags; with the nodes' own --params-file it plans as they do.

usage: llm-astar plan [--map FILE] [--start X Y --goal X Y | --from NAME --to NAME]
                      [--source NAME] [--png FILE] [--json] [options]

examples:
  llm-astar plan
  llm-astar plan --map demo.json --map-id 0 --pair 1 --method astar --png out/astar.png
  llm-astar plan --map depot --from "dock 1" --to workshop --robot-radius 0.3 --png out/plan.png
  llm-astar plan --start 5 5 --goal 20 20 --via 30 8 --tolerance 1.5
  llm-astar plan --map depot --start 46 51 --goal 536 256 --cells
  llm-astar plan --map depot.yaml --start -5.7 -2.4 --goal 18.8 7.8 --params-file robot.yaml
  llm-astar plan --map house --from kitchen --to study --instruction "avoid the hall"
  llm-astar plan --map house --from kitchen --to sofa --instruction "avoid the hal" --confirm
  llm-astar plan --map house --from kitchen --to study --why "why not through the hall?"
  llm-astar plan --map depot --from "dock 1" --to workshop --alternatives 3
  llm-astar plan --reply "Generated Path: [[31, 10], [27, 9], [12, 9]]" --json
  llm-astar plan --source endpoint --base-url http://localhost:11434/v1 --model qwen2.5:7b

exit codes: 0 a path, 1 no path, 2 bad usage or input, 3 a path that does not keep the instruction,
a partial path, or, with --require-waypoints, no usable waypoint
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import replace
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import Point

from llm_astar_planner.cli.flags import CONFIRM_HINT, add_picture_option, option
from llm_astar_planner.cli.map_files import Coordinates
from llm_astar_planner.cli.planning_options import Problem, add_query_options, read_problem
from llm_astar_planner.planning.report import first_lines, plan_report
from llm_astar_planner.planning.segment import guiding_points
from llm_astar_planner.planning.types import Plan, ResultCode
from llm_astar_planner.plugins import find_drawing
from llm_astar_planner.search.kernel_cache import INTERPRETED

# Metres from the path to the nearest obstacle that many robots are wider than.
NARROW = 0.35
POINT_ROBOT = 'the robot is a point, as robot_radius is 0; a wider one may touch what is so near'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_query_options(parser, 'demo.json')
    output = parser.add_argument_group('output')
    text = 'exit with 3 if no waypoint came that the search could use'
    option(output, '--require-waypoints', text)
    add_picture_option(output, 'draw the plan')
    text = 'answer "why not through the kitchen?", "why so long?", "what if the door were open?"'
    option(output, '--why QUESTION', f'{text} (in English, German, French or Spanish)')
    option(output, '--json', 'print one JSON object, with its points in cells')


def run(arguments: argparse.Namespace) -> int:
    """Plan, print, draw; return the exit code. Raises what `read_problem` does on bad input."""
    drawing = find_drawing('plan') if arguments.png else None
    asked = read_problem(arguments)
    planner = asked.planner
    # So that the time of the plan is for planning; says so where it takes long.
    if INTERPRETED:
        planner.prepare()
    else:
        # With numba, which imports slowly.
        from llm_astar_planner.planning.compile import compile_progress  # noqa: PLC0415

        with compile_progress():
            planner.prepare().compile(asked.request)
    plan = planner.plan(asked.request)
    if may_touch(plan, asked):
        plan = replace(plan, warnings=(*plan.warnings, POINT_ROBOT))
    answer = answered(arguments.why, asked) if arguments.why else {}
    show(plan, arguments, asked.coordinates, answer)
    if drawing is not None:
        from llm_astar_planner.instructions.route import Route  # noqa: PLC0415

        route = Route(planner.costmap, plan.start, plan.goal, asked.places)
        drawing.load()(plan, route, asked.coordinates.offset, arguments.png)
        if not arguments.json:
            print(f'picture    {arguments.png}')
    return exit_code(plan, arguments)


def answered(question: str, asked: Problem) -> dict[str, Any]:
    """Answer a question about what was planned. Raises QuestionError."""
    # The grammar takes a while to import, and other plans do not need it.
    from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter  # noqa: PLC0415
    from llm_astar_planner.planning.questions import Questions  # noqa: PLC0415

    questions = Questions(asked.planner, asked.request, GrammarInterpreter(), asked.places)
    return questions.answer(question)


def show(
    plan: Plan,
    arguments: argparse.Namespace,
    coordinates: Coordinates,
    answer: dict[str, Any] | None,
) -> None:
    """Print a plan; write a hint where metres lie off a map on which they would be cells."""
    if arguments.json:
        answered = {'answer': answer} if answer else {}
        print(json.dumps(plan_to_json(plan, coordinates.offset) | answered))
    else:
        goal = 'by the instruction' if ends_route(plan) else arguments.goal_place or ''
        print(plan_to_text(plan, coordinates, arguments.start_place or '', goal))
        if answer:
            print(f'answer     {answer["sentence"]}')
    if plan.instruction is not None and plan.instruction.interpretation.questions:
        sys.stderr.write(CONFIRM_HINT)
    if plan.code in (ResultCode.START_OUTSIDE_MAP, ResultCode.GOAL_OUTSIDE_MAP):
        points = [*filter(None, (arguments.start, arguments.goal)), *arguments.via]
        if coordinates.metres and all(map(coordinates.could_be_cell, points)):
            sys.stderr.write(
                'llm-astar: hint: coordinates are metres on this map; add --cells to give cells\n'
            )


def may_touch(plan: Plan, asked: Problem) -> bool:
    """Tell whether the path of a robot without a size is close to an obstacle of a metric map."""
    size = asked.request.footprint or asked.planner.config.robot_radius
    return asked.coordinates.metres and not size and plan.clearance < NARROW


def ends_route(plan: Plan) -> bool:
    """Tell whether a clause of the instruction says where the path ends."""
    if plan.instruction is None:
        return False
    from llm_astar_planner.instructions.clauses.end_at import EndAt  # noqa: PLC0415

    return any(outcome.clause.kind == EndAt.kind for outcome in plan.instruction.clauses)


def exit_code(plan: Plan, arguments: argparse.Namespace) -> int:
    """Return 0 for a path, 1 for none, 3 where it is not what was asked.

    That is where it does not keep the instruction or is partial, and where waypoints were
    required and none could be used.
    """
    if plan.code:
        return 1
    if arguments.require_waypoints and not guiding_points(plan.checked_waypoints):
        sys.stderr.write('llm-astar: --require-waypoints: no waypoint came that can be used\n')
        return 3
    is_broken = plan.instruction is not None and plan.instruction.satisfied is False
    return 3 if is_broken or plan.partial else 0


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
        'ways': [(way.path + offset).tolist() for way in plan.alternatives],
        'any_angle_path': None if shortened is None else (shortened.points + offset).tolist(),
    }


def plan_to_text(plan: Plan, coordinates: Coordinates, start: str = '', goal: str = '') -> str:
    """Return a plan as lines for a person: what came out, from where to where, and how.

    `start` and `goal` are the names of places, '' for points.
    """
    via = [(f'via {number}', cell, '') for number, cell in enumerate(plan.via, start=1)]
    ends = [('start', plan.start, start), *via, ('goal', plan.goal, goal)]
    named = [(name, coordinates.describe(*cell) + (at and f', {at}')) for name, cell, at in ends]
    points = [coordinates.describe(point.x, point.y) for point in plan.checked_waypoints]
    lines = [*first_lines(plan_report(plan, coordinates.grid_map), named, points)]
    if plan.code == 0:
        lines += path_lines(plan, coordinates)
    took = 1000 * plan.seconds_source, 1000 * plan.seconds_search, ', uncompiled' * INTERPRETED
    lines.append('time       {:.2f} ms for waypoints, {:.2f} ms to search{}'.format(*took))
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
    for number, way in enumerate(plan.alternatives, start=1):
        cells = map(coordinates.grid_map.world_to_cell, *zip(*way.around)) if way.around else ()
        others = [coordinates.describe(*cell) for cell in cells]
        lines.append(
            f'way {number:<6} {coordinates.describe_distance(way.length)}, '
            f'clearance {coordinates.describe_distance(way.clearance or math.inf)}'
            + (f', on the other side of {", ".join(others)}' if others else '')
        )
    return lines
