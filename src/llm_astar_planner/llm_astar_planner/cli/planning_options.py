# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The options of the commands that plan on a map file, and the problem that they pose."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Point, Sample
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap

from llm_astar_planner.cli import flags, map_files
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.zone_layer import with_zones
from llm_astar_planner.instructions.text import clean_instruction
from llm_astar_planner.parameter import Parameter, ParameterError, Scalar
from llm_astar_planner.planning import parameters
from llm_astar_planner.planning.parameters import PLANNER, SOURCE, read_parameter_files
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, check_request
from llm_astar_planner.resources import find_file, state_file
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.replay import FixedReply
from llm_astar_planner.waypoints.source import SampleKey, WaypointSource

if TYPE_CHECKING:
    from llm_astar_planner.instructions import interpretation as readings
    from llm_astar_planner.instructions.interpretation import Interpretation, RouteInstruction

# planner_node's parameters that decide a plan, wherever it is made; the map's options include
# that of its places.
RULES = tuple(item for item in PLANNER if not item.node_only and item is not map_files.PLACES_FILE)
Ask = Callable[[tuple[str, ...]], bool | None]


@dataclass(frozen=True)
class PlanningOptions:
    """The values of planner_node's parameters, and the settings of the source of waypoints."""

    values: dict[str, Any]
    settings: SourceSettings

    def make_planner(self, problem: ProblemMap, zones: str = '') -> Planner:
        """Return a planner for a map with zones, a GeoJSON text; it still has to be prepared.

        Raises ZonesError.
        """
        barriers = problem if isinstance(problem, BarrierMap) else None
        config, grid_map = parameters.costmap_config(self.values), problem.to_grid()
        if zones:
            grid_map = with_zones(grid_map, zones, config)
        return Planner(grid_map, config, barriers)

    def make_interpreter(self) -> readings.Interpreter:
        """Return who understands instructions. Raises ParameterError, TranscriptError."""
        # The grammar and the HTTP client take a fifth of a second to import.
        from llm_astar_planner.instructions.chain import make_interpreter  # noqa: PLC0415

        return make_interpreter(asdict(self.settings))


def route_instruction(
    values: Mapping[str, Any],
    places: Places,
    limit: float,
    make: Callable[[], readings.Interpreter],
    settle: Callable[[Interpretation, Places], Interpretation] = lambda reading, _: reading,
) -> RouteInstruction | None:
    """Return what is understood of the instruction among parameters, None if there is none.

    It is understood within `limit` seconds by the interpreter that `make` returns; `settle` may
    answer its questions.
    """
    text = clean_instruction(values['instruction'])
    if not text:
        return None
    # A clause of each kind, which other plans do not need.
    from llm_astar_planner.instructions.interpretation import RouteInstruction  # noqa: PLC0415

    reading = settle(make().interpret(text, places, limit), places)
    return RouteInstruction(reading, places, values['instruction_policy'])


def settled(
    reading: Interpretation, places: Places, *, confirm: bool | None, ask: Ask = lambda _: None
) -> Interpretation:
    """Return a reading with its questions answered: by `confirm`, else as before, else by `ask`.

    An answer is remembered for these places.
    """
    from llm_astar_planner.instructions.current import Confirmations  # noqa: PLC0415

    confirmations = Confirmations(state_file('confirmations.json'))
    if confirm is None:
        reading = confirmations.applied(reading, places)
        confirm = ask(reading.questions) if reading.questions else None
    if confirm is not None and reading.questions:
        with suppress(OSError):  # where nothing can be written it holds for this time
            confirmations.remember(reading, places, confirm)
    return confirmations.applied(reading, places)


@dataclass(frozen=True)
class Problem:
    """What a command was asked to plan: a request on the map of a planner."""

    planner: Planner
    request: PlanRequest
    coordinates: map_files.Coordinates
    places: Places


def add_planning_options(parser: argparse.ArgumentParser) -> Any:  # noqa: ANN401 - argparse keeps its type private
    """Add planner_node's and llm_client_node's parameters; return the group of the latter."""
    rules = parser.add_argument_group(
        'rules', 'the parameters of planner_node; a cell of a barrier map is one metre wide'
    )
    flags.add_params_file_flag(rules)
    flags.add_parameter_flags(rules, RULES)
    hidden = argparse.SUPPRESS
    rules.add_argument('--methods', dest='method', default=hidden, help=hidden)
    guide = parser.add_argument_group('waypoints', 'the parameters of llm_client_node')
    flags.add_parameter_flags(guide, SOURCE)
    return guide


def add_query_options(parser: argparse.ArgumentParser, default_map: str) -> None:
    """Add what is asked: map, start and goal, parameters and waypoints."""
    where = parser.add_argument_group('where')
    map_files.add_map_options(where, default=default_map)
    map_files.add_places_option(where)
    text = 'GeoJSON with zones on the map and rules of the road, or a nav2_route graph'
    flags.option(where, '--zones FILE', text)
    text = 'start-goal pair of the map, unless start and goal are given (default: 0)'
    flags.option(where, '--pair N', text, default=0)
    first, last = (where.add_mutually_exclusive_group() for _ in range(2))
    text = 'start here: in metres on a robot map, else a cell'
    flags.option(first, '--start', text, **flags.POINT)
    flags.option(first, '--from NAME', 'start at a place instead', dest='start_place')
    flags.option(last, '--goal', 'go here, in the same unit', **flags.POINT)
    flags.option(
        last, '--to NAME',
        'go to a place instead: to the free cell that is nearest to its centre; without a '
        'start, from that of --pair', dest='goal_place',
    )  # fmt: skip
    text = 'take what is unsure of the instruction as it was read'
    flags.option(where, '--confirm', text)
    text = 'pass here on the way, in the same unit; repeat it for more, in order'
    flags.option(where, '--via', text, **flags.POINT, action='append', default=[])
    map_files.add_unit_options(where)
    text = "a model's reply, with its waypoints in cells, used instead of a source"
    flags.option(add_planning_options(parser), '--reply TEXT', text)


def parameter_values(
    arguments: argparse.Namespace, items: Iterable[Parameter], file: Mapping[str, Scalar] | None
) -> dict[str, Any]:
    """Return every parameter's value: of its flag, else of a file, else its default.

    The default is the node's where there is a file, else the command line's.
    """
    items = tuple(items)
    known = parameters.defaults(items, cli=file is None)
    in_file = {name: value for name, value in (file or {}).items() if name in known}
    return known | in_file | flags.given_values(arguments, items)


def read_planning_options(arguments: argparse.Namespace, problem: ProblemMap) -> PlanningOptions:
    """Return the options by flags and files; on barrier maps corners may be cut by default.

    Raises ParameterError, and FileNotFoundError for a file that does not exist.
    """
    files = read_parameter_files(arguments.params_file) if arguments.params_file else {}
    values = parameter_values(
        arguments, (*RULES, map_files.PLACES_FILE), files.get('planner_node')
    )
    if arguments.corner_cutting is None and not arguments.params_file:
        values['corner_cutting'] = isinstance(problem, BarrierMap)
    settings = parameters.source_config(
        parameter_values(arguments, SOURCE, files.get('llm_client_node'))
    )
    if arguments.record and settings.source != 'endpoint':
        raise ParameterError('--record keeps exchanges with --source endpoint; no other has any')
    if settings.transcript:
        settings = replace(settings, transcript=str(find_file(settings.transcript, 'maps')))
    return PlanningOptions(values, settings)


def read_problem(arguments: argparse.Namespace) -> Problem:
    """Return what the options of `add_query_options` ask for.

    Raises ParameterError, and what reading a map or a source raises, on bad input.
    """
    ends = arguments.start or arguments.start_place, arguments.goal or arguments.goal_place
    # Drawing pairs imports scipy.ndimage: a tenth of a second that a plan does not need.
    maps, problem = map_files.open_maps(arguments, 0 if all(ends) else None)
    options = read_planning_options(arguments, problem)
    planner = options.make_planner(problem, map_files.zones_text(arguments.zones))
    words = options.values['instruction'] or getattr(arguments, 'why', None)
    places = map_files.open_places(
        options.values['places_file'], arguments.map, by_words=bool(words)
    )
    map_files.warn_of_places(places, planner.grid_map)
    coordinates = map_files.coordinates_of(arguments, problem, planner.grid_map)
    start, goal = choose_endpoints(arguments, problem, places, planner.costmap, coordinates)
    request = PlanRequest(
        start,
        goal,
        source=waypoint_source(arguments, options, maps, problem.offset),
        sample=sample_key_of(problem, start, goal),
        via=tuple(coordinates.to_cell('--via', point) for point in arguments.via),
        instruction=route_instruction(
            options.values,
            places,
            options.settings.timeout_s,
            options.make_interpreter,
            partial(settled, confirm=arguments.confirm or None, ask=flags.ask_person),
        ),
        **parameters.request_fields(options.values),
    )
    check_request(request)
    return Problem(planner, request, coordinates, places)


def waypoint_source(
    arguments: argparse.Namespace, options: PlanningOptions, maps: list[ProblemMap], offset: Point
) -> WaypointSource | None:
    """Return the source of waypoints, or None. Raises what making one raises."""
    if arguments.reply is not None:
        return FixedReply(arguments.reply, offset)
    if not options.values['use_waypoints']:
        return None
    barrier_maps = [item for item in maps if isinstance(item, BarrierMap)]
    return make_source(options.settings, dataset=barrier_maps)


def choose_endpoints(
    arguments: argparse.Namespace,
    problem: ProblemMap,
    places: Places,
    costmap: Costmap,
    coordinates: map_files.Coordinates,
) -> tuple[Cell, Cell]:
    """Return the cells of start and goal: of places, of coordinates, else of the map's pair.

    Raises ParameterError for options that do not go together and for coordinates in the wrong
    unit, PlaceGoalError for a place that does not exist or that nobody can stand in.
    """

    def cell_of(end: str) -> Cell | None:
        place, point = getattr(arguments, f'{end}_place'), getattr(arguments, end)
        if place is not None:
            from llm_astar_planner.instructions.region_finder import goal_cell  # noqa: PLC0415
            from llm_astar_planner.instructions.route import find_place  # noqa: PLC0415

            return goal_cell(find_place(place, places), costmap)
        return None if point is None else coordinates.to_cell(f'--{end}', point)

    start, goal = cell_of('start'), cell_of('goal')
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
    count = len(problem.samples)
    if not 0 <= arguments.pair < count:
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
