"""Sources of waypoints: the protocol that every source follows, and its plain values."""

from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

__all__ = ['SampleKey', 'SourceStatus', 'WaypointQuery', 'WaypointReply', 'WaypointSource']
