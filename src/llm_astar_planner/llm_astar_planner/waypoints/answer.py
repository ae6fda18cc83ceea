"""What a model's text says: its waypoints, or why there are none."""

from __future__ import annotations

from typing import NamedTuple

from llm_astar_planner.waypoints.prompts.reply_parser import parse_reply
from llm_astar_planner.waypoints.source import SourceStatus, Waypoint


class Answer(NamedTuple):
    """The points a model wrote, in the coordinates of its prompt, or why there are none."""

    waypoints: tuple[Waypoint, ...]
    status: SourceStatus
    detail: str


def read_answer(text: str) -> Answer:
    """Parse a model's text: OK with points, NO_WAYPOINTS for an empty list, else MALFORMED."""
    points = parse_reply(text)
    if points:
        return Answer(points, SourceStatus.OK, '')
    if points is not None:
        return Answer((), SourceStatus.NO_WAYPOINTS, 'the model answered with an empty list')
    if not text.strip():
        return Answer((), SourceStatus.MALFORMED, 'the reply is empty')
    return Answer((), SourceStatus.MALFORMED, 'no list of points in the reply')
