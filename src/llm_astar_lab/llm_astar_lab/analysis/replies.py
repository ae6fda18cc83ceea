# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with the replies of models: each is judged when its row is made, then counted."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

import numpy as np
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.prompts.examples import is_follow_up
from llm_astar_planner.waypoints.prompts.reply_parser import labelled_lists, parse_reply
from llm_astar_planner.waypoints.prompts.template import TEMPLATES, load_template
from llm_astar_planner.waypoints.replay import lattice_of
from llm_astar_planner.waypoints.source import Message, SourceStatus, Waypoint, WaypointReply

from llm_astar_lab.analysis.statistics import Interval, wilson_interval

Route = tuple[Waypoint, ...]
# What the column says of a reply with which nothing is wrong; '' is no reply.
NOTHING_WRONG = 'none'
# What replies are counted by besides their problems.
REPLIES, PARSED, WRONG_ENDS = 'replies', 'parsed', 'wrong_start_or_goal'
# The routes of the examples in the prompts that the paper's authors published, for transcripts
# that others made with these prompts and that keep no messages.
PUBLISHED_PROMPTS = ('few_shot', 'cot', 'repe')
PUBLISHED_ROUTES: tuple[Route, ...] = (
    ((5, 5), (26, 9), (25, 23), (20, 20)), ((2, 3), (11, 6), (18, 8)),
    ((40, 20), (31, 15), (20, 3), (10, 10)), ((4, 4), (16, 16)),
    ((25, 25), (21, 7), (10, 6), (4, 4)),
)  # fmt: skip


# What can be wrong with a reply: it holds no list of points, the list is empty, it ends at the
# token limit, ... There is a barrier between two of its points that are free; its route is that of
# an example in the prompt; an example in the prompt has the start and goal of the sample.
PROBLEMS = (
    'no_list', 'empty', 'cut', 'wrong_start', 'wrong_goal', 'off_map', 'on_obstacle',
    'crosses_barrier', 'example_repeated', 'in_prompt',
)  # fmt: skip


def problems_column(reply: WaypointReply, costmap: Costmap, start: Cell, goal: Cell) -> str:
    """Return what is wrong with a reply to a query from `start` to `goal` (cells).

    These are names of PROBLEMS joined by `;`, about the list of points that counts; '' where no
    model has replied. The end of a reply that was cut is not the goal it would have named.
    """
    if not reply.text and reply.status is not SourceStatus.MALFORMED:
        return ''
    points, is_cut = reply.waypoints, was_cut(reply)
    checks = {
        'no_list': reply.status is SourceStatus.MALFORMED,
        'empty': reply.status is SourceStatus.NO_WAYPOINTS, 'cut': is_cut,
        'wrong_start': bool(points) and points[0] != start,
        'wrong_goal': bool(points) and not is_cut and points[-1] != goal,
        **check_points(points, costmap), **check_examples(reply, costmap, start, goal),
    }  # fmt: skip
    return ';'.join(name for name in PROBLEMS if checks[name]) or NOTHING_WRONG


def was_cut(reply: WaypointReply) -> bool:
    """Tell whether a reply ends at the token limit.

    The server says so; where that was not recorded, an open list that ends within it does.
    """
    if reply.provenance.finish_reason:
        return reply.provenance.finish_reason == 'length'
    opened, closed = (sum(map(reply.text.count, signs)) for signs in ('[({', '])}'))
    return opened > closed


def check_points(points: Sequence[Waypoint], costmap: Costmap) -> dict[str, bool]:
    """Check where points are, in cells, and the straight lines between those on free cells."""
    exact = np.array(points, dtype=float).reshape(-1, 2)
    cells = np.rint(exact)
    height, width = costmap.blocked.shape
    on_map = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    x, y = np.where(on_map[:, None], cells, 0).astype(int).T
    occupied = on_map & costmap.blocked[y, x]
    free = on_map & ~occupied
    lines = np.flatnonzero(free[:-1] & free[1:])
    clear = costmap.line_of_sight.clear(exact[lines], exact[lines + 1])
    return {
        'off_map': bool((~on_map).any()),
        'on_obstacle': bool(occupied.any()),
        'crosses_barrier': not clear.all(),
    }


def check_examples(
    reply: WaypointReply, costmap: Costmap, start: Cell, goal: Cell
) -> dict[str, bool]:
    """Compare a reply and its query with the examples of the prompt, in its coordinates."""
    routes = example_routes(reply.messages, reply.prompt)
    lattice = lattice_of(costmap.grid_map).coarsened(reply.unit)
    ends = lattice.to_lattice(start), lattice.to_lattice(goal)
    return {
        'example_repeated': parse_reply(reply.text) in routes,
        'in_prompt': any((route[0], route[-1]) == ends for route in routes),
    }


@lru_cache(maxsize=8)
def example_routes(messages: tuple[Message, ...], prompt: str) -> frozenset[Route]:
    """Return the routes of the examples in a prompt.

    They are those of the messages; of a prompt whose messages were not recorded, those of our
    template of that name, and of the published one.
    """
    if messages:
        return frozenset(
            route for message in asked_first(messages) for route in routes_in(message)
        )
    name = re.split('[+,]', prompt, maxsplit=1)[0]
    routes = set(PUBLISHED_ROUTES if name in PUBLISHED_PROMPTS else ())
    if name in TEMPLATES:
        routes.update(labelled_lists(load_template(name).text))
    return frozenset(routes)


def asked_first(messages: Sequence[Message]) -> Sequence[Message]:
    """Return the messages before the model's own answers, which follow-ups quote."""
    for number, message in enumerate(messages):
        if message.role == 'user' and is_follow_up(message.content):
            return messages[: max(0, number - 1)]
    return messages


def routes_in(message: Message) -> Sequence[Route]:
    """Return the routes of examples in a message: those with a label, and an answer's."""
    answer = parse_reply(message.content) if message.role == 'assistant' else None
    return labelled_lists(message.content) or ([answer] if answer else [])


def count_problems(column: str) -> Iterator[str]:
    """Yield the names that a reply counts for, by its `reply_problems`.

    Besides its problems these are REPLIES, PARSED, WRONG_ENDS for a wrong start or goal, and
    NOTHING_WRONG. That a sample stands in the prompt is no fault of the reply.
    """
    names = [name for name in column.split(';') if name != NOTHING_WRONG]
    yield from (REPLIES, *names)
    if 'no_list' not in names:
        yield PARSED
    if 'wrong_start' in names or 'wrong_goal' in names:
        yield WRONG_ENDS
    if set(names) <= {'in_prompt'}:
        yield NOTHING_WRONG


def reply_shares(counts: Mapping[str, int]) -> dict[str, Interval]:
    """Return the shares of all replies by the names of `count_problems`, with Wilson intervals."""
    names = (PARSED, *PROBLEMS, WRONG_ENDS, NOTHING_WRONG)
    return {name: wilson_interval(counts.get(name, 0), counts[REPLIES]) for name in names}
