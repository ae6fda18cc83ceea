"""Answer from a recorded transcript: no endpoint, no cost, the same words every time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.instruction_outcome import FOLLOWED
from llm_astar_planner.waypoints.llm.answer import Answer, read_answer
from llm_astar_planner.waypoints.prompts.lattice import Lattice
from llm_astar_planner.waypoints.sample_key import SampleResolver, live_key
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
)
from llm_astar_planner.waypoints.transcript import Exchange, read_transcript

NOT_RECORDED = 'replay: the recording was made without this instruction'


class ReplayError(ValueError):
    """A transcript does not say which exchanges to replay; the message lists what it holds."""


class _Key(NamedTuple):
    sample: SampleKey
    model: str
    prompt: str
    instruction: str = ''


class ReplaySource:
    """Waypoints from a transcript, looked up by (map, pair, scale, model, prompt) and the wish.

    Of several exchanges with one key, the last that was answered counts. Where a wish was not
    recorded, the answer without it is taken.
    """

    name = 'replay'

    def __init__(
        self,
        path: str | Path,
        model: str = '',
        prompt: str = '',
        dataset: Sequence[BarrierMap] | None = None,
    ) -> None:
        """Read the transcript at `path`. Thread-safe afterwards: nothing changes.

        `model` and `prompt` may be empty where the transcript holds just one. `dataset` lets
        queries without a sample be recognised by their cells.
        Raises TranscriptError for a malformed file, ReplayError for an open or unknown choice.
        """
        self._path = Path(path)
        exchanges = read_transcript(self._path)
        self.model, self.prompt = self._choose(exchanges, model, prompt)
        self._resolver = SampleResolver(dataset)
        self._exchanges: dict[_Key, Exchange] = {}
        for exchange in exchanges:
            key = _Key(exchange.sample, exchange.model, exchange.prompt, exchange.instruction)
            if exchange.response or key not in self._exchanges:
                self._exchanges[key] = exchange

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the recorded answer in grid coordinates; MISSING where there is none."""
        exchange, lattice = self._find(query)
        if exchange is None:
            return self._missing(query)
        answer = read_answer(exchange.response)
        if not exchange.response:
            detail = f'recorded without an answer: {exchange.status.value}'
            failed = exchange.status is not SourceStatus.OK
            answer = answer._replace(
                status=exchange.status if failed else answer.status, detail=detail
            )
        return WaypointReply(
            waypoints=lattice.coarsened(exchange.unit).to_cells(
                answer.waypoints, query.grid_map, (query.start, query.goal)
            ),
            label=f'replay:{self.model}',
            status=answer.status,
            detail=answer.detail,
            text=exchange.response,
            model=self.model,
            prompt=self.prompt,
            prompt_tokens=exchange.prompt_tokens,
            completion_tokens=exchange.completion_tokens,
            seconds=exchange.seconds,
            instruction=_outcome(query, exchange, answer),
        )

    def _find(self, query: WaypointQuery) -> tuple[Exchange | None, Lattice]:
        """Return the exchange recorded for a query, and the lattice of its points.

        One with the query's own wish comes before one without any. A dataset's sample may have
        been asked about live, by its cells.
        """
        places = (self._resolver.resolve(query), (live_key(query), Lattice()))
        for instruction in (query.instruction, ''):
            for sample, lattice in places:
                key = _Key(sample, self.model, self.prompt, instruction)
                if key in self._exchanges:
                    return self._exchanges[key], lattice
        return None, Lattice()

    def _missing(self, query: WaypointQuery) -> WaypointReply:
        sample, _ = self._resolver.resolve(query)
        return WaypointReply(
            label=f'replay:{self.model}',
            status=SourceStatus.MISSING,
            detail=f'{self._path}: no exchange for map {sample.map}, pair {sample.pair}, '
            f'scale {sample.scale}, model {self.model}, prompt {self.prompt}',
            model=self.model,
            prompt=self.prompt,
            instruction=NOT_RECORDED if query.instruction else '',
        )

    def _choose(self, exchanges: list[Exchange], model: str, prompt: str) -> tuple[str, str]:
        """Return the one (model, prompt) that fits what was asked for."""
        held = sorted({(exchange.model, exchange.prompt) for exchange in exchanges})
        fitting = [
            (held_model, held_prompt)
            for held_model, held_prompt in held
            if model in ('', held_model) and prompt in ('', held_prompt)
        ]
        if len(fitting) == 1:
            return fitting[0]
        listing = '; '.join(f'model {name}, prompt {text}' for name, text in held) or 'nothing'
        asked = f'model {model or "(any)"}, prompt {prompt or "(any)"}'
        problem = 'is not recorded' if not fitting else 'fits several recordings'
        raise ReplayError(f'{self._path}: {asked} {problem}; it holds: {listing}')


def _outcome(query: WaypointQuery, exchange: Exchange, answer: Answer) -> str:
    """Say what became of the wish, '' where none was made."""
    if not query.instruction:
        return ''
    if exchange.instruction != query.instruction:
        return NOT_RECORDED
    return FOLLOWED if answer.waypoints else 'replay: the recorded answer has no waypoints'
