"""Sources that ask nobody: none at all, one given reply, and a recorded transcript."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.config import SettingsError, SourceContext
from llm_astar_planner.waypoints.prompts.map_description import Lattice
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.sample_resolver import SampleResolver
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
)
from llm_astar_planner.waypoints.transcript import SHARED, Exchange, read_transcript


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
        return WaypointReply(
            label=f'replay:{self.model}',
            status=SourceStatus.MISSING,
            detail=f'{self._path}: no exchange for map {sample.map}, pair {sample.pair}, '
            f'scale {sample.scale}, model {self.model}, prompt {self.prompt}',
            model=self.model,
            prompt=self.prompt,
        )

    def _replay(self, query: WaypointQuery, exchange: Exchange, lattice: Lattice) -> WaypointReply:
        """Return the reply of an exchange whose points are in the coordinates of `lattice`."""
        answer = read_answer(exchange.response)
        if not exchange.response:
            status = answer.status if exchange.status is SourceStatus.OK else exchange.status
            detail = f'recorded without an answer: {exchange.status.value}'
            answer = answer._replace(status=status, detail=detail)
        return WaypointReply(
            waypoints=lattice.coarsened(exchange.unit).to_cells(
                answer.waypoints, query.costmap, (query.start, query.goal)
            ),
            label=f'replay:{self.model}',
            status=answer.status,
            detail=answer.detail,
            text=exchange.response,
            provenance=exchange.provenance,
            **{name: getattr(exchange, name) for name in SHARED},
        )

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
