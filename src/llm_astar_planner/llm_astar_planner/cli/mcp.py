# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

r"""Serve route planning to agents over MCP, the Model Context Protocol.

The server speaks on standard input and output. Its tools are list_places, interpret, plan_route
and check_path, on a map file with its places, or on what a running planner_node plans with. It
needs the official SDK: pip install 'mcp>=2'.

usage: llm-astar mcp [--map FILE [--places FILE] | --graph [--namespace NAME]] [options]

examples:
  llm-astar mcp --map depot.yaml --places depot.places.geojson --robot-radius 0.3
  llm-astar mcp --map depot.yaml --source endpoint --base-url http://localhost:11434/v1 \
    --model qwen2.5:7b
  llm-astar mcp --graph --namespace /robot1

With --graph the map, the places and the parameters are those of the planner at that moment, and
the graph understands the instructions. The robot's own plans and instruction stay as they are.
"""

from __future__ import annotations

import argparse
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import FAR
from llm_astar_msgs_adapter.maps.places import Places, map_outline
from numpy.typing import NDArray

from llm_astar_planner.cli import map_files, planning_options
from llm_astar_planner.cli.flags import add_graph_options, option
from llm_astar_planner.cli.map_files import DECIMALS, place_to_json
from llm_astar_planner.cli.planning_options import PlanningOptions, settled
from llm_astar_planner.instructions import interpretation as readings
from llm_astar_planner.instructions.ground import goal_cell
from llm_astar_planner.instructions.interpretation import Interpretation
from llm_astar_planner.instructions.outcome import InstructionOutcome
from llm_astar_planner.instructions.route import Route, find_place
from llm_astar_planner.instructions.text import POLICIES, clean_instruction
from llm_astar_planner.instructions.verification import verify
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.parameters import costmap_config, request_fields
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, finite_or_none
from llm_astar_planner.search.any_angle import turning_points
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.config import SourceSettings

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.planner_client import PlannerState

MAX_POINTS = 10_000


class RouteToolError(LlmAstarError, ValueError):
    """An argument of a tool that cannot be used; the message names it and says what can."""


@dataclass(frozen=True)
class RouteTools:
    """Answers questions about routes on one map. Thread-safe."""

    planner: Planner
    places: Places
    interpreter: readings.Interpreter
    options: PlanningOptions

    def list_places(self) -> dict[str, Any]:
        """Return the map's frame and four corners, and its places."""
        grid_map = self.planner.grid_map
        corners = shapely.get_coordinates(map_outline(grid_map))[:4]
        return {
            'frame': grid_map.frame_id,
            'map_corners': rounded(corners),
            'places': [place_to_json(place) for place in self.places],
        }

    def interpret(self, text: str) -> dict[str, Any]:
        """Return what is understood of an instruction. Raises InstructionError if too long."""
        return self.interpretation(text).to_json()

    def plan_route(
        self,
        start: str | Sequence[float],
        goal: str | Sequence[float],
        instruction: str = '',
        policy: str = '',
        confirm: bool = False,
    ) -> dict[str, Any]:
        """Plan between two places or points, by an instruction; `confirm` answers its questions.

        Returns the path and what became of each clause. Raises RouteToolError, PlaceGoalError,
        InstructionError.
        """
        policy = policy or str(self.options.values['instruction_policy'])
        if policy not in POLICIES:
            raise RouteToolError(f'policy: {policy!r} is not one of {", ".join(POLICIES)}')
        interpretation = self.interpretation(instruction, is_meant=confirm)
        asked = readings.RouteInstruction(interpretation, self.places, policy)
        request = PlanRequest(
            self.cell_of('start', start),
            self.cell_of('goal', goal),
            want_expanded=False,
            instruction=asked if interpretation.text else None,
            **request_fields(self.options.values),
        )
        plan = self.planner.plan(request)
        path = turning_points(plan.path) if plan.any_angle is None else plan.any_angle.points
        resolution = self.planner.grid_map.resolution
        return {
            'found': plan.code == 0,
            'message': plan.message,
            'start': rounded(self.planner.grid_map.grid_to_world([plan.start]))[0],
            'goal': rounded(self.planner.grid_map.grid_to_world([plan.goal]))[0],
            'length': finite_or_none(round(plan.length * resolution, DECIMALS)),
            'path': rounded(self.planner.grid_map.grid_to_world(path)),
            'warnings': list(plan.warnings),
            'questions': list(interpretation.questions),
            'instruction': None if plan.instruction is None else plan.instruction.to_json(),
        }

    def check_path(
        self, points: Sequence[Sequence[float]], instruction: str = ''
    ) -> dict[str, Any]:
        """Say whether a path of straight segments can be driven and keeps to an instruction.

        Raises RouteToolError, InstructionError.
        """
        path = self.checked_points(points)
        grid_map = self.planner.grid_map
        cells = [grid_map.world_to_cell(x, y) for x, y in path.tolist()]
        interpretation = self.interpretation(instruction)
        outcome = None
        if interpretation.text:
            route = Route(self.planner.costmap, cells[0], cells[-1], self.places)
            clauses = verify(interpretation.specification, path, route)
            outcome = InstructionOutcome(interpretation, clauses)
        problem = self.planner.checker.segments_problem(np.array(cells, dtype=np.int32))
        if problem is not None:
            problem += ', in cells of the map'
        return {
            'drivable': problem is None,
            'problem': problem,
            'length': round(float(np.hypot(*np.diff(path, axis=0).T).sum()), DECIMALS),
            'instruction': None if outcome is None else outcome.to_json(),
        }

    def interpretation(self, text: str, *, is_meant: bool = False) -> Interpretation:
        """Return what is understood of a text; nothing of an empty one.

        Its questions are answered with yes if `is_meant`, or if they were before.
        """
        clean = clean_instruction(text)
        if not clean:
            return Interpretation('')
        limit = self.options.settings.timeout_s
        reading = self.interpreter.interpret(clean, self.places, limit)
        return settled(reading, self.places, confirm=is_meant or None)

    def cell_of(self, name: str, end: str | Sequence[float]) -> Cell:
        """Return the cell of a place or a point; `name` is the argument's."""
        if isinstance(end, str):
            return goal_cell(find_place(end, self.places), self.planner.costmap)
        x, y = point_of(name, end)
        return self.planner.grid_map.world_to_cell(x, y)

    def checked_points(self, points: Sequence[Sequence[float]]) -> NDArray[np.float64]:
        """Return points of the map as an array [n, 2], n > 0. Raises RouteToolError."""
        if not 1 <= len(points) <= MAX_POINTS:
            raise RouteToolError(f'points: {len(points)} are not 1 to {MAX_POINTS}')
        found = [point_of(f'points[{index}]', point) for index, point in enumerate(points)]
        for index, (x, y) in enumerate(found):
            if not self.planner.grid_map.contains(self.planner.grid_map.world_to_cell(x, y)):
                raise RouteToolError(f'points[{index}]: {x:g}, {y:g} lies off the map')
        return np.array(found, dtype=np.float64)


def point_of(name: str, point: Sequence[float]) -> tuple[float, float]:
    """Return a point of two finite numbers. Raises RouteToolError, which begins with `name`."""
    try:
        x, y = (float(value) for value in point)
    except (TypeError, ValueError):
        raise RouteToolError(f'{name}: [x, y] in metres is expected') from None
    if not (math.isfinite(x) and math.isfinite(y)) or max(abs(x), abs(y)) > FAR:
        raise RouteToolError(f'{name}: finite metres are expected')
    return x, y


def rounded(points: NDArray[np.float64]) -> list[list[float]]:
    """Return points [n, 2] as lists."""
    listed: list[list[float]] = np.round(points, DECIMALS).tolist()
    return listed


# The longest wait for an answer of the graph; a small model takes long to understand.
GRAPH_SECONDS = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    where = parser.add_argument_group('on a map file')
    map_files.add_map_options(where, default='demo.json')
    map_files.add_places_option(where)
    graph = parser.add_argument_group('on a running graph')
    option(graph, '--graph', 'use what a running planner has')
    add_graph_options(graph)
    planning_options.add_planning_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until the client closes standard input; return 0. Raises what reading files raises."""
    # An optional dependency; the help needs to work without it.
    from llm_astar_planner.cli.mcp_server import make_server  # noqa: PLC0415

    compile_kernels()
    if not arguments.graph:
        tools = tools_of_files(arguments)
        make_server(lambda: tools).run('stdio')
        return 0
    from llm_astar_planner.nodes.tools.planner_client import PlannerState, calling  # noqa: PLC0415

    with calling(arguments.namespace, arguments.node, GRAPH_SECONDS) as caller:
        make_server(GraphTools(PlannerState(caller)).current).run('stdio')
    return 0


def tools_of_files(arguments: argparse.Namespace) -> RouteTools:
    """Return the tools on a map file with its places. Raises what reading them raises."""
    problem = map_files.open_maps(arguments)[1]
    options = planning_options.read_planning_options(arguments, problem)
    places = map_files.open_places(options.values['places_file'], arguments.map)
    planner = options.make_planner(problem)
    map_files.warn_of_places(places, planner.grid_map)
    return RouteTools(planner.prepare(), places, options.make_interpreter(), options)


class GraphTools:
    """Makes route tools on what a running planner has; they are made again when that changes."""

    def __init__(self, state: PlannerState) -> None:
        """Take the state of a planner."""
        self._state = state
        self._lock = threading.Lock()
        self._planner: Planner | None = None

    def current(self) -> RouteTools:
        """Return the tools. Raises PlannerClientError where the planner does not answer."""
        with self._lock:
            values = self._state.values([item.name for item in planning_options.RULES])
            grid_map, config = self._state.grid_map(), costmap_config(values)
            known = self._planner
            if known is None or (known.grid_map.digest, known.config) != (grid_map.digest, config):
                self._planner = known = Planner(grid_map, config).prepare()
        settings = SourceSettings(timeout_s=GRAPH_SECONDS)
        options = planning_options.PlanningOptions(values, settings)
        return RouteTools(known, self._state.places(), self._state, options)
