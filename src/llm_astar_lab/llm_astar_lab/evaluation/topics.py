# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Which topics of a bag an evaluation uses, and the role of each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.files import read_yaml

from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.storage import BagError
from llm_astar_lab.bags.types import MAP
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
    """Which topics to read, and which requests: a member of REQUEST_KINDS, or `list` for a file's.

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
    if selection.requests != 'list' and not recorded & {role for role, _ in sources}:
        none = ' and no '.join(name for _, name in sources)
        return f'{bag.path}: no requests: it has no {none}; a file of them goes to --requests'
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
