"""Plan from start to goal on a map, without ROS.

Without options it plans the first start-goal pair of the demo map. Start and goal are points
(metres on a robot's map, cells on other maps) or names of places. The first line says whether a
path was found, the others how long it is, what became of the waypoints, and how much was searched.
The parameters of the nodes are flags; with the nodes' own --params-file it plans as they do.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import Point, Sample
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap

from llm_astar_planner.cli.coordinates import (
    Coordinates,
    add_unit_options,
    coordinates_of,
)
from llm_astar_planner.cli.map_files import (
    add_map_options,
    add_places_option,
    barrier_maps_of,
    open_maps,
    open_places,
    warn_of_places,
)
from llm_astar_planner.cli.pictures import add_picture_option
from llm_astar_planner.cli.plan_output import plan_to_json, plan_to_text
from llm_astar_planner.cli.planning_options import (
    PlanningOptions,
    add_planning_options,
    read_planning_options,
)
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.extensions import find_drawing
from llm_astar_planner.instructions.route import Route, find_place
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.compile import compile_progress
from llm_astar_planner.planning.parameters import (
    request_fields,
)
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.segment import guiding_points
from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode, check_request
from llm_astar_planner.search.numba_start import start_numba
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.config import make_source
from llm_astar_planner.waypoints.prompts.query_parser import parse_query
from llm_astar_planner.waypoints.replay import FixedReply
from llm_astar_planner.waypoints.source import SampleKey, WaypointSource

USAGE = """\
llm-astar plan [--map FILE] [--start X Y --goal X Y | --from NAME --to NAME]
                      [--source NAME] [--png FILE] [--json] [options]"""
EPILOG = """\
examples:
  llm-astar plan
  llm-astar plan --map demo.json --map-id 0 --pair 1 --method astar --png out/astar.png
  llm-astar plan --map depot.yaml --start 0.4 -0.3 --goal 15.4 2.2 --robot-radius 0.2
  llm-astar plan --start 5 5 --goal 20 20 --via 30 8 --tolerance 1.5
  llm-astar plan --map depot.yaml --start 150 150 --goal 450 200 --cells
  llm-astar plan --map depot.yaml --start 0.4 -0.3 --goal 15.4 2.2 --params-file robot.yaml
  llm-astar plan --map house.yaml --from kitchen --to study --instruction "avoid the hall"
  llm-astar plan --reply "Generated Path: [[31, 10], [27, 9], [12, 9]]" --json
  llm-astar plan --source endpoint --base-url http://localhost:11434/v1 --model qwen2.5:7b
  llm-astar plan --query "design a path from [5, 5] to [20, 20] on a 51 by 31 grid that avoids
    horizontal barriers centered at [[10, 0, 25], [15, 30, 50]] and vertical barriers at
    [[25, 10, 22]]."

exit codes: 0 a path, 1 no path, 2 bad usage or input, 3 a path but, with --require-waypoints, no
usable waypoint
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_query_options(parser, 'demo.json')
    output = parser.add_argument_group('output')
    output.add_argument(
        '--require-waypoints',
        action='store_true',
        help='exit with 3 if no waypoint came that the search could use',
    )
    add_picture_option(output, 'draw the plan')
    output.add_argument(
        '--json', action='store_true', help='print one JSON object, with its points in cells'
    )


def add_query_options(parser: argparse.ArgumentParser, default_map: str) -> None:
    """Add what is asked: map, start and goal, parameters and waypoints."""
    where = parser.add_argument_group('where')
    add_map_options(where, default=default_map)
    add_places_option(where)
    where.add_argument(
        '--pair',
        type=int,
        default=0,
        metavar='N',
        help='start-goal pair of the map, unless start and goal are given (default: 0)',
    )
    point: dict[str, Any] = {'type': float, 'nargs': 2, 'metavar': ('X', 'Y')}
    first, last = (where.add_mutually_exclusive_group() for _ in range(2))
    first.add_argument(
        '--start', **point, help='start here: in metres on a robot map, else a cell'
    )
    first.add_argument(
        '--from', dest='start_place', metavar='NAME', help='start at a place instead'
    )
    last.add_argument('--goal', **point, help='go here, in the same unit')
    last.add_argument(
        '--to',
        dest='goal_place',
        metavar='NAME',
        help='go to a place instead: to the free cell that is nearest to its centre; without a '
        'start, from that of --pair',
    )
    where.add_argument(
        '--query',
        metavar='TEXT',
        help='the whole question as a sentence, in the form of the dataset (see below)',
    )
    where.add_argument(
        '--via',
        **point,
        action='append',
        default=[],
        help='pass here on the way, in the same unit; repeat it for more, in order',
    )
    add_unit_options(where)
    guide = add_planning_options(parser)
    guide.add_argument(
        '--reply',
        metavar='TEXT',
        help="a model's reply, with its waypoints in cells, used instead of a source",
    )


@dataclass(frozen=True)
class Problem:
    """What a command was asked to plan: a request on the map of a planner."""

    planner: Planner
    request: PlanRequest
    coordinates: Coordinates
    places: Places


def run(arguments: argparse.Namespace) -> int:
    """Plan, print, draw; return the exit code. Raises what `read_problem` does on bad input."""
    drawing = find_drawing('plan') if arguments.png else None
    asked = read_problem(arguments)
    planner = asked.planner
    start_numba()
    # So that the time of the plan is for planning; says so where it takes long.
    with compile_progress():
        planner.prepare().compile(asked.request)
    plan = planner.plan(asked.request)
    show(plan, arguments, asked.coordinates)
    if drawing is not None:
        route = Route(planner.costmap, plan.start, plan.goal, asked.places)
        drawing.load()(plan, route, asked.coordinates.offset, arguments.png)
        if not arguments.json:
            print(f'picture    {arguments.png}')
    return exit_code(plan, arguments)


def read_problem(arguments: argparse.Namespace) -> Problem:
    """Return what the options of `add_query_options` ask for.

    Raises ParameterError, and what reading a map or a source raises, on bad input.
    """
    maps, problem = choose_problem(arguments)
    options = read_planning_options(arguments, problem)
    planner = options.make_planner(problem)
    map_file = arguments.map if arguments.query is None else None
    places = open_places(options.values['places_file'], map_file)
    warn_of_places(places, planner.grid_map)
    coordinates = coordinates_of(arguments, problem, planner.grid_map)
    start, goal = choose_endpoints(arguments, problem, places, planner.costmap, coordinates)
    request = PlanRequest(
        start,
        goal,
        source=waypoint_source(arguments, options, maps, coordinates.offset),
        sample=sample_key_of(problem, start, goal),
        via=tuple(coordinates.to_cell('--via', point) for point in arguments.via),
        instruction=options.route_instruction(places),
        **request_fields(options.values),
    )
    check_request(request)
    return Problem(planner, request, coordinates, places)


def show(plan: Plan, arguments: argparse.Namespace, coordinates: Coordinates) -> None:
    """Print a plan; write a hint where metres lie off a map on which they would be cells."""
    if arguments.json:
        print(json.dumps(plan_to_json(plan, coordinates.offset)))
    else:
        names = (arguments.start_place or '', arguments.goal_place or '')
        print(plan_to_text(plan, coordinates, *names))
    if plan.code in (ResultCode.START_OUTSIDE_MAP, ResultCode.GOAL_OUTSIDE_MAP):
        points = [*filter(None, (arguments.start, arguments.goal)), *arguments.via]
        if coordinates.metres and all(map(coordinates.could_be_cell, points)):
            sys.stderr.write(
                'llm-astar: hint: coordinates are metres on this map; add --cells to give cells\n'
            )


def exit_code(plan: Plan, arguments: argparse.Namespace) -> int:
    """Return 0 for a path, 1 for none, 3 where waypoints were required and none could be used."""
    if plan.code:
        return 1
    if arguments.require_waypoints and not guiding_points(plan.checked_waypoints):
        sys.stderr.write('llm-astar: --require-waypoints: no waypoint came that can be used\n')
        return 3
    return 0


def waypoint_source(
    arguments: argparse.Namespace,
    options: PlanningOptions,
    maps: list[ProblemMap],
    offset: Point,
) -> WaypointSource | None:
    """Return the source of waypoints, or None. Raises what making one raises."""
    if arguments.reply is not None:
        return FixedReply(arguments.reply, offset)
    if not options.values['use_waypoints']:
        return None
    return make_source(options.settings, dataset=barrier_maps_of(maps))


def choose_problem(
    arguments: argparse.Namespace,
) -> tuple[list[ProblemMap], ProblemMap]:
    """Return all maps, and the one to plan on: of a sentence or of a file."""
    if arguments.query is not None:
        barrier_map = parse_query(arguments.query)
        return [barrier_map], barrier_map
    return open_maps(arguments)


def choose_endpoints(
    arguments: argparse.Namespace,
    problem: ProblemMap,
    places: Places,
    costmap: Costmap,
    coordinates: Coordinates,
) -> tuple[Cell, Cell]:
    """Return the cells of start and goal: of places, of coordinates, else of the map's pair.

    Raises ParameterError for options that do not go together and for coordinates in the wrong
    unit, PlaceGoalError for a place that does not exist or that nobody can stand in.
    """

    def cell_of(place: str | None, point: Sequence[float] | None, option: str) -> Cell | None:
        if place is not None:
            from llm_astar_planner.instructions.enforcement import goal_cell  # noqa: PLC0415

            return goal_cell(find_place(place, places), costmap)
        return None if point is None else coordinates.to_cell(option, point)

    start = cell_of(arguments.start_place, arguments.start, '--start')
    goal = cell_of(arguments.goal_place, arguments.goal, '--goal')
    if start is None or goal is None:
        if start is not None or arguments.goal is not None:
            raise ParameterError(
                '--start and --goal, or --from and --to, go together; leave them out to take '
                '--pair'
            )
        sample = pair_of(arguments, problem)
        start, goal = problem.to_cell(sample.start), goal or problem.to_cell(sample.goal)
    return start, goal


def pair_of(arguments: argparse.Namespace, problem: ProblemMap) -> Sample:
    """Return the start-goal pair of `--pair`. Raises ParameterError where there is none."""
    if not 0 <= arguments.pair < len(problem.samples):
        count = len(problem.samples)
        fix = '' if count else '; give --start and --goal'
        raise ParameterError(f'--pair {arguments.pair}: map {problem.id} has {count} pairs{fix}')
    sample: Sample = problem.samples[arguments.pair]
    return sample


def sample_key_of(problem: ProblemMap, start: Cell, goal: Cell) -> SampleKey | None:
    """Return the key of the map's sample between two cells, None if it has none."""
    for pair, sample in enumerate(problem.samples):
        if (problem.to_cell(sample.start), problem.to_cell(sample.goal)) == (start, goal):
            return SampleKey(problem.id, pair)
    return None
