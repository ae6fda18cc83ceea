"""What the text of a model means as a reply."""

from __future__ import annotations

from typing import NamedTuple

from llm_astar_planner.waypoints.prompts.reply_parser import ReplyStatus, parse_reply
from llm_astar_planner.waypoints.source import SourceStatus, Waypoint


class Answer(NamedTuple):
    """The points a model wrote, in the coordinates it was asked in."""

    waypoints: tuple[Waypoint, ...]
    status: SourceStatus
    detail: str


def read_answer(text: str) -> Answer:
    """Parse a model's text: OK with points, NO_WAYPOINTS for an empty list, else MALFORMED."""
    parsed = parse_reply(text)
    if parsed.status is ReplyStatus.FOUND:
        return Answer(parsed.waypoints, SourceStatus.OK, '')
    if parsed.status is ReplyStatus.EMPTY_LIST:
        return Answer((), SourceStatus.NO_WAYPOINTS, 'the model answered with an empty list')
    if not text.strip():
        return Answer((), SourceStatus.MALFORMED, 'the reply is empty')
    return Answer((), SourceStatus.MALFORMED, 'no list of points in the reply')
