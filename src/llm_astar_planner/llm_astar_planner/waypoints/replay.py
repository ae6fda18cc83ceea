# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Sources that ask no model: none at all, one given reply, and a recorded transcript.

The recording is made here too; samples of a dataset are recognised by the cells of their map.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap

from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.config import SettingsError, SourceContext
from llm_astar_planner.waypoints.prompts.map_description import Lattice
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
)
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter, read_transcript

_LOG = logging.getLogger(__name__)
# The paper scales its maps by up to 10; searching more scales would only cost time.
MAX_SCALE = 10
# What an exchange takes from a reply as it is, and a replay from an exchange.
SHARED = ('model', 'prompt', 'messages', 'prompt_tokens', 'completion_tokens', 'seconds', 'unit')
# Replies with these statuses come from no model, so there is nothing to record.
_NOT_ASKED = (SourceStatus.NONE, SourceStatus.NOT_CONFIGURED, SourceStatus.MISSING)


@dataclass(frozen=True)
class NoSource:
    """Returns no waypoints, whatever it is made from."""

    context: SourceContext | None = None
    name: str = 'none'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:  # noqa: ARG002 - the protocol
        """Return no waypoints."""
        return WaypointReply(label='none', status=SourceStatus.NONE)


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
        answer = read_answer(self.text)
        points = Lattice(*self.offset).to_cells(answer.waypoints, query)
        return replace(answer, waypoints=points, label=self.name)


class ReplayError(LlmAstarError, ValueError):
    """It is not clear which exchanges to replay; the message lists what the transcript holds."""


def make_replay(context: SourceContext) -> ReplaySource:
    """Make the source of the settings' transcript. Raises what ReplaySource does."""
    settings = context.settings
    if not settings.transcript:
        raise SettingsError('transcript: name the JSON Lines file that source replay answers from')
    return ReplaySource(settings.transcript, settings.model, settings.prompt, context.dataset)


class ReplaySource:
    """Waypoints from a transcript, found by map, pair, scale, model and prompt.

    Of several exchanges with one key, the last that has an answer counts.
    """

    name = 'replay'

    def __init__(
        self,
        path: str | Path,
        model: str = '',
        prompt: str = '',
        dataset: Sequence[BarrierMap] | None = None,
        exchanges: Sequence[Exchange] | None = None,
    ) -> None:
        """Read the transcript at `path`, or take its `exchanges`. Thread-safe afterwards.

        `model` and `prompt` may be empty where the transcript holds only one. `dataset` lets
        queries without a sample be recognised by their map's cells.
        Raises TranscriptError for a malformed file, ReplayError for an ambiguous or unknown
        model and prompt.
        """
        self._path = Path(path)
        held = read_transcript(self._path) if exchanges is None else list(exchanges)
        self.model, self.prompt = self._choose(held, model, prompt)
        self._resolver = SampleResolver(dataset)
        self._exchanges: dict[SampleKey, Exchange] = {}
        for exchange in held:
            if (exchange.model, exchange.prompt) != (self.model, self.prompt):
                continue
            if exchange.is_answered or exchange.sample not in self._exchanges:
                self._exchanges[exchange.sample] = exchange
        # The samples that the model answered, usefully or not, and those whose query failed, by a
        # timeout for example.
        self.answered = {key for key, item in self._exchanges.items() if item.is_answered}
        self.unanswered = self._exchanges.keys() - self.answered

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the recorded answer in grid coordinates; MISSING where there is none."""
        sample, lattice = self._resolver.resolve(query)
        # An exchange about a sample of the dataset may have been recorded live, under the key of
        # its cells.
        for key, own in ((sample, lattice), (query.live_key, Lattice())):
            exchange = self._exchanges.get(key)
            if exchange is not None:
                return self._replay(query, exchange, own)
        asked = f'map {sample.map}, pair {sample.pair}, scale {sample.scale}'
        detail = f'no exchange for {asked}, model {self.model}, prompt {self.prompt}'
        return WaypointReply(
            label=f'replay:{self.model}', status=SourceStatus.MISSING,
            detail=f'{self._path}: {detail}', model=self.model, prompt=self.prompt,
        )  # fmt: skip

    def _replay(self, query: WaypointQuery, exchange: Exchange, lattice: Lattice) -> WaypointReply:
        """Return the reply of an exchange whose points are in the coordinates of `lattice`."""
        answer = read_answer(exchange.response)
        if not exchange.response:
            status = answer.status if exchange.status is SourceStatus.OK else exchange.status
            detail = f'recorded without an answer: {exchange.status.value}'
            answer = replace(answer, status=status, detail=detail)
        points = lattice.coarsened(exchange.unit).to_cells(answer.waypoints, query)
        shared = {name: getattr(exchange, name) for name in (*SHARED, 'provenance')}
        return replace(answer, waypoints=points, label=f'replay:{self.model}', **shared)

    def _choose(self, exchanges: list[Exchange], model: str, prompt: str) -> tuple[str, str]:
        """Return the only (model, prompt) of the transcript that fits the given ones."""
        held = sorted({(exchange.model, exchange.prompt) for exchange in exchanges})
        fitting = [pair for pair in held if model in ('', pair[0]) and prompt in ('', pair[1])]
        if len(fitting) == 1:
            return fitting[0]
        listing = '; '.join(f'model {name}, prompt {text}' for name, text in held) or 'nothing'
        asked = f'model {model or "(any)"}, prompt {prompt or "(any)"}'
        problem = 'is not recorded' if not fitting else 'fits several recordings'
        raise ReplayError(f'{self._path}: {asked} {problem}; it holds: {listing}')


@dataclass(eq=False)
class RecordingSource:
    """Passes queries on to a source and writes each exchange to a transcript, for replays.

    `dataset` lets exchanges be keyed by its map ids and pairs.
    """

    inner: sources.WaypointSource
    writer: TranscriptWriter
    dataset: Sequence[BarrierMap] | None = None

    def __post_init__(self) -> None:
        """Prepare to recognise the samples of the dataset."""
        self._resolver = SampleResolver(self.dataset)
        self._dataset_digest = dataset_digest(self.dataset or ())

    @property
    def name(self) -> str:
        """The name of the wrapped source."""
        return self.inner.name

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Query and record. A failed write is logged; the reply is returned all the same."""
        reply = self.inner.waypoints(query)
        if reply.status not in _NOT_ASKED:
            try:
                self.writer.write(self._exchange(query, reply).to_json())
            except (OSError, ValueError) as error:
                _LOG.warning('%s: cannot be written: %s', self.writer.path, error)
        return reply

    def _exchange(self, query: WaypointQuery, reply: WaypointReply) -> Exchange:
        sample, _ = self._resolver.resolve(query)
        provenance = reply.provenance._replace(
            # A live map has a digest for its id, and belongs to no dataset.
            dataset_digest=self._dataset_digest if isinstance(sample.map, int) else '',
            time=datetime.now(timezone.utc).isoformat(timespec='seconds'),
        )
        shared = {name: getattr(reply, name) for name in SHARED}
        return Exchange(
            *sample, response=reply.text, status=reply.status, provenance=provenance, **shared
        )


class SampleResolver:
    """Finds the dataset's map and pair of a query by the map's cells, at any resolution."""

    def __init__(self, dataset: Sequence[BarrierMap] | None = None) -> None:
        """Take the maps to search; there may be none."""
        self._maps = tuple(dataset or ())
        self._indices: dict[int, dict[str, BarrierMap]] = {}

    def resolve(self, query: WaypointQuery) -> tuple[SampleKey, Lattice]:
        """Return the key of a query and the lattice its coordinates are recorded in.

        The key is the query's own sample, else the dataset's, else the live key, which goes with
        the lattice of the cells.
        """
        found = self._find(query.grid_map)
        if query.sample is not None:
            return query.sample, found[1] if found else lattice_of(query.grid_map)
        if found is not None:
            barrier_map, lattice, scale = found
            for index, sample in enumerate(barrier_map.samples):
                cells = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
                if cells == (tuple(query.start), tuple(query.goal)):
                    return SampleKey(barrier_map.id, index, scale), lattice
        return query.live_key, Lattice()

    def _find(self, grid_map: GridMap) -> tuple[BarrierMap, Lattice, int] | None:
        """Return the scaled barrier map with exactly these cells, its lattice and its scale."""
        sizes = {item.size for item in self._maps}
        for scale in range(1, MAX_SCALE + 1):
            if (grid_map.width, grid_map.height) not in {(w * scale, h * scale) for w, h in sizes}:
                continue
            if scale not in self._indices:
                scaled = [barrier_map.scale(scale) for barrier_map in self._maps]
                self._indices[scale] = {cells_digest(item.to_grid()): item for item in scaled}
            found = self._indices[scale].get(cells_digest(grid_map))
            if found is not None:
                return found, Lattice(*found.offset), scale
        return None


def dataset_digest(maps: Sequence[BarrierMap]) -> str:
    """Return the SHA-256 of maps with their samples, however their file is laid out.

    The queries of the samples, which are sentences, and the families of the maps, which depend on
    how a dataset is named, do not count. '' where there are no maps.
    """
    entries = [item.to_json() for item in maps]
    for entry in entries:
        entry.pop('family', None)
        entry['start_goal'] = [ends[:2] for ends in entry['start_goal']]
    text = json.dumps(entries, separators=(',', ':'))
    return hashlib.sha256(text.encode()).hexdigest() if entries else ''


def lattice_of(grid_map: GridMap) -> Lattice:
    """Return the lattice of a grid that was made from a barrier map; (0, 0) for other grids.

    A barrier map puts lattice point (x, y) at (x, y) * resolution.
    """
    offsets = [value / grid_map.resolution + 0.5 for value in grid_map.origin[:2]]
    if grid_map.origin.yaw != 0.0 or any(abs(v - round(v)) > 1e-6 for v in offsets):
        return Lattice()
    return Lattice(round(offsets[0]), round(offsets[1]))


def cells_digest(grid_map: GridMap) -> str:
    """Return a digest of the occupied cells alone: the same at any resolution and origin."""
    occupied = grid_map.blocked()
    return hashlib.sha256(str(occupied.shape).encode() + occupied.tobytes()).hexdigest()
