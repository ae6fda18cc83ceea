"""The source that is no source: the planner searches on its own."""

from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply


class NoSource:
    """Answers every query with no waypoints."""

    name = 'none'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:  # noqa: ARG002 - the protocol
        """Return no waypoints."""
        return WaypointReply(label='none', status=SourceStatus.NONE)
