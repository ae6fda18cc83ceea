# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Parse the list of points in a model's reply, in any of the forms that models use.

Nothing is evaluated: numbers are recognised as text, everything else is skipped. The last list
of points is the answer, because models draft, quote and think before they conclude.
"""

import re
from typing import NamedTuple

from llm_astar_planner.waypoints.source import SourceStatus, Waypoint, WaypointReply

MAX_WAYPOINTS = 64
MAX_REPLY_CHARS = 65536

# In these patterns no text matches in two ways: backtracking would try them all.
_NUMBER = r'[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?'
# The smallest bracket groups: [5, 5], (5, 5), [10, 0, 25], [], {"x": 5, "y": 5}.
_ITEM = re.compile(r'[\[(][^\[\](){}]{0,80}[\])]|\{[^\[\](){}]{0,200}\}')
_PAIR = re.compile(
    rf'[\[(]\s*(?:"?x"?\s*[:=]\s*)?["\']?({_NUMBER})["\']?\s*[,;]'
    rf'\s*(?:"?y"?\s*[:=]\s*)?["\']?({_NUMBER})["\']?\s*(,\s*{_NUMBER}\s*)?(?:,\s*)?[\])]',
    re.IGNORECASE,
)
_OBJECT_X = re.compile(rf'["\']?\bx["\']?\s*[:=]\s*["\']?({_NUMBER})', re.IGNORECASE)
_OBJECT_Y = re.compile(rf'["\']?\by["\']?\s*[:=]\s*["\']?({_NUMBER})', re.IGNORECASE)
# What may stand between two points of one list: punctuation, arrows, numbering, comments.
_BETWEEN = re.compile(
    r'(?:[\s,;|>*\-\u2022\u2013\u2014\u2192=]|\d+[.)]|(?:#|//)[^\n]*(?:\n|\Z)|\b(?:to|then|and)\b)*',
    re.IGNORECASE,
)
_PATH_LABEL = re.compile(
    r'(?:path|waypoints|points|route)["\'*`_\s]*[:=][\s"\'*`]{0,8}$', re.IGNORECASE
)
_SELECTED = re.compile(
    r'(?:selected\s+point|"(?:point|coordinates))["\'*`_\s]*[:=][\s"\'*`]{0,8}$', re.IGNORECASE
)
# A reply that is an empty list, and nothing else.
_EMPTY = re.compile(r'(?:```\w*)?\s*\[\s*\](?:\s*```)?')
_FULL_WIDTH = str.maketrans(
    {'\uff0c': ',', '\uff08': '(', '\uff09': ')', '\uff1a': ':', '\u2212': '-'}
)
# Farther than any map reaches, and still exact as a count of cells.
_FARTHEST = 1e12


class BracketGroup(NamedTuple):
    """A pair of brackets or braces in the text, and the point in it if it holds one."""

    start: int
    end: int
    point: Waypoint | None
    is_triple: bool = False
    is_empty: bool = False


class GroupRun(NamedTuple):
    """Consecutive bracket groups with nothing but separators between them."""

    items: list[BracketGroup]
    is_nested: bool
    is_labelled: bool

    @property
    def waypoints(self) -> list[Waypoint]:
        """The points of the groups that hold one."""
        return [item.point for item in self.items if item.point is not None]

    @property
    def is_barrier_list(self) -> bool:
        """Whether it repeats the barriers: three numbers each, and not called the path."""
        return not self.is_labelled and all(item.is_triple for item in self.items)


def parse_reply(text: str) -> tuple[Waypoint, ...] | None:
    """Return the last list of points in `text`; empty for an empty list, None for no list.

    The points are in the reply's order and in the coordinates of the prompt, not yet checked; at
    most MAX_WAYPOINTS, all finite. Only the last MAX_REPLY_CHARS characters are read. Never
    raises; linear in the text's length.
    """
    text = text[-MAX_REPLY_CHARS:].translate(_FULL_WIDTH)
    _, closed, conclusion = text.rpartition('</think>')
    for part in (conclusion, text) if closed else (text,):
        found = points_in_text(part)
        if found is not None:
            return tuple(found[:MAX_WAYPOINTS])
    return None


def labelled_lists(text: str) -> list[tuple[Waypoint, ...]]:
    """Return every list of two or more points that a label such as `Generated Path:` introduces.

    Reads as much of `text` as `parse_reply` does.
    """
    text = text[-MAX_REPLY_CHARS:].translate(_FULL_WIDTH)
    runs = group_runs(text)
    return [tuple(run.waypoints) for run in runs if run.is_labelled and len(run.waypoints) > 1]


def points_in_text(text: str) -> list[Waypoint] | None:
    """Return the last list of points, else the selected points, else the last bare run."""
    if _EMPTY.fullmatch(text.strip()):
        return []
    runs = group_runs(text)
    for run in reversed(runs):
        if (run.is_nested or run.is_labelled) and not run.is_barrier_list:
            if run.waypoints:
                return run.waypoints
            if run.is_labelled and all(item.is_empty for item in run.items):
                return []
    selected = [
        item.point
        for run in runs
        for item in run.items
        if item.point is not None and _SELECTED.search(text[max(0, item.start - 40) : item.start])
    ]
    if selected:
        return selected
    for run in reversed(runs):
        if len(run.waypoints) > 1 and not run.is_barrier_list:
            return run.waypoints
    return None


def bracket_group(match: re.Match[str]) -> BracketGroup:
    """Return the bracket group of a match, with its point if it holds one."""
    start, end, group = match.start(), match.end(), match.group()
    if group[0] == '{':
        x, y = _OBJECT_X.search(group), _OBJECT_Y.search(group)
        return BracketGroup(start, end, make_point(x[1], y[1]) if x and y else None)
    pair = _PAIR.fullmatch(group)
    if pair:
        return BracketGroup(start, end, make_point(pair[1], pair[2]), pair[3] is not None)
    return BracketGroup(start, end, None, is_empty=not group[1:-1].strip())


def group_runs(text: str) -> list[GroupRun]:
    """Return the bracket groups of a text, split where other text stands between them."""
    runs: list[list[BracketGroup]] = []
    for item in map(bracket_group, _ITEM.finditer(text)):
        if runs and _BETWEEN.fullmatch(text, runs[-1][-1].end, item.start):
            runs[-1].append(item)
        else:
            runs.append([item])
    return [make_run(text, run) for run in runs]


def make_run(text: str, items: list[BracketGroup]) -> GroupRun:
    """Return a run, and whether an outer bracket or a label such as `Path:` precedes it."""
    before = text[max(0, items[0].start - 80) : items[0].start]
    outside = before.rstrip().rstrip('[({').rstrip()
    is_nested = outside != before.rstrip()
    # The label stands before the outer brackets: `Path: [[5, 5]]`, `Path: [5, 5] -> ...`.
    return GroupRun(items, is_nested, bool(_PATH_LABEL.search(outside + ' ')))


def make_point(x: str, y: str) -> Waypoint | None:
    """Return the point of two numbers, None if it is out of range."""
    point = float(x), float(y)
    return point if all(abs(value) <= _FARTHEST for value in point) else None


def read_answer(text: str) -> WaypointReply:
    """Return a reply with the points of a model's text, in the coordinates of its prompt.

    OK with points, NO_WAYPOINTS for an empty list, else MALFORMED with the reason.
    """
    points = parse_reply(text)
    if points:
        return WaypointReply(points, text=text)
    status, detail = SourceStatus.MALFORMED, 'no list of points in the reply'
    if points is not None:
        status, detail = SourceStatus.NO_WAYPOINTS, 'the model answered with an empty list'
    elif not text.strip():
        detail = 'the reply is empty'
    return WaypointReply(status=status, detail=detail, text=text)
