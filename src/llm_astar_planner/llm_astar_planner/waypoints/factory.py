"""Make a waypoint source from settings, the same for nodes and command line."""

from __future__ import annotations

from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.plugins import SOURCES, SourceContext
from llm_astar_planner.waypoints.source import WaypointSource


def make_source(
    settings: SourceSettings, dataset: Sequence[BarrierMap] | None = None, seed: int = 0
) -> WaypointSource:
    """Make the source that `settings` name, the package's own or a plug-in's.

    `dataset` lets samples be recognised by their cells; `seed` is of what is drawn at random.
    Raises SettingsError for wrong settings, PluginError for a plug-in that cannot be loaded, and
    what the source raises for its files.
    """
    settings.check()
    source: WaypointSource = SOURCES.load(settings.source)(SourceContext(settings, dataset, seed))
    return source
