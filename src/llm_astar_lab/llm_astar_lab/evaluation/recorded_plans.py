# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Requests of a bag and the plans that the robot's own stack made for them.

While a bag is read, a request waits for the stack's plan and report. They belong to a request by
the call they answer, by their stamp, or because the path ends at the request's goal.
"""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.messages.fields import path_from_message, stamp_of, values_of_report
from llm_astar_planner.instructions import interpretation as readings
from llm_astar_planner.instructions.fields import SpecificationError
from llm_astar_planner.instructions.interpretation import RouteInstruction, Understanding
from llm_astar_planner.instructions.messages import interpretation_from_json
from llm_astar_planner.instructions.text import InstructionError, clean_instruction
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.search.any_angle import turning_points
from numpy.typing import NDArray

from llm_astar_lab.results.row import cells_along, format_points, satisfied_column

# A recorded path belongs to a request if it ends this near to the goal, in metres.
GOAL_REACH = 0.5
# Coordinates (m) beyond this are not on any map.
FARTHEST = 1e8
# How many requests wait at once; when more come, the oldest goes on without its plan.
MAX_WAITING = 16
# A longer path (in cells) is not checked cell by cell.
LONGEST = 10_000_000

# The client's id and its number of the call.
Call = tuple[bytes, int]


@dataclass(eq=False)
class BagRequest:
    """A request of a bag, and what the robot's own stack answered, in metres in the map's frame.

    `time` is in ns since 1970, `index` its number in the bag. `tolerance` (m) is the caller's, 0
    where it named none. `points` [n, 2] are the stack's path: empty where it found none, None
    where none was recorded. `code`, `waypoints` and `instruction` come from a report of our
    planner. While an answer may still come, `stamp` (ns) is that of its first path or report.
    """

    bag: str
    index: int
    time: int
    start: Pose2D
    goal: Pose2D
    grid_map: GridMap
    barrier_map: BarrierMap | None = None
    tolerance: float = 0.0
    call: Call | None = None
    points: NDArray[np.float64] | None = None
    code: str = ''
    waypoints: tuple[tuple[float, float], ...] = ()
    instruction: Mapping[str, Any] | None = None
    stamp: int | None = None
    is_done: bool = False

    def is_answered_by(self, points: NDArray[np.float64], frame: str) -> bool:
        """Tell whether a path, points [n, 2] in metres in `frame`, ends at the goal."""
        reach = max(GOAL_REACH, 2 * self.grid_map.resolution)
        is_comparable = len(points) and frame in ('', self.grid_map.frame_id) and are_near(points)
        return bool(is_comparable and np.hypot(*(points[-1] - self.goal[:2])) <= reach)

    def asked(self, places: Places) -> RouteInstruction | None:
        """Return the recorded instruction as it was understood, None if there is none."""
        try:
            found = interpretation_from_json((self.instruction or {}).get('interpretation'))
            text = clean_instruction(found.text)
        except (InstructionError, SpecificationError):
            return None
        specification, status = found.specification, readings.status_of(found.specification)
        if not specification.clauses and found.status is not Understanding.IRRELEVANT:
            status = Understanding.NONE
        asked = readings.Interpretation(text, specification, found.understood_by, status)
        return RouteInstruction(asked, places) if text else None

    def columns(self, planner: Planner) -> dict[str, Any]:
        """Return its columns of a results row; `planner` checks the path."""
        grid_map, instruction = self.grid_map, self.instruction
        columns: dict[str, Any] = {
            'bag': self.bag, 'request': self.index, 'stamp': self.time / 1e9,
            'map_digest': grid_map.digest, 'recorded_code': self.code,
            'recorded_waypoints': format_points(grid_map.world_to_grid(self.waypoints).round(6)),
            'recorded_instruction': str((instruction or {}).get('summary', '')),
            'recorded_instruction_satisfied': satisfied_column(instruction),
        }  # fmt: skip
        if self.points is None:
            return columns
        points = grid_map.world_to_grid(self.points).round(6)
        if len(points) == 0:
            return columns | {'recorded_problem': 'it is empty'}
        columns['recorded_length'] = length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        if length > LONGEST:
            return columns | {'recorded_problem': f'it is over {LONGEST} cells long'}
        cells = cells_along(points)
        start, goal = ((int(x), int(y)) for x, y in (cells[0], cells[-1]))
        return columns | {
            'recorded_problem': planner.checker.path_problem(cells, start, goal) or '',
            'recorded_path': format_points(turning_points(cells)),
        }


class PendingRequests:
    """The requests that wait for an answer, in the order they were made."""

    def __init__(self, window: int, roles: Collection[str]) -> None:
        """Wait `window` ns at most; `roles` are those of the bag's topics."""
        self._window = window
        self._plans = 'plan' in roles or 'plan as request' in roles
        self._reports = 'report' in roles
        self._waiting: list[BagRequest] = []

    def add(self, request: BagRequest) -> None:
        """Add a request. It does not wait where nothing in the bag could answer it."""
        request.is_done = not (self._plans or self._reports or request.call)
        self._waiting.append(request)

    def expire(self, now: float = math.inf) -> None:
        """Let the requests go on that have waited too long by `now`; all of them without it."""
        for request in self._waiting:
            request.is_done |= now - request.time > self._window

    def pop_ready(self) -> Iterator[BagRequest]:
        """Yield, in their order, the requests that no longer wait."""
        while self._waiting and (self._waiting[0].is_done or len(self._waiting) > MAX_WAITING):
            yield self._waiting.pop(0)

    def take_response(self, call: Call, plan: Any) -> None:  # noqa: ANN401 - a decoded Path
        """Take the response to a call; it replaces a path published before."""
        points = path_from_message(plan)
        for request in self._waiting:
            if request.call == call and are_near(points):
                request.points, request.stamp = points, stamp_of(plan)
                request.is_done = not self._reports or bool(request.code)

    def take_plan(self, plan: Any) -> bool:  # noqa: ANN401 - a decoded Path
        """Take a published path; return whether it belongs to a waiting request.

        A path belongs to the first request without one that it fits. Later paths with the same
        stamp replace it.
        """
        points, stamp = path_from_message(plan), stamp_of(plan)
        for request in self._waiting:
            fits = request.stamp is None and request.is_answered_by(points, plan.header.frame_id)
            if not request.is_done and (fits or request.stamp == stamp):
                request.points, request.stamp = points, stamp
                request.is_done = not (self._reports or request.call)
                return True
        return False

    def take_report(self, report: Any) -> None:  # noqa: ANN401 - a decoded DiagnosticArray
        """Take a report of our planner, which comes after all paths with its stamp."""
        values = values_of_report(report)
        try:
            code = str(values['code_name'])
            waypoints = tuple((float(x), float(y)) for x, y, *_ in values['waypoints'])
        except (KeyError, TypeError, ValueError, OverflowError):
            return
        stamp = stamp_of(report)
        known = {request.stamp: request for request in reversed(self._waiting)}
        if request := known.get(stamp, known.get(None)):
            instruction = values.get('instruction_report')
            request.code, request.stamp = code, stamp
            request.waypoints = waypoints if are_near(np.array(waypoints)) else ()
            request.instruction = instruction if isinstance(instruction, dict) else None
            request.is_done = request.call is None or request.points is not None


def are_near(points: NDArray[np.float64]) -> bool:
    """Tell whether all coordinates (m) are numbers below FARTHEST."""
    return bool((np.abs(points) < FARTHEST).all())
