"""Requests of a bag and the plans that the robot's own stack made for them.

While a bag is read, a request waits for the stack's plan and report. They belong to a request by
the call they answer, by their stamp, or because the path ends at the request's goal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.messages.fields import path_from_message, stamp_of, values_of_report
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
    status_of,
)
from llm_astar_planner.instructions.specification import SpecificationError
from llm_astar_planner.instructions.specification_json import from_json
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
IRRELEVANT = Understanding.IRRELEVANT.value

# The client's id and its number of the call.
Call = tuple[bytes, int]


@dataclass
class StackAnswer:
    """What the robot's own stack answered to a request.

    `points` [n, 2] are its path: empty where it found none, None where none was recorded. `code`,
    `waypoints` and `instruction` come from a report of our planner. Coordinates are metres in the
    map's frame in a `BagRequest`, those of the grid in a `RecordedPlan`.
    """

    points: NDArray[np.float64] | None = None
    code: str = ''
    waypoints: tuple[tuple[float, float], ...] = ()
    instruction: Mapping[str, Any] | None = None

    def on_grid(self, grid_map: GridMap) -> StackAnswer:
        """Return the answer in grid coordinates."""
        points = None if self.points is None else grid_map.world_to_grid(self.points).round(6)
        waypoints = grid_map.world_to_grid(self.waypoints).round(6).tolist()
        return replace(self, points=points, waypoints=tuple((x, y) for x, y in waypoints))


@dataclass
class BagRequest:
    """A request of a bag: poses in metres in the map's frame, `time` in ns since 1970.

    `index` is its number in the bag. `tolerance` (m) is the caller's, 0 where it named none.
    While its answer may still come, `stamp` (ns) is that of its first path or report.
    """

    index: int
    time: int
    start: Pose2D
    goal: Pose2D
    grid_map: GridMap
    barrier_map: BarrierMap | None = None
    tolerance: float = 0.0
    call: Call | None = None
    recorded: StackAnswer = field(default_factory=StackAnswer)
    stamp: int | None = None
    is_done: bool = False

    def is_answered_by(self, points: NDArray[np.float64], frame: str) -> bool:
        """Tell whether a path, points [n, 2] in metres in `frame`, ends at the goal."""
        known = frame in ('', self.grid_map.frame_id)
        if not (len(points) and known and are_near(points)):
            return False
        reach = max(GOAL_REACH, 2 * self.grid_map.resolution)
        return bool(np.hypot(*(points[-1] - self.goal[:2])) <= reach)


class PendingRequests:
    """The requests that wait for an answer, in the order they were made."""

    def __init__(self, window: int, *, plans: bool, reports: bool) -> None:
        """Wait `window` ns at most; `plans` and `reports` say whether the bag has any."""
        self._window = window
        self._plans = plans
        self._reports = reports
        self._waiting: list[BagRequest] = []

    def add(self, request: BagRequest) -> None:
        """Add a request. It does not wait where nothing in the bag could answer it."""
        request.is_done = not (self._plans or self._reports or request.call)
        self._waiting.append(request)

    def expire(self, now: float = math.inf) -> None:
        """Let the requests go on that have waited too long by `now`; all of them without it."""
        for request in self._waiting:
            request.is_done = request.is_done or now - request.time > self._window

    def pop_ready(self) -> Iterator[BagRequest]:
        """Yield, in their order, the requests that no longer wait."""
        while self._waiting and (self._waiting[0].is_done or len(self._waiting) > MAX_WAITING):
            yield self._waiting.pop(0)

    def take_response(self, call: Call, plan: Any) -> None:  # noqa: ANN401 - a decoded Path
        """Take the response to a call; it replaces a path published before."""
        points = path_from_message(plan)
        for request in self._waiting:
            if request.call == call and are_near(points):
                request.recorded.points, request.stamp = points, stamp_of(plan)
                request.is_done = not self._reports or bool(request.recorded.code)

    def take_plan(self, plan: Any) -> bool:  # noqa: ANN401 - a decoded Path
        """Take a published path; return whether it belongs to a waiting request.

        A path belongs to the first request without one that it fits. Later paths with the same
        stamp replace it.
        """
        points, stamp = path_from_message(plan), stamp_of(plan)
        for request in self._waiting:
            fits = request.stamp is None and request.is_answered_by(points, plan.header.frame_id)
            if not request.is_done and (fits or request.stamp == stamp):
                request.recorded.points, request.stamp = points, stamp
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
        same_stamp = [request for request in self._waiting if request.stamp == stamp]
        unanswered = [request for request in self._waiting if request.stamp is None]
        for request in (*same_stamp, *unanswered)[:1]:
            recorded, instruction = request.recorded, values.get('instruction_report')
            recorded.code = code
            recorded.waypoints = waypoints if are_near(np.array(waypoints)) else ()
            recorded.instruction = instruction if isinstance(instruction, dict) else None
            request.stamp = stamp
            request.is_done = request.call is None or recorded.points is not None


@dataclass(frozen=True, eq=False)
class RecordedPlan:
    """A request of a bag and the stack's plan for it; `time` (ns since 1970) is the request's."""

    bag: str
    request: int
    time: int
    map_digest: str
    answer: StackAnswer

    @classmethod
    def of(cls, bag: str, request: BagRequest) -> RecordedPlan:
        """Return the recorded plan for a request of the bag with this name."""
        grid_map = request.grid_map
        answer = request.recorded.on_grid(grid_map)
        return cls(bag, request.index, request.time, grid_map.digest, answer)

    def asked(self, places: Places) -> RouteInstruction | None:
        """Return the recorded instruction as it was understood, None if there is none."""
        interpretation = (self.answer.instruction or {}).get('interpretation')
        if not isinstance(interpretation, dict) or not interpretation.get('text'):
            return None
        try:
            text = clean_instruction(str(interpretation['text']))
            specification = from_json(interpretation.get('specification'))
        except (InstructionError, SpecificationError):
            return None
        understood_by = str(interpretation.get('understood_by', ''))
        status = status_of(specification)
        if not specification.clauses and interpretation.get('status') != IRRELEVANT:
            status = Understanding.NONE
        return RouteInstruction(Interpretation(text, specification, understood_by, status), places)

    def columns(self, planner: Planner) -> dict[str, Any]:
        """Return its columns of a results row; `planner` checks the path."""
        points, instruction = self.answer.points, self.answer.instruction
        columns: dict[str, Any] = {
            'bag': self.bag,
            'request': self.request,
            'stamp': self.time / 1e9,
            'map_digest': self.map_digest,
            'recorded_code': self.answer.code,
            'recorded_waypoints': format_points(self.answer.waypoints),
            'recorded_instruction': str((instruction or {}).get('summary', '')),
            'recorded_instruction_satisfied': satisfied_column(instruction),
        }
        if points is None:
            return columns
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


def are_near(points: NDArray[np.float64]) -> bool:
    """Tell whether all coordinates (m) are numbers below FARTHEST."""
    return bool((np.abs(points) < FARTHEST).all())
