"""The topics by which bags are written and read: names as the nodes have them by default."""

from __future__ import annotations

MAP = '/map'
# The barriers a map was rasterised from, as JSON, just before the map itself: with them the
# paper's waypoint filter, and a sample's id, are known exactly.
BARRIER_MAP = '/llm_astar/barrier_map'
# Service introspection's topic: requests and answers of GetPlan as ROS 2 itself records them.
GET_PLAN_EVENT = '/planner_node/get_plan/_service_event'
EVALUATION = '/evaluation'


def evaluation_topic(method: str, source: str, kind: str) -> str:
    """Name a topic of an evaluation's results: `kind` is plan, report or markers.

    Characters that no ROS name has become underscores.
    """
    names = [method] if source in ('', 'none') else [method, source]
    parts = ['_'.join(_allowed(name) for name in names), kind]
    return '/'.join((EVALUATION, *parts))


def _allowed(name: str) -> str:
    """Return what may stand within a ROS name: letters, digits, single underscores."""
    words = ''.join(c if c.isascii() and c.isalnum() else ' ' for c in name).split()
    return '_'.join(words)
