"""From a bag's messages to questions for a planner: from where to where, on the map of then.

Messages are taken one by one; kept are the current map, the latest poses and transforms, and the
few requests whose recorded answer may still come.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.bag_file import JUMP
from llm_astar_msgs_adapter.bag_reading import Bag, Message
from llm_astar_msgs_adapter.barrier_map import BarrierMap, BarrierMapError, parse_barrier_map
from llm_astar_msgs_adapter.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.map_update import updated
from llm_astar_msgs_adapter.message_values import (
    grid_from_message,
    matrix_of,
    path_from_message,
    stamp_of,
    values_of_report,
)
from llm_astar_msgs_adapter.transforms import Transforms, flat_pose
from numpy.typing import NDArray

from llm_astar_planner.benchmark.bag_contents import Wanted, missing, parts
from llm_astar_planner.benchmark.request_list import ListedRequest

REQUESTED, ANSWERED = (0, 1), (2, 3)  # event types of service_msgs/ServiceEventInfo
BASE_FRAMES = ('base_link', 'base_footprint')
# A recorded plan is a request's if it ends this near to the goal, in metres.
GOAL_REACH = 0.5
# Requests whose answers are waited for at once; the oldest goes on without when more come.
MAX_WAITING = 16
# Calls remembered, since client and server may both have told of one.
MAX_CALLS = 1000

Matrix = NDArray[np.float64]


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
    """A question as the bag has it: poses in metres in the map's frame, `time` in ns."""

    index: int
    time: int
    start: Pose2D
    goal: Pose2D
    grid_map: GridMap
    barrier_map: BarrierMap | None = None
    recorded: Recorded = field(default_factory=Recorded)


@dataclass
class _Waiting:
    """A request whose answer may still come; `stamp` is that of its first path."""

    request: BagRequest
    call: tuple[bytes, int] | None = None
    stamp: int | None = None
    done: bool = False


class RequestReader:
    """Reads the requests of one bag."""

    def __init__(
        self, bag: Bag, wanted: Wanted, window: float, listed: Sequence[ListedRequest] = ()
    ) -> None:
        """Take a bag; answers are looked for `window` seconds behind a request."""
        self.bag = bag
        self._problems = bag.problems
        self._parts = parts(bag, wanted)
        self._missing = missing(bag, self._parts, wanted)
        self._window = int(window * 1e9)
        self._listed = sorted(listed, key=lambda item: item.time)
        self._reports = 'report' in self._parts.values()
        self._answers = bool({'plan', 'report'} & set(self._parts.values()))
        self._grid_map: GridMap | None = None
        self._barriers: BarrierMap | None = None
        self._transforms = Transforms()
        self._start: Message | None = None
        self._odometry: Message | None = None
        self._waiting: list[_Waiting] = []
        self._calls: OrderedDict[tuple[bytes, int], None] = OrderedDict()
        self._now = 0
        self._count = 0
        self._noted: set[str] = set()
        self._handlers: dict[str, Callable[[Message], None]] = {
            'map': self._on_map,
            'map update': self._on_update,
            'barriers': self._on_barriers,
            'request': self._on_event,
            'goal': self._on_goal,
            'start': self._on_start,
            'odometry': self._on_odometry,
            'tf': self._on_tf,
            'static tf': self._on_static_tf,
            'plan': self._on_plan,
            'report': self._on_report,
        }

    def requests(self) -> Iterator[BagRequest]:
        """Yield the requests in the order they were made, each when its answer is known."""
        if self._missing:
            self._problems.leave_out(self._missing)
            return
        topics = [name for name, part in self._parts.items() if part in self._handlers]
        for message in self.bag.messages(topics):
            self._advance(message.time)
            self._handlers[self._parts[message.topic]](message)
            yield from self._ready()
        self._ask_listed(None)
        self._advance(self._now + self._window + 1)
        yield from self._ready()
        if not self._count:
            self._leave_out('no request in it could be read', 'requests')

    def _advance(self, now: int) -> None:
        """Let the time pass: listed requests are made, waiting ones given up."""
        if now < self._now - JUMP:
            self._jump(self._now - now)
        self._ask_listed(self.bag.seconds(now))
        for item in self._waiting:
            item.done = item.done or now - item.request.time > self._window
        self._now = now

    def _jump(self, back: int) -> None:
        self._problems.note(
            f'{self.bag.path}: the clock jumps back by {back / 1e9:.3f} s; what was known of the '
            "robot's place before is forgotten"
        )
        self._transforms.forget_moving()
        self._start = self._odometry = None
        for item in self._waiting:
            item.done = True

    def _ready(self) -> Iterator[BagRequest]:
        """Yield, in their order, the requests that wait no more."""
        while self._waiting and (self._waiting[0].done or len(self._waiting) > MAX_WAITING):
            yield self._waiting.pop(0).request

    def _on_map(self, message: Message) -> None:
        before = self._grid_map
        try:
            self._grid_map = grid_from_message(message.value)
        except GridMapError as error:
            self._leave_out(f'{self._when(message)}: a map is refused, {error}', 'maps')
            return
        if before is not None and before.cells.shape != self._grid_map.cells.shape:
            sizes = [f'{item.width} x {item.height}' for item in (before, self._grid_map)]
            self._note_once(
                'resized',
                f'the map changes its size; at {self.bag.seconds(message.time):.3f} s from '
                f'{sizes[0]} to {sizes[1]} cells',
            )

    def _on_update(self, message: Message) -> None:
        if self._grid_map is None:
            self._leave_out(f'{self._when(message)}: a map update before any map', 'map updates')
            return
        try:
            self._grid_map = updated(self._grid_map, message.value)
        except GridMapError as error:
            self._leave_out(f'{self._when(message)}: a map update, {error}', 'map updates')

    def _on_barriers(self, message: Message) -> None:
        try:
            self._barriers = parse_barrier_map(json.loads(message.value.data), 'its barriers')
        except (BarrierMapError, ValueError, RecursionError) as error:
            self._leave_out(f'{self._when(message)}: {error}', 'barrier maps')

    def _on_start(self, message: Message) -> None:
        self._start = message

    def _on_odometry(self, message: Message) -> None:
        self._odometry = message

    def _on_tf(self, message: Message) -> None:
        self._transforms.add(message.value, message.time, static=False)

    def _on_static_tf(self, message: Message) -> None:
        self._transforms.add(message.value, message.time, static=True)

    def _on_event(self, message: Message) -> None:
        """Take a call of GetPlan, or its answer; events without contents tell nothing."""
        event = message.value
        call = (bytes(bytearray(event.info.client_gid)), int(event.info.sequence_number))
        if event.info.event_type in ANSWERED:
            if len(event.response):
                self._answer(call, event.response[0].plan)
            return
        if call in self._calls:
            return
        if not len(event.request):
            self._problems.leave_out(
                f'{self.bag.path}: {message.topic}: its events are without contents; set '
                'service introspection to `contents` to record requests'
            )
            return
        self._calls[call] = None
        if len(self._calls) > MAX_CALLS:
            self._calls.popitem(last=False)
        request = event.request[0]
        ends = (self._in_map(pose.pose, pose.header.frame_id) for pose in
                (request.start, request.goal))  # fmt: skip
        self._ask(self._when(message), *ends, call=call)

    def _on_goal(self, message: Message) -> None:
        goal = message.value
        self._ask(
            self._when(message),
            self._where_robot_is(message.time),
            self._in_map(goal.pose, goal.header.frame_id),
        )

    def _ask_listed(self, now: float | None) -> None:
        """Make the listed requests whose time has come, all that are left for None."""
        while self._listed and (now is None or self._listed[0].time < now):
            item = self._listed.pop(0)
            self._ask(f'listed request {item.number}', item.start, item.goal)

    def _ask(
        self,
        when: str,
        start: Pose2D | str,
        goal: Pose2D | str,
        *,
        call: tuple[bytes, int] | None = None,
    ) -> None:
        """Make a request; a pose that is a sentence says why it is none."""
        index, self._count = self._count, self._count + 1
        if self._grid_map is None:
            self._leave_out(f'{when}: a request before the first map', 'requests')
            return
        for name, pose in (('start', start), ('goal', goal)):
            if isinstance(pose, str):
                self._leave_out(f'{when}: a request whose {name} {pose}', 'requests')
                return
        assert isinstance(start, Pose2D) and isinstance(goal, Pose2D)  # noqa: S101, PT018
        request = BagRequest(
            index, self._now, start, goal, self._grid_map, self._fitting_barriers()
        )
        self._waiting.append(_Waiting(request, call, done=not (self._answers or call)))

    def _fitting_barriers(self) -> BarrierMap | None:
        """Return the barriers of the current map, if those told are its."""
        if self._barriers is None or self._grid_map is None:
            return None
        grid = self._barriers.to_grid()
        same = grid.origin == self._grid_map.origin and grid.resolution == 1.0
        fits = same and np.array_equal(grid.cells, self._grid_map.cells)
        return self._barriers if fits and self._grid_map.resolution == 1.0 else None

    def _in_map(self, pose: Any, frame: str) -> Pose2D | str:  # noqa: ANN401 - a decoded Pose
        """Return a pose in the map's frame, or say why there is none."""
        target = '' if self._grid_map is None else self._grid_map.frame_id
        try:
            matrix = matrix_of(pose.position, pose.orientation)
        except GridMapError as error:
            return str(error)
        # Callers that leave the frame empty mean the map's.
        if frame in ('', target):
            return flat_pose(matrix)
        known = self._transforms.lookup(target, frame, self._now)
        if known is None:
            return f'is in frame {frame!r}, the map in {target!r}, and no tf joins them'
        return flat_pose(known @ matrix)

    def _is_in_map(self, frame: str) -> bool:
        return self._grid_map is not None and frame in ('', self._grid_map.frame_id)

    def _where_robot_is(self, now: int) -> Pose2D | str:
        """Return the robot's place by tf, else by odometry, else as it was last told."""
        target = '' if self._grid_map is None else self._grid_map.frame_id
        for frame in BASE_FRAMES:
            known = self._transforms.lookup(target, frame, now)
            if known is not None:
                return flat_pose(known)
        for message in (self._odometry, self._start):
            if message is not None:
                place = self._in_map(message.value.pose.pose, message.value.header.frame_id)
                if isinstance(place, Pose2D):
                    return place
        return 'is not known: no tf from the map to base_link, no odometry, no initialpose yet'

    def _answer(self, call: tuple[bytes, int], plan: Any) -> None:  # noqa: ANN401 - a Path
        """Take a call's own answer, which counts more than what was published meanwhile."""
        for item in self._waiting:
            if item.call == call:
                item.request.recorded.points = path_from_message(plan)
                item.stamp = stamp_of(plan)
                item.done = not self._reports or bool(item.request.recorded.code)

    def _on_plan(self, message: Message) -> None:
        """Take a path as the answer to the first request it fits; later ones improve on it."""
        points = path_from_message(message.value)
        stamp = stamp_of(message.value)
        if not len(points) or not self._is_in_map(message.value.header.frame_id):
            return
        for item in self._waiting:
            fits = item.stamp == stamp or (item.stamp is None and _reaches(points, item.request))
            if fits and not item.done:
                item.request.recorded.points = points
                item.stamp = stamp
                item.done = not (self._reports or item.call)
                return

    def _on_report(self, message: Message) -> None:
        """Take a report of ours: the last that a plan's stamp is told with."""
        values = values_of_report(message.value)
        if 'code_name' not in values:
            return
        stamp = stamp_of(message.value)
        item = next((item for item in self._waiting if item.stamp == stamp), None)
        if item is None:
            unanswered = (item for item in self._waiting if item.stamp is None)
            item = next(unanswered, None)
        if item is None:
            return
        recorded = item.request.recorded
        recorded.code = str(values['code_name'])
        recorded.waypoints = tuple((float(x), float(y)) for x, y, *_ in values['waypoints'])
        item.stamp = stamp
        item.done = item.call is None or recorded.points is not None

    def _note_once(self, kind: str, what: str) -> None:
        if kind not in self._noted:
            self._noted.add(kind)
            self._problems.note(f'{self.bag.path}: {what}')

    def _when(self, message: Message) -> str:
        return f'{message.topic} at {self.bag.seconds(message.time):.3f} s'

    def _leave_out(self, what: str, kind: str) -> None:
        self._problems.leave_out(f'{self.bag.path}: {what}', f'{self.bag.path}: {kind} left out')


def _reaches(points: NDArray[np.float64], request: BagRequest) -> bool:
    """Tell whether a path ends at a request's goal."""
    if not len(points):
        return False
    reach = max(GOAL_REACH, 2 * request.grid_map.resolution)
    return bool(np.hypot(*(points[-1] - request.goal[:2])) <= reach)
