"""Plan from start to goal on a map, without ROS.

The parameters of the nodes are flags; with the nodes' own --params-file it plans as they do.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Point, find_barrier_map

from llm_astar_planner.benchmark.datasets.samples import ProblemMap, load_maps
from llm_astar_planner.cli.parameter_flags import (
    add_parameter_flags,
    add_params_file_flag,
    parameter_values,
    read_params_files,
)
from llm_astar_planner.parameter import ParameterError, Scalar
from llm_astar_planner.planning.parameters import (
    PLANNER,
    SOURCE,
    costmap_config,
    request_fields,
    source_config,
)
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest, check_request
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.paper import compile_kernels
from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.factory import make_source
from llm_astar_planner.waypoints.fixed import FixedReply
from llm_astar_planner.waypoints.prompts.query_parser import parse_query
from llm_astar_planner.waypoints.source import SampleKey, WaypointSource

# planner_node's parameters that decide a plan, wherever it is made.
RULES = tuple(item for item in PLANNER if not item.node_only)
EPILOG = """\
examples:
  llm-astar plan
  llm-astar plan --map demo.json --map-id 0 --pair 1 --method astar --png out/astar.png
  llm-astar plan --map depot.yaml --start 150 150 --goal 450 200 --robot-radius 0.2
  llm-astar plan --start 5 5 --goal 20 20 --via 30 8 --tolerance 1.5
  llm-astar plan --map depot.yaml --start 150 150 --goal 450 200 --params-file robot.yaml
  llm-astar plan --reply "Generated Path: [[31, 10], [27, 9], [12, 9]]" --json
  llm-astar plan --source endpoint --base-url http://localhost:11434/v1 --model qwen2.5:7b
  llm-astar plan --query "design a path from [5, 5] to [20, 20] on a 51 by 31 grid that avoids
    horizontal barriers centered at [[10, 0, 25], [15, 30, 50]] and vertical barriers at
    [[25, 10, 22]]."
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    where = parser.add_argument_group('where')
    where.add_argument(
        '--map',
        default='demo.json',
        metavar='FILE',
        help='barrier-map JSON, a path or a name in maps/ (default: %(default)s); or a '
        'map_server yaml, or a MovingAI x.map.scen',
    )
    where.add_argument('--map-id', type=int, metavar='ID', help='map of the file (default: first)')
    where.add_argument(
        '--pair',
        type=int,
        default=0,
        metavar='N',
        help='start-goal pair of the map, unless --start and --goal are given (default: 0)',
    )
    cell: dict[str, Any] = {'type': int, 'nargs': 2, 'metavar': ('X', 'Y')}
    where.add_argument('--start', **cell, help='a cell, not metres')
    where.add_argument('--goal', **cell, help='likewise')
    where.add_argument(
        '--query',
        metavar='TEXT',
        help='the whole question as a sentence, in the form of the dataset (see below)',
    )
    where.add_argument(
        '--via',
        type=int,
        nargs=2,
        action='append',
        default=[],
        metavar=('X', 'Y'),
        help='a cell to pass on the way; repeat it for more, in order',
    )
    rules = parser.add_argument_group(
        'rules', 'the parameters of planner_node; a cell of a barrier map is one metre wide'
    )
    add_params_file_flag(rules)
    add_parameter_flags(rules, RULES)
    guide = parser.add_argument_group('waypoints', 'the parameters of llm_client_node')
    add_parameter_flags(guide, SOURCE)
    guide.add_argument('--reply', metavar='TEXT', help="a model's reply, used instead of a source")
    output = parser.add_argument_group('output')
    output.add_argument('--png', metavar='FILE', help='draw the plan')
    output.add_argument('--json', action='store_true', help='print one JSON object')


def run(arguments: argparse.Namespace) -> int:
    """Plan, print, draw; return 0 if there is a path, else 1.

    Raises ParameterError, and what reading a map or a source raises, on bad input.
    """
    if (arguments.start is None) != (arguments.goal is None):
        raise ParameterError('--start and --goal go together; leave both out to take --pair')
    files = read_params_files(arguments).values if arguments.params_file else {}
    values = parameter_values(arguments, RULES, files.get('planner_node'))
    settings = source_settings(arguments, files.get('llm_client_node'))
    maps, (problem, start, goal) = choose_problem(arguments)
    barriers = problem if isinstance(problem, BarrierMap) else None
    if arguments.corner_cutting is None and not arguments.params_file:
        values['corner_cutting'] = barriers is not None
    # The map coordinates of cell (0, 0).
    offset = (0, 0) if barriers is None else (barriers.range_x[0], barriers.range_y[0])
    source: WaypointSource | None = None
    if arguments.reply is not None:
        source = FixedReply(arguments.reply, offset)
    elif values['use_waypoints']:
        source = make_source(settings, dataset=barrier_maps_of(maps))
    request = PlanRequest(
        problem.to_cell(start),
        problem.to_cell(goal),
        source=source,
        sample=sample_key_of(problem, start, goal),
        via=tuple(problem.to_cell((x, y)) for x, y in arguments.via),
        **request_fields(values),
    )
    check_request(request)
    compile_kernels()
    planner = Planner(problem.to_grid(), costmap_config(values), barriers).prepare()
    plan = planner.plan(request)
    if arguments.json:
        print(json.dumps(plan_to_json(plan, offset)))
    else:
        print(plan_to_text(plan, offset))
    if arguments.png:
        # Importing matplotlib takes most of a second.
        from llm_astar_planner.visualization.figures import drawable_map, picture_of, save_picture  # noqa: PLC0415

        grid_map = drawable_map(planner.grid_map, planner.config)
        picture = picture_of(plan, grid_map, plan.start, plan.goal, offset)
        save_picture(picture, arguments.png)
        if not arguments.json:
            print(f'picture    {arguments.png}')
    return 0 if plan.code == 0 else 1


def source_settings(
    arguments: argparse.Namespace, file: Mapping[str, Scalar] | None
) -> SourceSettings:
    """Return the settings of the waypoint source, by flags and llm_client_node's parameters.

    Raises ParameterError, and FileNotFoundError for a transcript that does not exist.
    """
    settings = source_config(parameter_values(arguments, SOURCE, file))
    if arguments.record and settings.source != 'endpoint':
        raise ParameterError('--record keeps exchanges with --source endpoint; no other has any')
    if settings.transcript:
        settings = replace(settings, transcript=str(find_file(settings.transcript, 'maps')))
    return settings


def choose_problem(
    arguments: argparse.Namespace,
) -> tuple[list[ProblemMap], tuple[ProblemMap, Point, Point]]:
    """Return all maps, and the map, start and goal to plan: from a sentence or from numbers."""
    if arguments.query is not None:
        barrier_map = parse_query(arguments.query)
        sample = barrier_map.samples[0]
        return [barrier_map], (barrier_map, sample.start, sample.goal)
    maps = load_maps(find_file(arguments.map, 'maps'))
    problem = maps[0]
    if arguments.map_id not in (None, problem.id):
        problem = find_barrier_map(barrier_maps_of(maps), arguments.map_id)
    if arguments.start is not None:
        return maps, (problem, tuple(arguments.start), tuple(arguments.goal))
    if not 0 <= arguments.pair < len(problem.samples):
        count = len(problem.samples)
        raise ParameterError(f'--pair {arguments.pair}: map {problem.id} has {count} pairs')
    sample = problem.samples[arguments.pair]
    return maps, (problem, sample.start, sample.goal)


def barrier_maps_of(maps: list[ProblemMap]) -> list[BarrierMap]:
    """Return the maps that are given by barriers."""
    return [item for item in maps if isinstance(item, BarrierMap)]


def sample_key_of(problem: ProblemMap, start: Point, goal: Point) -> SampleKey | None:
    """Return the key of the map's sample with this start and goal, None if it has none."""
    for pair, sample in enumerate(problem.samples):
        if (sample.start, sample.goal) == (start, goal):
            return SampleKey(problem.id, pair)
    return None


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
