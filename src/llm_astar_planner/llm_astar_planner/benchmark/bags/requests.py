"""From a bag's messages to questions for a planner: from where to where, on the map of then.

Messages are taken one by one; kept are the current map, the latest poses and transforms, and the
few requests whose recorded answer may still come.
"""

from __future__ import annotations

import json
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any

from llm_astar_msgs_adapter.bags.files import JUMP
from llm_astar_msgs_adapter.bags.reading import Bag, BagMessage
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, BarrierMapError, parse_barrier_map
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import grid_from_message
from llm_astar_msgs_adapter.messages.map_update import updated

from llm_astar_planner.benchmark.bags.pending_requests import Answers, BagRequest, Call
from llm_astar_planner.benchmark.bags.request_list import ListedRequest
from llm_astar_planner.benchmark.bags.robot_poses import Places
from llm_astar_planner.benchmark.bags.topics import Wanted, missing, parts

ANSWERED = (2, 3)  # event types of service_msgs/ServiceEventInfo: sent and received responses
# Calls remembered, since client and server may both have told of one.
MAX_CALLS = 1000


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
        held = self._parts.values()
        self._listed = deque(sorted(listed, key=lambda item: item.time))
        plans = 'plan' in held or 'plan as request' in held
        self._answers = Answers(int(window * 1e9), plans=plans, reports='report' in held)
        self._places = Places(wanted.base_frame)
        self._grid_map: GridMap | None = None
        self._barriers: BarrierMap | None = None
        self._calls: OrderedDict[Call, None] = OrderedDict()
        self._now = 0
        self._count = 0
        self._noted: set[str] = set()
        self._handlers: dict[str, Callable[[BagMessage], object]] = {
            'map': self._on_map,
            'map update': self._on_update,
            'barriers': self._on_barriers,
            'request': self._on_event,
            'goal': self._on_goal,
            'plan': lambda message: self._answers.take_plan(message.value),
            'plan as request': self._on_plan,
            'report': lambda message: self._answers.take_report(message.value),
            **{
                part: partial(self._places.take, part)
                for part in ('tf', 'static tf', 'odometry', 'start')
            },
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
            yield from self._answers.ready()
        self._ask_listed(None)
        self._answers.give_up()
        yield from self._answers.ready()
        if not self._count:
            self._leave_out('no request in it could be read', 'requests')

    def _advance(self, now: int) -> None:
        """Let the time pass: listed requests are made, waiting ones given up."""
        if now < self._now - JUMP:
            self._jump(self._now - now)
        self._ask_listed(self.bag.seconds(now))
        self._answers.give_up(now)
        self._now = now

    def _jump(self, back: int) -> None:
        self._problems.note(
            f'{self.bag.path}: the clock jumps back by {back / 1e9:.3f} s; what was known of the '
            "robot's place before is forgotten"
        )
        self._places.forget()
        self._answers.give_up()

    def _on_map(self, message: BagMessage) -> None:
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

    def _on_update(self, message: BagMessage) -> None:
        if self._grid_map is None:
            self._leave_out(f'{self._when(message)}: a map update before any map', 'map updates')
            return
        try:
            self._grid_map = updated(self._grid_map, message.value)
        except GridMapError as error:
            self._leave_out(f'{self._when(message)}: a map update, {error}', 'map updates')

    def _on_barriers(self, message: BagMessage) -> None:
        try:
            self._barriers = parse_barrier_map(json.loads(message.value.data), 'its barriers')
        except (BarrierMapError, ValueError, RecursionError) as error:
            self._leave_out(f'{self._when(message)}: {error}', 'barrier maps')

    def _on_event(self, message: BagMessage) -> None:
        """Take a call of GetPlan, or its answer; events without contents tell nothing."""
        event = message.value
        call = (bytes(bytearray(event.info.client_gid)), int(event.info.sequence_number))
        if event.info.event_type in ANSWERED:
            if len(event.response):
                self._answers.take_response(call, event.response[0].plan)
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
        start, goal = self._on_the_map(request.start), self._on_the_map(request.goal)
        self._ask(self._when(message), start, goal, call, float(request.tolerance))

    def _on_goal(self, message: BagMessage) -> None:
        start = self._places.robot(self._frame, message.time)
        self._ask(self._when(message), start, self._on_the_map(message.value))

    def _on_plan(self, message: BagMessage) -> None:
        """Take a path as a request that it answers itself, unless it betters the one before."""
        plan = message.value
        if not len(plan.poses) or self._answers.take_plan(plan):
            return
        start, goal = (
            self._places.on_map(stamped.pose, plan.header.frame_id, self._frame, self._now)
            for stamped in (plan.poses[0], plan.poses[-1])
        )
        self._ask(self._when(message), start, goal)
        self._answers.take_plan(plan)

    def _ask_listed(self, now: float | None) -> None:
        """Make the listed requests whose time has come, all that are left for None."""
        while self._listed and (now is None or self._listed[0].time < now):
            item = self._listed.popleft()
            self._ask(f'listed request {item.number}', item.start, item.goal)

    def _ask(
        self,
        when: str,
        start: Pose2D | str,
        goal: Pose2D | str,
        call: Call | None = None,
        tolerance: float = 0.0,
    ) -> None:
        """Make a request; a pose that is a sentence says why it is none."""
        index, self._count = self._count, self._count + 1
        if self._grid_map is None:
            self._leave_out(f'{when}: a request before the first map', 'requests')
        elif isinstance(start, str):
            self._leave_out(f'{when}: a request whose start {start}', 'requests')
        elif isinstance(goal, str):
            self._leave_out(f'{when}: a request whose goal {goal}', 'requests')
        else:
            barriers = self._fitting_barriers(self._grid_map)
            request = BagRequest(
                index, self._now, start, goal, self._grid_map, barriers, tolerance
            )
            self._answers.wait(request, call)

    def _fitting_barriers(self, grid_map: GridMap) -> BarrierMap | None:
        """Return the barriers told last, if they are those of the map."""
        if self._barriers is None or not _are_of(self._barriers, grid_map):
            return None
        return self._barriers

    @property
    def _frame(self) -> str:
        return '' if self._grid_map is None else self._grid_map.frame_id

    def _on_the_map(self, stamped: Any) -> Pose2D | str:  # noqa: ANN401 - a decoded PoseStamped
        frame = stamped.header.frame_id
        return self._places.on_map(stamped.pose, frame, self._frame, self._now)

    def _note_once(self, kind: str, what: str) -> None:
        if kind not in self._noted:
            self._noted.add(kind)
            self._problems.note(f'{self.bag.path}: {what}')

    def _when(self, message: BagMessage) -> str:
        return f'{message.topic} at {self.bag.seconds(message.time):.3f} s'

    def _leave_out(self, what: str, kind: str) -> None:
        self._problems.leave_out(f'{self.bag.path}: {what}', f'{self.bag.path}: {kind} left out')


@lru_cache(maxsize=1)
def _are_of(barriers: BarrierMap, grid_map: GridMap) -> bool:
    """Tell whether barriers are those of a map; asked once a map, not once a request."""
    return barriers.to_grid(frame_id=grid_map.frame_id).digest == grid_map.digest
