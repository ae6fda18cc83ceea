"""The options of the commands that plan on a map file: rules, sources, instructions."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap

from llm_astar_planner.cli.map_files import PLACES_FILE
from llm_astar_planner.cli.parameter_flags import (
    add_parameter_flags,
    add_params_file_flag,
    parameter_values,
)
from llm_astar_planner.instructions.interpretation import (
    Interpreter,
    RouteInstruction,
    clean_instruction,
)
from llm_astar_planner.parameter import ParameterError, Scalar
from llm_astar_planner.planning.parameter_file import read_parameter_files
from llm_astar_planner.planning.parameters import PLANNER, SOURCE, costmap_config, source_config
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.config import SourceSettings

# planner_node's parameters that decide a plan, wherever it is made; the map's options include
# that of its places.
RULES = tuple(item for item in PLANNER if not item.node_only and item is not PLACES_FILE)


@dataclass(frozen=True)
class PlanningOptions:
    """The values of planner_node's parameters, and the settings of the source of waypoints."""

    values: dict[str, Any]
    settings: SourceSettings

    def make_planner(self, problem: ProblemMap) -> Planner:
        """Return a planner for a map; it still has to be prepared."""
        barriers = problem if isinstance(problem, BarrierMap) else None
        return Planner(problem.to_grid(), costmap_config(self.values), barriers)

    def make_interpreter(self) -> Interpreter:
        """Return who understands instructions. Raises ParameterError, TranscriptError."""
        # The grammar and the HTTP client take a fifth of a second to import.
        from llm_astar_planner.instructions.chain import make_interpreter  # noqa: PLC0415

        return make_interpreter(asdict(self.settings))

    def route_instruction(self, places: Places) -> RouteInstruction | None:
        """Return what is understood of the instruction, None if there is none."""
        text = clean_instruction(self.values['instruction'])
        if not text:
            return None
        interpreter = self.make_interpreter()
        interpretation = interpreter.interpret(text, places, self.settings.timeout_s)
        return RouteInstruction(interpretation, places, self.values['instruction_policy'])


def add_planning_options(parser: argparse.ArgumentParser) -> Any:  # noqa: ANN401 - argparse keeps its type private
    """Add planner_node's and llm_client_node's parameters; return the group of the latter."""
    rules = parser.add_argument_group(
        'rules', 'the parameters of planner_node; a cell of a barrier map is one metre wide'
    )
    add_params_file_flag(rules)
    add_parameter_flags(rules, RULES)
    rules.add_argument(
        '--methods', dest='method', default=argparse.SUPPRESS, help=argparse.SUPPRESS
    )
    guide = parser.add_argument_group('waypoints', 'the parameters of llm_client_node')
    add_parameter_flags(guide, SOURCE)
    return guide


def read_planning_options(arguments: argparse.Namespace, problem: ProblemMap) -> PlanningOptions:
    """Return the options by flags and files; on barrier maps corners may be cut by default.

    Raises ParameterError, and FileNotFoundError for a file that does not exist.
    """
    files = read_parameter_files(arguments.params_file) if arguments.params_file else {}
    values = parameter_values(arguments, (*RULES, PLACES_FILE), files.get('planner_node'))
    if arguments.corner_cutting is None and not arguments.params_file:
        values['corner_cutting'] = isinstance(problem, BarrierMap)
    return PlanningOptions(values, source_settings(arguments, files.get('llm_client_node')))


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
