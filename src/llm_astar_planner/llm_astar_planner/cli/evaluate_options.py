"""The options of `llm-astar evaluate`: what of bags is taken, and by which rules it is planned."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from llm_astar_planner.benchmark.bags.requests import ListedRequest, load_requests
from llm_astar_planner.benchmark.bags.topics import REQUEST_KINDS, TopicSelection
from llm_astar_planner.cli.parameter_flags import (
    add_parameter_flags,
    add_params_file_flag,
    given_values,
    read_params_files,
)
from llm_astar_planner.planning.parameters import COSTMAP, REQUESTS, SEARCH, defaults

# The rules that have flags of their own; the search has the flags of `bench`.
RULES = (
    *COSTMAP,
    *(
        item
        for item in REQUESTS
        if item.name in ('tolerance', 'start_tolerance', 'robot_base_frame')
    ),
)
# What a parameter file may say of the search, by the names of this command's options.
SEARCH_OPTIONS = {
    'heuristic': 'heuristic',
    'weight': 'weight',
    'max_suboptimality': 'max_suboptimality',
    'max_planning_time': 'time_limit',
}


def add_input(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add what is taken of bags."""
    group.add_argument('--list', action='store_true', help='only show what the bags offer')
    group.add_argument(
        '--namespace', default='', metavar='NAME', help='the robot, where a bag has several'
    )
    group.add_argument('--map-topic', default='', metavar='TOPIC', help='(/map)')
    group.add_argument(
        '--plan-topic', default='', metavar='TOPIC', help="where the robot's own plans are (/plan)"
    )
    group.add_argument(
        '--odom-topic',
        default='',
        metavar='TOPIC',
        help='where goals start without tf from map to base_link (/odom)',
    )
    group.add_argument(
        '--requests',
        default='auto',
        metavar='WHAT',
        help="service: calls of GetPlan; goals: goal_pose; plans: the robot's own paths, from "
        'first to last pose; auto: service and goals, or plans where there are neither; or a csv '
        'or json FILE of start_x, start_y, goal_x, goal_y in metres and time in seconds (auto)',
    )
    group.add_argument(
        '--plan-window',
        type=float,
        default=10.0,
        metavar='SECONDS',
        help='how long after a request its recorded plan may come (10)',
    )
    group.add_argument(
        '--results-bag', metavar='DIR', help='also write the plans and reports into this new bag'
    )


def add_rules(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the rules of planner_node, by the names of its parameters."""
    add_params_file_flag(group)
    add_parameter_flags(group, RULES)


def wanted_of(args: argparse.Namespace) -> tuple[TopicSelection, Sequence[ListedRequest]]:
    """Return what is taken, and the requests of a file. Raises ValueError."""
    listed: Sequence[ListedRequest] = ()
    requests = args.requests
    if requests not in REQUEST_KINDS:
        listed, requests = load_requests(requests), 'list'
    if not args.plan_window >= 0.0:
        message = f'--plan-window {args.plan_window} is not 0 seconds or more'
        raise ValueError(message)
    namespace = args.namespace.strip('/')
    wanted = TopicSelection(
        f'/{namespace}' if namespace else '',
        args.map_topic,
        args.plan_topic,
        args.odom_topic,
        requests,
    )
    return wanted, listed


def rules_given(args: argparse.Namespace) -> dict[str, Any]:
    """Return the rules given, by the file and over it by options; put the file's search in place.

    With a file the node's defaults hold where it says nothing. An option of the search counts as
    given where it is not what it is without being named.
    """
    given: dict[str, Any] = {}
    if args.params_file:
        given = read_params_files(args).values['planner_node']
        search = defaults((*SEARCH, *REQUESTS)) | given
        for name, own in SEARCH_OPTIONS.items():
            if getattr(args, own) == args.unnamed[own]:
                setattr(args, own, search[name] or None)
        if args.methods == args.unnamed['methods']:
            args.methods = [search['method']]
    names = {item.name for item in RULES}
    rules = {name: value for name, value in given.items() if name in names}
    return rules | given_values(args, RULES)
