"""`llm-astar plan`: one plan on a barrier map or a grid, without ROS."""

from __future__ import annotations

import argparse
import json
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Point, find_barrier_map

from llm_astar_planner.benchmark.datasets.samples import ProblemMap, load_maps
from llm_astar_planner.cli.plan_output import plan_to_json, plan_to_text
from llm_astar_planner.cli.source_options import add_source_arguments, source_settings
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.request_check import request_problem
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.paper import HEURISTICS, METHODS, compile_kernels
from llm_astar_planner.waypoints.factory import make_asker, make_source
from llm_astar_planner.waypoints.fixed import FixedReply
from llm_astar_planner.waypoints.prompts.instruction import clean_instruction
from llm_astar_planner.waypoints.prompts.query_parser import parse_query
from llm_astar_planner.waypoints.source import SampleKey, WaypointSource

EPILOG = """\
examples:
  llm-astar plan
  llm-astar plan --map demo.json --map-id 0 --pair 1 --method astar --png out/astar.png
  llm-astar plan --map depot.yaml --start 150 150 --goal 450 200 --robot-radius 0.2
  llm-astar plan --start 5 5 --goal 20 20 --via 30 8 --tolerance 1.5
  llm-astar plan --reply "Generated Path: [[31, 10], [27, 9], [12, 9]]" --json
  llm-astar plan --source endpoint --base-url http://localhost:11434/v1 --model qwen2.5:7b
  llm-astar plan --query "design a path from [5, 5] to [20, 20] on a 51 by 31 grid that avoids
    horizontal barriers centered at [[10, 0, 25], [15, 30, 50]] and vertical barriers at
    [[25, 10, 22]]."
"""


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the command to `llm-astar`."""
    parser = commands.add_parser(
        'plan',
        description='Plan from start to goal on a barrier map, without ROS, under the '
        "paper's rules; or on a grid, in cells, where no corner is cut.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
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
        help='start-goal pair of the map, where --start and --goal are not given (default: 0)',
    )
    cell: dict[str, Any] = {'type': int, 'nargs': 2, 'metavar': ('X', 'Y')}
    where.add_argument('--start', **cell, help='a cell, not metres')
    where.add_argument('--goal', **cell, help='likewise')
    where.add_argument(
        '--query',
        metavar='TEXT',
        help="a sentence instead: of the dataset's own form, or any with --source endpoint",
    )
    _add_robot_arguments(parser)
    how = parser.add_argument_group('how')
    how.add_argument(
        '--method', default='guided', help=f'one of {", ".join(METHODS)} (default: guided)'
    )
    how.add_argument(
        '--heuristic',
        default='euclidean',
        help=f"the paper's methods': one of {', '.join(HEURISTICS)} (default: euclidean)",
    )
    how.add_argument('--weight', type=float, default=2.0, help="weighted_astar's (default: 2)")
    how.add_argument(
        '--no-corner-cutting',
        action='store_true',
        help='forbid diagonal steps past blocked cells, as on a robot',
    )
    how.add_argument(
        '--max-suboptimality',
        type=float,
        default=1.1,
        metavar='W',
        help='have guided prove its path within W of the shortest, W >= 1; 0: take its first path '
        '(default: %(default)s)',
    )
    how.add_argument('--any-angle', action='store_true', help='shorten the path at any angle')
    how.add_argument(
        '--time-limit',
        type=float,
        default=60.0,
        metavar='SECONDS',
        help='for waypoints and search together (default: %(default)s)',
    )
    guide = parser.add_argument_group('guidance')
    add_source_arguments(guide)
    guide.add_argument('--reply', metavar='TEXT', help="a model's reply, used instead of a source")
    guide.add_argument(
        '--instruction',
        default='',
        metavar='TEXT',
        help='a wish in plain language, for a source that reads one (endpoint)',
    )
    output = parser.add_argument_group('output')
    output.add_argument('--png', metavar='FILE', help='draw the plan')
    output.add_argument('--json', action='store_true', help='print one JSON object')


def _add_robot_arguments(parser: argparse.ArgumentParser) -> None:
    robot = parser.add_argument_group(
        'robot', 'in metres, 0 by default; a cell of a barrier map is one'
    )
    metres: dict[str, Any] = {'type': float, 'default': 0.0, 'metavar': 'METRES'}
    robot.add_argument('--robot-radius', **metres, help='stay this far from obstacles')
    robot.add_argument(
        '--inflation-radius',
        **metres,
        help='count cells up to here as dear, nearer ones as dearer',
    )
    robot.add_argument(
        '--tolerance', **metres, help='how far off the goal the path may end, where it must'
    )
    robot.add_argument(
        '--start-tolerance',
        **metres,
        help='how far off a start that is not free the path may begin',
    )
    robot.add_argument(
        '--via',
        type=int,
        nargs=2,
        action='append',
        default=[],
        metavar=('X', 'Y'),
        help='a cell to pass on the way; repeat it for more, in order',
    )


def run(arguments: argparse.Namespace) -> int:
    """Plan, print, draw; return 0 for a plan and 1 for none. Raises ValueError on bad input.

    The code of what went wrong, Nav2's as the nodes have it, is in what is printed.
    """
    _check(arguments)
    maps, (problem, start, goal) = _problem(arguments)
    barriers = problem if isinstance(problem, BarrierMap) else None
    rules = CostmapConfig(
        corner_cutting=barriers is not None and not arguments.no_corner_cutting,
        robot_radius=arguments.robot_radius,
        inflation_radius=arguments.inflation_radius,
    )
    offset = _corner(problem)
    request = PlanRequest(
        problem.to_cell(start),
        problem.to_cell(goal),
        arguments.method,
        _source(arguments, offset, maps),
        arguments.heuristic,
        arguments.weight,
        arguments.time_limit,
        max_suboptimality=arguments.max_suboptimality or None,
        any_angle=arguments.any_angle,
        sample=_sample(problem, start, goal),
        tolerance=arguments.tolerance,
        start_tolerance=arguments.start_tolerance,
        via=tuple(problem.to_cell((x, y)) for x, y in arguments.via),
        instruction=clean_instruction(arguments.instruction),
    )
    wrong = request_problem(request)
    if wrong:
        raise ValueError(wrong)
    compile_kernels()
    planner = Planner(problem.to_grid(), rules, barriers).prepare()
    plan = planner.plan(request)
    if arguments.json:
        print(json.dumps(plan_to_json(plan, offset)))
    else:
        print(plan_to_text(plan, offset))
    if arguments.png:
        _draw(arguments, plan, planner, offset)
    return 0 if plan.code == 0 else 1


def _check(arguments: argparse.Namespace) -> None:
    """Raise ValueError on what argparse could not know to be wrong."""
    if (arguments.start is None) != (arguments.goal is None):
        raise ValueError('--start and --goal go together; leave both out to take --pair')
    if arguments.record and arguments.source != 'endpoint':
        raise ValueError('--record keeps exchanges with --source endpoint; no other has any')
    if not arguments.time_limit > 0.0:
        raise ValueError(f'--time-limit {arguments.time_limit} is not above 0 seconds')


def _problem(
    arguments: argparse.Namespace,
) -> tuple[list[ProblemMap], tuple[ProblemMap, Point, Point]]:
    """Return the maps and which problem on them is asked, by sentence or by numbers."""
    if arguments.query is not None:
        ask = None
        if arguments.source == 'endpoint':
            ask = make_asker(source_settings(arguments))
        question = parse_query(arguments.query, ask)
        return [question.barrier_map], question
    maps = load_maps(find_file(arguments.map, 'maps'))
    problem = maps[0]
    if arguments.map_id not in (None, problem.id):
        problem = find_barrier_map(_barrier_maps(maps), arguments.map_id)
    return maps, (problem, *_ends(arguments, problem))


def _barrier_maps(maps: list[ProblemMap]) -> list[BarrierMap]:
    return [item for item in maps if isinstance(item, BarrierMap)]


def _corner(problem: ProblemMap) -> Point:
    """Return the map coordinates of cell (0, 0)."""
    if isinstance(problem, BarrierMap):
        return problem.range_x[0], problem.range_y[0]
    return 0, 0


def _ends(arguments: argparse.Namespace, barrier_map: ProblemMap) -> tuple[Point, Point]:
    if arguments.start is not None:
        return tuple(arguments.start), tuple(arguments.goal)
    if not 0 <= arguments.pair < len(barrier_map.samples):
        count = len(barrier_map.samples)
        raise ValueError(f'--pair {arguments.pair}: map {barrier_map.id} has {count} pairs')
    sample = barrier_map.samples[arguments.pair]
    return sample.start, sample.goal


def _sample(barrier_map: ProblemMap, start: Point, goal: Point) -> SampleKey | None:
    """Return which sample of the map this is, if it is one."""
    for pair, sample in enumerate(barrier_map.samples):
        if (sample.start, sample.goal) == (start, goal):
            return SampleKey(barrier_map.id, pair)
    return None


def _source(
    arguments: argparse.Namespace, offset: Point, maps: list[ProblemMap]
) -> WaypointSource:
    if arguments.reply is not None:
        return FixedReply(arguments.reply, offset)
    settings = source_settings(arguments)
    return make_source(settings, dataset=_barrier_maps(maps))


def _draw(
    arguments: argparse.Namespace,
    plan: Plan,
    planner: Planner,
    offset: Point,
) -> None:
    # matplotlib takes most of a second to import; who draws nothing need not wait for it.
    from llm_astar_planner.visualization.figures import picture_of, save_picture  # noqa: PLC0415

    picture = picture_of(plan, planner.grid_map, plan.start, plan.goal, offset)
    save_picture(picture, arguments.png)
    if not arguments.json:
        print(f'picture    {arguments.png}')
