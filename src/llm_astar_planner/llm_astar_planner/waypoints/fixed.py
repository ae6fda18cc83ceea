"""A source that answers with one given reply: to try a model's words, or one's own."""

from __future__ import annotations

from dataclasses import dataclass

from llm_astar_planner.waypoints.llm.answer import read_answer
from llm_astar_planner.waypoints.source import WaypointQuery, WaypointReply


@dataclass(frozen=True)
class FixedReply:
    """Answers every query with `text`; its points count from `offset`, the map's minimum."""

    text: str
    offset: tuple[int, int] = (0, 0)
    name: str = 'reply'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the points of the text, in grid coordinates."""
        del query
        answer = read_answer(self.text)
        x_min, y_min = self.offset
        return WaypointReply(
            waypoints=tuple((x - x_min, y - y_min) for x, y in answer.waypoints),
            label=self.name,
            status=answer.status,
            detail=answer.detail,
            text=self.text,
        )
