"""What the robot's own stack made of requests: each waits for its answer, for a while."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message, stamp_of, values_of_report
from numpy.typing import NDArray

# A recorded plan is a request's if it ends this near to the goal, in metres.
GOAL_REACH = 0.5
# Metres from the origin that no robot's map spans.
FARTHEST = 1e8
# Requests whose answers are waited for at once; the oldest goes on without when more come.
MAX_WAITING = 16

# The client's id and its number of the call.
Call = tuple[bytes, int]


@dataclass
class Recorded:
    """What the robot's own stack made of a request.

    `points` [n, 2] are its path in metres in the map's frame, empty where it found none and None
    where none was recorded; `code` and `waypoints` (metres) are from a report of ours.
    """

    points: NDArray[np.float64] | None = None
    code: str = ''
    waypoints: tuple[tuple[float, float], ...] = ()


@dataclass
class BagRequest:
    """A question as the bag has it: poses in metres in the map's frame, `time` in ns.

    `tolerance` (metres) is the caller's own, 0 where it leaves it to the planner.
    """

    index: int
    time: int
    start: Pose2D
    goal: Pose2D
    grid_map: GridMap
    barrier_map: BarrierMap | None = None
    tolerance: float = 0.0
    recorded: Recorded = field(default_factory=Recorded)


@dataclass
class _Waiting:
    """A request whose answer may still come; `stamp` is that of its first path."""

    request: BagRequest
    call: Call | None
    stamp: int | None = None
    done: bool = False


class Answers:
    """The requests that wait, in the order they were made."""

    def __init__(self, window: int, *, plans: bool, reports: bool) -> None:
        """Wait `window` ns at most; `plans` and `reports` say what the bag has at all."""
        self._window = window
        self._plans = plans
        self._reports = reports
        self._waiting: list[_Waiting] = []

    def wait(self, request: BagRequest, call: Call | None) -> None:
        """Take a request; one that nothing could answer does not wait."""
        answerable = self._plans or self._reports or call is not None
        self._waiting.append(_Waiting(request, call, done=not answerable))

    def give_up(self, now: int | None = None) -> None:
        """Let the requests go that have waited long enough by `now`, all of them for None."""
        for item in self._waiting:
            item.done = item.done or now is None or now - item.request.time > self._window

    def ready(self) -> Iterator[BagRequest]:
        """Yield, in their order, the requests that wait no more."""
        while self._waiting and (self._waiting[0].done or len(self._waiting) > MAX_WAITING):
            yield self._waiting.pop(0).request

    def take_response(self, call: Call, plan: Any) -> None:  # noqa: ANN401 - a decoded Path
        """Take a call's own answer, which counts more than what was published meanwhile."""
        points = path_from_message(plan)
        for item in self._waiting:
            if item.call == call and _on_earth(points):
                item.request.recorded.points = points
                item.stamp = stamp_of(plan)
                item.done = not self._reports or bool(item.request.recorded.code)

    def take_plan(self, plan: Any) -> bool:  # noqa: ANN401 - a decoded Path
        """Take a path as the answer to the first request it fits; later ones improve on it.

        Tells whether there was one.
        """
        points = path_from_message(plan)
        stamp = stamp_of(plan)
        for item in self._waiting:
            first = item.stamp is None and _reaches(points, plan.header.frame_id, item.request)
            if (first or item.stamp == stamp) and not item.done:
                item.request.recorded.points = points
                item.stamp = stamp
                item.done = not (self._reports or item.call)
                return True
        return False

    def take_report(self, report: Any) -> None:  # noqa: ANN401 - a decoded DiagnosticArray
        """Take a report of ours: it is the last that comes under its plan's stamp."""
        values = values_of_report(report)
        try:
            code = str(values['code_name'])
            waypoints = tuple((float(x), float(y)) for x, y, *_ in values['waypoints'])
        except (KeyError, TypeError, ValueError, OverflowError):
            return
        stamp = stamp_of(report)
        named = [item for item in self._waiting if item.stamp == stamp]
        unanswered = [item for item in self._waiting if item.stamp is None]
        for item in (*named, *unanswered)[:1]:
            recorded = item.request.recorded
            recorded.code = code
            recorded.waypoints = waypoints if _on_earth(np.array(waypoints)) else ()
            item.stamp = stamp
            item.done = item.call is None or recorded.points is not None


def _on_earth(points: NDArray[np.float64]) -> bool:
    """Tell whether points are places at all."""
    return bool((np.abs(points) < FARTHEST).all())


def _reaches(points: NDArray[np.float64], frame: str, request: BagRequest) -> bool:
    """Tell whether a path in the map's frame ends at a request's goal."""
    known = frame in ('', request.grid_map.frame_id)
    if not (len(points) and known and _on_earth(points)):
        return False
    reach = max(GOAL_REACH, 2 * request.grid_map.resolution)
    return bool(np.hypot(*(points[-1] - request.goal[:2])) <= reach)
