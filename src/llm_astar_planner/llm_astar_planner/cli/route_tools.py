# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What an agent may ask about routes on one map: the tools of `llm-astar mcp`, without MCP.

Points are [x, y] in metres of the map's frame. All input is checked; what cannot be used raises
an error with a sentence that says what can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Places, map_outline
from numpy.typing import NDArray

from llm_astar_planner.cli.map_files import DECIMALS, place_to_json
from llm_astar_planner.cli.planning_options import PlanningOptions, settled
from llm_astar_planner.instructions import interpretation as readings
from llm_astar_planner.instructions.fields import as_choice, as_numbers
from llm_astar_planner.instructions.interpretation import Interpretation
from llm_astar_planner.instructions.outcome import InstructionOutcome
from llm_astar_planner.instructions.region_finder import goal_cell
from llm_astar_planner.instructions.route import Route, find_place
from llm_astar_planner.instructions.text import POLICIES, clean_instruction
from llm_astar_planner.instructions.verification.verify import verify
from llm_astar_planner.planning.parameters import request_fields
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.questions import Questions
from llm_astar_planner.planning.types import PlanRequest, finite_or_none
from llm_astar_planner.search.any_angle import turning_points
from llm_astar_planner.search.result import Cell

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

        Returns the path and what became of each clause. Raises SpecificationError, PlaceGoalError,
        InstructionError.
        """
        policy = as_choice(policy or self.options.values['instruction_policy'], 'policy', POLICIES)
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
            'why': None if plan.why is None else plan.why.to_json(),
            'start': rounded(self.planner.grid_map.grid_to_world([plan.start]))[0],
            'goal': rounded(self.planner.grid_map.grid_to_world([plan.goal]))[0],
            'length': finite_or_none(round(plan.length * resolution, DECIMALS)),
            'path': rounded(self.planner.grid_map.grid_to_world(path)),
            'warnings': list(plan.warnings),
            'questions': list(interpretation.questions),
            'instruction': None if plan.instruction is None else plan.instruction.to_json(),
        }

    def ask_why(
        self, start: str | Sequence[float], goal: str | Sequence[float], question: str
    ) -> dict[str, Any]:
        """Answer a question about the best path between two places or points.

        Raises RouteToolError, PlaceGoalError, QuestionError.
        """
        ends = self.cell_of('start', start), self.cell_of('goal', goal)
        request = PlanRequest(*ends, **request_fields(self.options.values))
        asked = Questions(self.planner, request, self.interpreter, self.places)
        return asked.answer(question)

    def check_path(
        self, points: Sequence[Sequence[float]], instruction: str = ''
    ) -> dict[str, Any]:
        """Say whether a path of straight segments can be driven and keeps to an instruction.

        Raises RouteToolError, SpecificationError, InstructionError.
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
        x, y = as_numbers(end, name, 2)
        return self.planner.grid_map.world_to_cell(x, y)

    def checked_points(self, points: Sequence[Sequence[float]]) -> NDArray[np.float64]:
        """Return points of the map as an array [n, 2], n > 0. Raises as `plan_route`."""
        if not 1 <= len(points) <= MAX_POINTS:
            raise RouteToolError(f'points: {len(points)} are not 1 to {MAX_POINTS}')
        found = [as_numbers(point, f'points[{i}]', 2) for i, point in enumerate(points)]
        for index, (x, y) in enumerate(found):
            if not self.planner.grid_map.contains(self.planner.grid_map.world_to_cell(x, y)):
                raise RouteToolError(f'points[{index}]: {x:g}, {y:g} lies off the map')
        return np.array(found, dtype=np.float64)


def rounded(points: NDArray[np.float64]) -> list[list[float]]:
    """Return points [n, 2] as lists."""
    listed: list[list[float]] = np.round(points, DECIMALS).tolist()
    return listed
