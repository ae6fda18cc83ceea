"""Record what a source answers, so that it can be replayed at no cost."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.sample_key import SampleResolver
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter

_LOG = logging.getLogger(__name__)
# Nobody was asked, so there is nothing to record.
_NOT_ASKED = (SourceStatus.NONE, SourceStatus.NOT_CONFIGURED, SourceStatus.MISSING)


class RecordingSource:
    """Passes queries on and writes each exchange to a transcript."""

    def __init__(
        self,
        inner: WaypointSource,
        writer: TranscriptWriter,
        dataset: Sequence[BarrierMap] | None = None,
    ) -> None:
        """Wrap `inner`. `dataset` lets exchanges be keyed by its map ids and pairs."""
        self.inner = inner
        self._writer = writer
        self._resolver = SampleResolver(dataset)

    @property
    def name(self) -> str:
        """The name of the source inside."""
        return self.inner.name

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask and record. A disk that refuses is logged; the answer still comes."""
        reply = self.inner.waypoints(query)
        if reply.status not in _NOT_ASKED:
            try:
                self._writer.write(self._exchange(query, reply))
            except (OSError, ValueError) as error:
                _LOG.warning('%s: cannot be written: %s', self._writer.path, error)
        return reply

    def _exchange(self, query: WaypointQuery, reply: WaypointReply) -> Exchange:
        sample, _ = self._resolver.resolve(query)
        return Exchange(
            map=sample.map,
            pair=sample.pair,
            scale=sample.scale,
            model=reply.model,
            prompt=reply.prompt,
            messages=reply.messages,
            response=reply.text,
            prompt_tokens=reply.prompt_tokens,
            completion_tokens=reply.completion_tokens,
            seconds=reply.seconds,
            status=reply.status,
            unit=reply.unit,
            instruction=query.instruction,
        )
