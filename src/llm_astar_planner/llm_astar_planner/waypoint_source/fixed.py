"""A source that answers with one given reply: to try a model's words, or one's own."""

from __future__ import annotations

from dataclasses import dataclass

from llm_astar_planner.prompts.reply import ReplyStatus, parse_reply
from llm_astar_planner.waypoint_source.base import SourceStatus, WaypointQuery, WaypointReply


@dataclass(frozen=True)
class FixedReply:
    """Answers every query with `text`, whose points count from `offset`, the map's (x, y) minimum."""

    text: str
    offset: tuple[int, int] = (0, 0)
    name: str = 'reply'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the points of the text, in grid coordinates."""
        del query
        parsed = parse_reply(self.text)
        status = {
            ReplyStatus.FOUND: SourceStatus.OK,
            ReplyStatus.EMPTY_LIST: SourceStatus.NO_WAYPOINTS,
            ReplyStatus.NO_LIST: SourceStatus.MALFORMED,
        }[parsed.status]
        x_min, y_min = self.offset
        return WaypointReply(
            waypoints=tuple((x - x_min, y - y_min) for x, y in parsed.waypoints),
            label=self.name,
            status=status,
            detail='the reply holds no list of points' if status is SourceStatus.MALFORMED else '',
            text=self.text,
        )
