"""Make a waypoint source from settings, the same for nodes and command line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from llm_astar_msgs_adapter.barrier_map import BarrierMap

from llm_astar_planner.waypoint_source.base import WaypointSource
from llm_astar_planner.waypoint_source.none import NoSource
from llm_astar_planner.waypoint_source.replay import ReplaySource


class SettingsError(ValueError):
    """Settings that make no source; the message names the field and the fix."""


@dataclass(frozen=True)
class SourceSettings:
    """What a source needs to know; the README's table of llm_client_node says what each means."""

    source: str = 'none'
    model: str = ''
    prompt: str = ''
    transcript: str = ''
    timeout_s: float = 4.0


def _replay(settings: SourceSettings, dataset: Sequence[BarrierMap] | None) -> WaypointSource:
    if not settings.transcript:
        raise SettingsError('transcript: name the JSON Lines file that source replay answers from')
    return ReplaySource(settings.transcript, settings.model, settings.prompt, dataset)


def _none(settings: SourceSettings, dataset: Sequence[BarrierMap] | None) -> WaypointSource:
    del settings, dataset
    return NoSource()


SOURCES: dict[str, Callable[[SourceSettings, Sequence[BarrierMap] | None], WaypointSource]] = {
    'none': _none,
    'replay': _replay,
}


def make_source(
    settings: SourceSettings, dataset: Sequence[BarrierMap] | None = None
) -> WaypointSource:
    """Make the source `settings` name; `dataset` lets replay recognise samples by their cells.

    Raises SettingsError for settings that fit no source, and what the source raises on its files.
    """
    if settings.source not in SOURCES:
        raise SettingsError(
            f'source: {settings.source!r} is unknown; there is {", ".join(SOURCES)}'
        )
    return SOURCES[settings.source](settings, dataset)
