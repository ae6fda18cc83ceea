# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Requests of a bag, each on the map of its time, and exchanges with models as a transcript.

Messages are read one by one. Only the current map, the newest poses and transforms, and the
requests that wait for their recorded plan are kept.
"""

import json
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import parse_json, read_yaml
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, parse_barrier_map
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.messages import fields
from llm_astar_msgs_adapter.messages.fields import grid_from_message, pose_from_message, updated
from llm_astar_msgs_adapter.messages.transforms import Transforms, flat_pose, moved
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter, parse_exchange

from llm_astar_lab.bags.reading import JUMP, Bag, BagMessage
from llm_astar_lab.bags.storage import BagError
from llm_astar_lab.bags.types import MAP
from llm_astar_lab.evaluation.recorded_plans import BagRequest, Call, PendingRequests
from llm_astar_lab.templates import render

TOPICS = read_yaml(Path(__file__).with_name('topics.yaml'), BagError)
GRID = TOPICS['by_name']['map'][0]
# Where requests come from: the role of such topics, and a description for error messages.
REQUEST_ROLES = {
    'service': ('request', 'events of GetPlan (service introspection)'),
    'goals': ('goal', 'goals on goal_pose'),
    'plans': ('plan as request', "paths of the robot's own"),
}
REQUEST_KINDS = ('auto', *REQUEST_ROLES)


@dataclass(frozen=True)
class TopicSelection:
    """Which topics to read, and which requests: a member of REQUEST_KINDS.

    `namespace` is the robot's where a bag has several, '' or beginning with a slash. A topic that
    is '' is the default one in that namespace. `base_frame` is the robot's frame in tf. `plans`
    makes each recorded path a request from its first pose to its last; `auto` does so where the
    bag has neither calls nor goals.
    """

    namespace: str = ''
    map_topic: str = ''
    plan_topic: str = ''
    odom_topic: str = ''
    requests: str = 'auto'
    base_frame: str = 'base_link'

    @property
    def map(self) -> str:
        """The topic of the map."""
        return self.map_topic or f'{self.namespace}{MAP}'

    @property
    def plan(self) -> str:
        """The topic of the robot's own plans."""
        return self.plan_topic or f'{self.namespace}/plan'

    def named_topics(self) -> Iterable[tuple[str, str, str]]:
        """Yield role, name and message type of each topic that is known by name."""
        names = {'own': self.namespace, 'map': self.map, 'plan': self.plan}
        names['odometry'] = self.odom_topic or f'{self.namespace}/odom'
        for role, (msgtype, *topics) in TOPICS['by_name'].items():
            if self.requests in ('auto', 'goals') or role not in ('goal', 'start'):
                yield from ((role, topic.format(**names), msgtype) for topic in topics)


def topic_roles(bag: Bag, selection: TopicSelection) -> dict[str, str]:
    """Return the role of each topic that is used, by topic.

    A topic that has the name but not the type of a role is named in the bag's problems.
    """
    roles: dict[str, str] = {}
    for role, name, msgtype in selection.named_topics():
        topic = bag.topics.get(name)
        if topic is not None and topic.msgtype == msgtype:
            roles[name] = role
        elif topic is not None:
            bag.problems.leave_out(f'{bag.path}: {name} is a {topic.msgtype}, not a {msgtype}')
    for name, topic in bag.topics.items():
        for role, (msgtype, ending) in TOPICS['by_ending'].items():
            fits = topic.msgtype == msgtype and name.endswith(ending)
            used = role != 'request' or selection.requests in ('auto', 'service')
            if fits and used and name.startswith(f'{selection.namespace}/'):
                roles[name] = role
    neither = selection.requests == 'auto' and not recorded_roles(bag, roles) & {'request', 'goal'}
    plan = selection.plan
    if roles.get(plan) == 'plan' and (neither or selection.requests == 'plans'):
        roles[plan] = 'plan as request'
        if neither and bag.topics[plan].count:
            why = 'it has neither calls nor goals, and the goals of actions are not recorded'
            what = f'each path on {plan} is a request, from its first pose to its last'
            bag.problems.note(f'{bag.path}: {why}: {what}')
    return roles


def recorded_roles(bag: Bag, roles: Mapping[str, str]) -> set[str]:
    """Return the roles of the topics that have messages."""
    return {role for name, role in roles.items() if bag.topics[name].count}


def find_missing(bag: Bag, roles: Mapping[str, str], selection: TopicSelection) -> str | None:
    """Say why a bag cannot be evaluated at all; None where it can."""
    recorded = recorded_roles(bag, roles)
    if 'map' not in recorded:
        grids = [name for name, topic in bag.topics.items() if topic.msgtype == GRID]
        hint = f'; name one with --map-topic: {", ".join(grids)}' if grids else ''
        return f'{bag.path}: no map: there is no {GRID} on {selection.map}{hint}'
    chosen = REQUEST_ROLES.get(selection.requests)
    sources = [chosen] if chosen else list(REQUEST_ROLES.values())
    if not recorded & {role for role, _ in sources}:
        none = ' and no '.join(name for _, name in sources)
        return f'{bag.path}: no requests: it has no {none}'
    return None


def describe(bag: Bag, selection: TopicSelection) -> dict[str, Any]:
    """Return a bag's contents: times in seconds since 1970, topics, and the role of each."""
    roles = topic_roles(bag, selection)
    topics = [
        {'name': name, 'type': topic.msgtype, 'count': topic.count, 'part': roles.get(name, '')}
        for name, topic in sorted(bag.topics.items())
    ]
    return {
        'bag': bag.name, 'path': str(bag.path), 'start': bag.start / 1e9,
        'seconds': bag.seconds(bag.end),
        'messages': sum(topic.count for topic in bag.topics.values()), 'topics': topics,
        'missing': find_missing(bag, roles, selection) or '', 'notes': bag.problems.notes,
        'left_out': bag.problems.lines(),
    }  # fmt: skip


def describe_text(contents: Mapping[str, Any]) -> str:
    """Return what `describe` found as lines for a person."""
    topics = contents['topics']
    widths = [max((len(one[name]) for one in topics), default=0) for name in ('name', 'type')]
    return render('evaluation/contents.txt.j2', **contents, widths=widths).rstrip('\n')


# The event types of service_msgs/ServiceEventInfo with a response: sent and received.
RESPONSES = (2, 3)
# How many calls are remembered, since both client and server may publish an event of one.
MAX_CALLS = 1000
# What a message may raise whose type the bag defines otherwise than ROS does.
UNFIT = (AttributeError, TypeError, ValueError, LookupError, OverflowError)
# Roles of the topics with the robot's pose, besides tf, and their names; the better one first.
POSE_ROLES = {'odometry': 'odometry', 'start': 'amcl_pose or initialpose'}
# What a message with a role is called, where that is not the role.
NAMES = {'barriers': 'barrier map'}
ROLES_OF_POSES = ('tf', 'static tf', *POSE_ROLES)

# A decoded geometry_msgs/Pose with its frame, or None for the robot's.
Place = tuple[Any, str] | None


class PoseError(LlmAstarError, ValueError):
    """A pose that is not known on the map; the message says which pose, and why."""


class RobotPoseTracker:
    """Keeps the newest transforms, odometry, and pose from amcl_pose or initialpose."""

    def __init__(self, base_frame: str) -> None:
        """Begin without poses; `base_frame` is the robot's frame in tf."""
        self._base_frame = base_frame
        self._transforms = Transforms()
        self._latest: dict[str, BagMessage] = {}

    def take(self, role: str, message: BagMessage) -> None:
        """Take a message of the role `tf`, `static tf`, `odometry` or `start`."""
        if role in ('tf', 'static tf'):
            self._transforms.add(message.value, message.time, static=role == 'static tf')
        else:
            self._latest[role] = message

    def forget(self) -> None:
        """Forget all but static transforms, for when the clock jumps."""
        self._transforms.forget_moving()
        self._latest.clear()

    def to_map(self, pose: Any, frame: str, map_frame: str, now: int, name: str) -> Pose2D:  # noqa: ANN401
        """Return a decoded pose in the map's frame. An empty frame means the map's.

        Raises PoseError, which begins with `name`.
        """
        try:
            own = pose_from_message(pose)
        except GridMapError as error:
            raise PoseError(f'{name} cannot be used ({error})') from None
        if frame in ('', map_frame):
            return own
        transform = self._transforms.lookup(map_frame, frame, now)
        if transform is None:
            frames = f'frame {frame!r}, the map in {map_frame!r}'
            raise PoseError(f'{name} is in {frames}, and no tf joins them')
        return moved(own, transform)

    def robot(self, map_frame: str, now: int) -> Pose2D:
        """Return the robot's pose by tf, else by odometry, else by amcl_pose or initialpose.

        Raises PoseError, which begins with `start`.
        """
        transform = self._transforms.lookup(map_frame, self._base_frame, now)
        if transform is not None:
            return flat_pose(transform)
        problems = [f'no tf from {map_frame} to {self._base_frame}']
        for role, name in POSE_ROLES.items():
            if role not in self._latest:
                problems.append(f'no {name} yet')
                continue
            value = self._latest[role].value
            try:
                return self.to_map(value.pose.pose, value.header.frame_id, map_frame, now, name)
            except PoseError as error:
                problems.append(str(error))
        raise PoseError(f'start is not known: {"; ".join(problems)}')


class RequestReader:
    """Reads the requests of one bag."""

    def __init__(self, bag: Bag, selection: TopicSelection, window: float) -> None:
        """Take an open bag; a recorded plan may come `window` seconds after its request."""
        self.bag = bag
        self._roles = topic_roles(bag, selection)
        self._missing = find_missing(bag, self._roles, selection)
        self._pending = PendingRequests(int(window * 1e9), self._roles.values())
        self._poses = RobotPoseTracker(selection.base_frame)
        self._grid_map: GridMap | None = None
        self._barriers: BarrierMap | None = None
        self._calls: deque[Call] = deque(maxlen=MAX_CALLS)
        self._now = 0
        self._count = 0
        self._handlers: dict[str, Callable[[BagMessage], object]] = {
            'map': self._on_map, 'map update': self._on_update, 'barriers': self._on_barriers,
            'request': self._on_event, 'goal': self._on_goal,
            'plan': lambda message: self._pending.take_plan(message.value),
            'plan as request': self._on_plan,
            'report': lambda message: self._pending.take_report(message.value),
            **{role: partial(self._poses.take, role) for role in ROLES_OF_POSES},
        }  # fmt: skip

    def requests(self) -> Iterator[BagRequest]:
        """Yield the requests in the order they were made, each when its plan is known."""
        if self._missing:
            self.bag.problems.leave_out(self._missing)
            return
        topics = [name for name, role in self._roles.items() if role in self._handlers]
        for message in self.bag.messages(topics):
            self._advance(message.time)
            role = self._roles[message.topic]
            try:
                self._handlers[role](message)
            except LlmAstarError as error:
                what = NAMES.get(role, role)
                self._leave_out(f'{self._when(message)}: a {what} is refused, {error}', f'{what}s')
            except UNFIT as error:
                # The bag may define a type with other fields, or with numbers beyond all use.
                what = f'is not what a {message.msgtype} holds: {type(error).__name__}: {error}'
                self._leave_out(f'{self._when(message)}: {what}', 'messages')
            yield from self._pending.pop_ready()
        self._pending.expire()
        yield from self._pending.pop_ready()
        if not self._count:
            self._leave_out('no request in it could be read', 'requests')

    def _advance(self, now: int) -> None:
        """Set the time, and expire waiting requests."""
        if now < self._now - JUMP:
            jump = f'the clock jumps back by {(self._now - now) / 1e9:.3f} s'
            what = "what was known of the robot's pose before is forgotten"
            self.bag.problems.note(f'{self.bag.path}: {jump}; {what}')
            self._poses.forget()
            self._pending.expire()
        self._pending.expire(now)
        self._now = now

    def _on_map(self, message: BagMessage) -> None:
        self._grid_map = grid_from_message(message.value)

    def _on_update(self, message: BagMessage) -> None:
        if self._grid_map is None:
            raise GridMapError('map', 'none came before it')
        self._grid_map = updated(self._grid_map, message.value)

    def _on_barriers(self, message: BagMessage) -> None:
        self._barriers = parse_barrier_map(parse_json(message.value.data), 'its barriers')

    def _on_event(self, message: BagMessage) -> None:
        """Take a call of GetPlan or its response. Events without contents are left out."""
        event = message.value
        call = (bytes(bytearray(event.info.client_gid)), int(event.info.sequence_number))
        if event.info.event_type in RESPONSES:
            if len(event.response):
                self._pending.take_response(call, event.response[0].plan)
            return
        if call in self._calls:
            return
        if not len(event.request):
            fix = 'set service introspection to `contents` to record requests'
            what = f'{message.topic}: its events are without contents; {fix}'
            self.bag.problems.leave_out(f'{self.bag.path}: {what}')
            return
        self._calls.append(call)
        request = event.request[0]
        start, goal = ((end.pose, end.header.frame_id) for end in (request.start, request.goal))
        self._make_request(self._when(message), start, goal, call, float(request.tolerance))

    def _on_goal(self, message: BagMessage) -> None:
        goal = message.value
        self._make_request(self._when(message), None, (goal.pose, goal.header.frame_id))

    def _on_plan(self, message: BagMessage) -> None:
        """Make a request of a path, unless the path improves the one before."""
        plan = message.value
        if not len(plan.poses) or self._pending.take_plan(plan):
            return
        start, goal = ((plan.poses[end].pose, plan.header.frame_id) for end in (0, -1))
        self._make_request(self._when(message), start, goal)
        self._pending.take_plan(plan)

    def _make_request(
        self,
        when: str,
        start: Place,
        goal: Place,
        call: Call | None = None,
        tolerance: float = 0.0,
    ) -> None:
        """Make a request on the current map, or say why that is not possible."""
        made = (self.bag.name, self._count, self._now)
        self._count += 1
        grid_map = self._grid_map
        if grid_map is None:
            self._leave_out(f'{when}: a request before the first map', 'requests')
            return
        try:
            poses = self._to_map(start, 'start', grid_map), self._to_map(goal, 'goal', grid_map)
        except PoseError as error:
            self._leave_out(f'{when}: a request whose {error}', 'requests')
            return
        barriers = self._barriers
        if barriers is not None and not are_barriers_of(barriers, grid_map):
            barriers = None
        self._pending.add(BagRequest(*made, *poses, grid_map, barriers, tolerance, call))

    def _to_map(self, place: Place, name: str, grid_map: GridMap) -> Pose2D:
        if place is None:
            return self._poses.robot(grid_map.frame_id, self._now)
        return self._poses.to_map(*place, grid_map.frame_id, self._now, name)

    def _when(self, message: BagMessage) -> str:
        return f'{message.topic} at {self.bag.seconds(message.time):.3f} s'

    def _leave_out(self, what: str, kind: str) -> None:
        path = self.bag.path
        self.bag.problems.leave_out(f'{path}: {what}', f'{path}: {kind} left out')


@lru_cache(maxsize=1)
def are_barriers_of(barriers: BarrierMap, grid_map: GridMap) -> bool:
    """Tell whether a map was made from barriers; the last answer is kept for the next request."""
    return barriers.to_grid(frame_id=grid_map.frame_id).digest == grid_map.digest


def write_exchanges(bags: Sequence[Bag], selection: TopicSelection, transcript: Path) -> int:
    """Write every exchange in bags to a new transcript, in their order; return their number.

    Raises TranscriptError or OSError where the file cannot be written.
    """
    transcript.unlink(missing_ok=True)
    writer = TranscriptWriter(transcript)
    count = 0
    for bag in bags:
        roles = topic_roles(bag, selection)
        for message in bag.messages([name for name, role in roles.items() if role == 'exchange']):
            exchange = exchange_from_values(fields.values_of_report(message.value))
            if exchange is not None:
                writer.write(exchange.to_json())
                count += 1
    return count


def exchange_from_values(values: Mapping[str, Any]) -> Exchange | None:
    """Make an exchange of a message's values; None where they are not those of an exchange."""
    try:
        response, unit = response_of(values)
        messages = [{'role': role, 'content': text} for role, text in values['messages']]
        own = {'response': response, 'unit': unit, 'messages': messages}
        return parse_exchange({**values, 'map': values['map_digest'], 'scale': 1, **own})
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def response_of(values: Mapping[str, Any]) -> tuple[str, int]:
    """Return the reply's text, and how many cells one step of its coordinates is.

    The message has the waypoints too. Where the text does not give the same ones, since it was
    cut, is in other units, or the source has no text, the response is their list in cells.
    """
    text, unit = str(values['text']), int(values['unit'])
    points = tuple((float(x), float(y)) for x, y in values['waypoints'])
    if not points or (unit == 1 and read_answer(text).waypoints == points):
        return text, unit
    return json.dumps(points), 1
