"""What became of a wish: every source that gets one says, or it is said for it."""

from __future__ import annotations

from dataclasses import replace

from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

# What a reply says whose waypoints answer the wish; anything else is why it was ignored.
FOLLOWED = 'followed'
_NO_ANSWER = frozenset(SourceStatus) - {
    SourceStatus.OK,
    SourceStatus.NONE,
    SourceStatus.NO_WAYPOINTS,
}


def with_outcome(reply: WaypointReply, query: WaypointQuery, source: str) -> WaypointReply:
    """Return a reply that says what became of the query's wish, '' where none was made.

    A source that says nothing has not read it.
    """
    if not query.instruction:
        outcome = ''
    elif reply.instruction:
        outcome = reply.instruction
    elif reply.status in _NO_ANSWER:
        outcome = f'source {source} gave no answer: {reply.status.value}'
    else:
        outcome = f'source {source} cannot read instructions'
    return reply if outcome == reply.instruction else replace(reply, instruction=outcome)
