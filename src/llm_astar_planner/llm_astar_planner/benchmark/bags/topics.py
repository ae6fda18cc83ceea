"""What of a bag an evaluation takes: which topic plays which part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.bags.messages import BARRIER_MAP, MAP
from llm_astar_msgs_adapter.bags.reading import Bag

GRID, UPDATE = 'nav_msgs/msg/OccupancyGrid', 'map_msgs/msg/OccupancyGridUpdate'
EVENT, PATH = 'nav_msgs/srv/GetPlan_Event', 'nav_msgs/msg/Path'
POSE, POSE_GUESS = 'geometry_msgs/msg/PoseStamped', 'geometry_msgs/msg/PoseWithCovarianceStamped'
ODOMETRY, TF, TEXT = 'nav_msgs/msg/Odometry', 'tf2_msgs/msg/TFMessage', 'std_msgs/msg/String'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
SERVICE = '/get_plan/_service_event'
# What requests may be taken from: the part that tells them, and its name for people.
ASKING = {
    'service': ('request', 'events of GetPlan (service introspection)'),
    'goals': ('goal', 'goals on goal_pose'),
    'plans': ('plan as request', "paths of the robot's own"),
}
REQUESTS = ('auto', *ASKING)


@dataclass(frozen=True)
class Wanted:
    """Which topics to take, and which requests: a member of REQUESTS, or `list` for a file's.

    `namespace` is the robot's where a bag has several, '' or beginning with a slash; a topic that
    is '' is the namespace's own. `base_frame` is the robot's in tf. Plans are requests, each from
    its first pose to its last, where that is wanted, and by `auto` where neither calls nor goals
    are in the bag.
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


def parts(bag: Bag, wanted: Wanted) -> dict[str, str]:
    """Return the part each topic of a bag plays, by topic; topics without one are left out.

    What has the name but not the type of a part is said in the bag's problems.
    """
    found: dict[str, str] = {}
    for part, name, msgtype in _named(wanted):
        topic = bag.topics.get(name)
        if topic is None:
            continue
        if topic.msgtype == msgtype:
            found[name] = part
        else:
            bag.problems.leave_out(f'{bag.path}: {name} is a {topic.msgtype}, not a {msgtype}')
    for name, topic in bag.topics.items():
        part = _by_ending(name, topic.msgtype) if name.startswith(f'{wanted.namespace}/') else ''
        if part and (part != 'request' or wanted.requests in ('auto', 'service')):
            found[name] = part
    untold = wanted.requests == 'auto' and not _held(bag, found) & {'request', 'goal'}
    if found.get(wanted.plan) == 'plan' and (untold or wanted.requests == 'plans'):
        found[wanted.plan] = 'plan as request'
        if untold and bag.topics[wanted.plan].count:
            bag.problems.note(
                f'{bag.path}: neither calls nor goals are in it, and actions do not tell theirs: '
                f'each path on {wanted.plan} is a request, from its first pose to its last'
            )
    return found


def _held(bag: Bag, found: Mapping[str, str]) -> set[str]:
    """Return the parts there are messages of."""
    return {part for name, part in found.items() if bag.topics[name].count}


def _named(wanted: Wanted) -> Iterable[tuple[str, str, str]]:
    own = wanted.namespace
    yield 'map', wanted.map, GRID
    yield 'map update', f'{wanted.map}_updates', UPDATE
    yield 'barriers', BARRIER_MAP, TEXT
    yield 'plan', wanted.plan, PATH
    yield 'odometry', wanted.odom_topic or f'{own}/odom', ODOMETRY
    if wanted.requests in ('auto', 'goals'):
        yield 'goal', f'{own}/goal_pose', POSE
        yield 'start', f'{own}/initialpose', POSE_GUESS
        yield 'start', f'{own}/amcl_pose', POSE_GUESS
    for prefix in dict.fromkeys(('', own)):
        yield 'tf', f'{prefix}/tf', TF
        yield 'static tf', f'{prefix}/tf_static', TF


def _by_ending(name: str, msgtype: str) -> str:
    if msgtype == EVENT and name.endswith(SERVICE):
        return 'request'
    if msgtype == DIAGNOSTICS and name.endswith('/report'):
        return 'report'
    if msgtype == DIAGNOSTICS and name.endswith('/exchange'):
        return 'exchange'
    return ''


def missing(bag: Bag, found: Mapping[str, str], wanted: Wanted) -> str:
    """Say what keeps a bag from being evaluated at all, or ''."""
    held = _held(bag, found)
    if 'map' not in held:
        grids = [name for name, topic in bag.topics.items() if topic.msgtype == GRID]
        hint = f'; name one with --map-topic: {", ".join(grids)}' if grids else ''
        return f'{bag.path}: no map: there is no {GRID} on {wanted.map}{hint}'
    sought = [ASKING[wanted.requests]] if wanted.requests in ASKING else ASKING.values()
    if wanted.requests != 'list' and not held & {part for part, _ in sought}:
        none = ' and no '.join(name for _, name in sought)
        return f'{bag.path}: no requests: it has no {none}; a file of them goes to --requests'
    return ''


def describe(bag: Bag, wanted: Wanted) -> dict[str, Any]:
    """Return what a bag offers: times in seconds since 1970, topics, and each one's part."""
    found = parts(bag, wanted)
    topics = [
        {'name': t.name, 'type': t.msgtype, 'count': t.count, 'part': found.get(t.name, '')}
        for t in sorted(bag.topics.values(), key=lambda topic: topic.name)
    ]
    return {
        'bag': bag.name,
        'path': str(bag.path),
        'start': bag.start / 1e9,
        'seconds': bag.seconds(bag.end),
        'messages': sum(topic.count for topic in bag.topics.values()),
        'topics': topics,
        'missing': missing(bag, found, wanted),
        'notes': bag.problems.notes,
        'left_out': bag.problems.lines(),
    }


def describe_text(offer: Mapping[str, Any]) -> str:
    """Write what a bag offers for a person."""
    head = f'{offer["path"]}: {offer["messages"]} messages in {offer["seconds"]:.3f} s'
    width = max((len(topic['name']) for topic in offer['topics']), default=0)
    kinds = max((len(topic['type']) for topic in offer['topics']), default=0)
    lines = [
        f'  {topic["name"]:<{width}}  {topic["type"]:<{kinds}}  {topic["count"]:>8}'
        f'  {topic["part"]}'.rstrip()
        for topic in offer['topics']
    ]
    said = [*offer['notes'], *offer['left_out'], offer['missing']]
    return '\n'.join([head, *lines, *(line for line in said if line)])
