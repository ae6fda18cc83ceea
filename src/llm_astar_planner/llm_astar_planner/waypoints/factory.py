"""Make a waypoint source from settings, the same for nodes and command line."""

from __future__ import annotations

from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.config import SettingsError, SourceSettings
from llm_astar_planner.waypoints.fixed import NoSource
from llm_astar_planner.waypoints.source import WaypointSource


def make_source(
    settings: SourceSettings, dataset: Sequence[BarrierMap] | None = None
) -> WaypointSource:
    """Make the source that `settings` name; `dataset` lets samples be recognised by their cells.

    Raises SettingsError for wrong settings, and what the source raises for its files.
    """
    # Only the source that is asked for is imported: the HTTP client alone takes a tenth of a
    # second.
    # ruff: noqa: PLC0415
    settings.check()
    if settings.source == 'none':
        return NoSource()
    if settings.source == 'embedded':
        from llm_astar_planner.waypoints.learned.network import packaged_weights
        from llm_astar_planner.waypoints.learned.source import EmbeddedSource

        # Read the weights now, so that a broken file is reported here and not at the first query.
        packaged_weights()
        return EmbeddedSource(settings.candidates)
    if settings.source == 'replay':
        from llm_astar_planner.waypoints.replay import ReplaySource

        if not settings.transcript:
            raise SettingsError(
                'transcript: name the JSON Lines file that source replay answers from'
            )
        return ReplaySource(settings.transcript, settings.model, settings.prompt, dataset)
    if settings.source == 'endpoint':
        from llm_astar_planner.waypoints.llm.factory import make_endpoint_source

        return make_endpoint_source(settings, dataset)
    if settings.source == 'coarse':
        from llm_astar_planner.search.coarse import compile_kernels

        compile_kernels()
    from llm_astar_planner.waypoints.baselines import baseline_sources

    return baseline_sources()[settings.source]
