"""Sources whose reply does not depend on the query: none at all, or a given text."""

from __future__ import annotations

from dataclasses import dataclass

from llm_astar_planner.waypoints.answer import read_answer
from llm_astar_planner.waypoints.plugins import SourceContext
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply


class NoSource:
    """Returns no waypoints."""

    name = 'none'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:  # noqa: ARG002 - the protocol
        """Return no waypoints."""
        return WaypointReply(label='none', status=SourceStatus.NONE)


def make_none(context: SourceContext) -> NoSource:
    """Make the source that returns no waypoints."""
    del context
    return NoSource()


@dataclass(frozen=True)
class FixedReply:
    """Answers every query with the points in `text`, for example to try out a model's answer.

    `offset` is the lattice point of cell (0, 0), which is subtracted from every point.
    """

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
