"""Waypoints from a language model behind an OpenAI-compatible endpoint."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.instruction_outcome import FOLLOWED
from llm_astar_planner.waypoints.llm.answer import Answer, read_answer
from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.completion import Completion
from llm_astar_planner.waypoints.llm.failure import EndpointFailure
from llm_astar_planner.waypoints.llm.protocol import is_context_too_long
from llm_astar_planner.waypoints.llm.route_feedback import (
    ASK_FOR_A_LIST,
    Fault,
    find_faults,
    follow_up,
)
from llm_astar_planner.waypoints.prompts.instruction import wish_section
from llm_astar_planner.waypoints.prompts.json_schema import ask_for_json, path_schema
from llm_astar_planner.waypoints.prompts.lattice import Lattice
from llm_astar_planner.waypoints.prompts.map_description import (
    Description,
    describe,
    describe_coarser,
)
from llm_astar_planner.waypoints.prompts.message import Message
from llm_astar_planner.waypoints.prompts.template import Template
from llm_astar_planner.waypoints.sample_key import SampleResolver
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
)

# How much of an answer is shown to the model again when it is asked to repair it.
MAX_QUOTED_CHARS = 4000


@dataclass
class _Talk:
    """One question as it goes: what was said, what it cost, the best answer so far."""

    query: WaypointQuery
    deadline: float
    started: float = field(default_factory=time.monotonic)
    lattice: Lattice = field(default_factory=Lattice)
    messages: tuple[Message, ...] = ()
    text: str = ''
    answer: Answer = field(default_factory=lambda: read_answer(''))
    waypoints: tuple[Waypoint, ...] = ()
    prompt_tokens: int = 0
    completion_tokens: int = 0
    last_seconds: float = 0.0

    def has_time(self) -> bool:
        """Tell whether an answer as slow as the last one would still come in time."""
        return time.monotonic() + self.last_seconds < self.deadline


class EndpointSource:
    """Describes the map, asks the model, reads its reply, and asks again where that helps.

    An unreadable reply is asked for once more; with `repair_rounds`, so are routes that collide.
    """

    name = 'endpoint'

    def __init__(
        self,
        client: ChatClient,
        template: Template,
        *,
        timeout_s: float = 4.0,
        max_prompt_tokens: int = 2000,
        repair_rounds: int = 0,
        late_s: float = 0.0,
        dataset: Sequence[BarrierMap] | None = None,
    ) -> None:
        """Take the client to ask by.

        A request under way when time is up goes on for `late_s` seconds, for callers that keep
        a late answer. `dataset` makes prompts name its maps' own coordinates.
        """
        self.client = client
        self.template = template
        self._timeout_s = timeout_s
        self._max_prompt_tokens = max_prompt_tokens
        self._repair_rounds = repair_rounds
        self._late_s = late_s
        self._resolver = SampleResolver(dataset)

    @property
    def label(self) -> str:
        """Who answers: the model, or the host where the endpoint has but one."""
        return f'endpoint:{self.client.model or self.client.endpoint.host}'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask the model; a failure is a reply with its status. Returns by the time limit."""
        limit = min(self._timeout_s, query.time_limit)
        talk = _Talk(query, time.monotonic() + limit)
        try:
            self._ask(talk)
            self._ask_for_a_list(talk)
        except EndpointFailure as failure:
            return self._reply(talk, Answer((), failure.status, str(failure)))
        self._repair(talk)
        return self._reply(talk, talk.answer)

    def _ask(self, talk: _Talk) -> None:
        """Put the question, once more with a coarser map where it does not fit the context."""
        query = talk.query
        _, own = self._resolver.resolve(query)
        description = describe(
            query.grid_map,
            query.start,
            query.goal,
            lattice=own,
            max_tokens=self._max_prompt_tokens,
        )
        try:
            self._put(talk, description)
        except EndpointFailure as failure:
            if not (failure.http == 413 or is_context_too_long(failure.body)):
                raise
            coarser = describe_coarser(description, query.grid_map, query.start, query.goal)
            self._put(talk, coarser)

    def _put(self, talk: _Talk, description: Description) -> None:
        talk.lattice = description.lattice
        wish = talk.query.instruction
        section = wish_section(wish, talk.query.grid_map, talk.lattice) if wish else ''
        messages = self.template.render(description, section)
        if self.client.dialect.response_format != 'text':
            messages = ask_for_json(messages, thinks=self.template.thinks)
        talk.messages = messages
        self._say(talk, messages)

    def _ask_for_a_list(self, talk: _Talk) -> None:
        """Ask once more where the reply held no list; the failure of that changes nothing."""
        if talk.answer.status is not SourceStatus.MALFORMED or not talk.has_time():
            return
        with contextlib.suppress(EndpointFailure):
            self._say(talk, _followed_by(talk, ASK_FOR_A_LIST))

    def _repair(self, talk: _Talk) -> None:
        """Tell the model what collides, and keep the answer with the fewest faults."""
        faults = self._faults(talk)
        for _ in range(self._repair_rounds):
            if not faults or talk.answer.status is not SourceStatus.OK or not talk.has_time():
                return
            before = replace(talk)
            try:
                self._say(talk, _followed_by(talk, follow_up(faults, talk.lattice)))
            except EndpointFailure:
                return
            new_faults = self._faults(talk)
            if talk.answer.status is not SourceStatus.OK or len(new_faults) > len(faults):
                talk.answer, talk.waypoints = before.answer, before.waypoints
                talk.text, talk.messages = before.text, before.messages
                return
            faults = new_faults

    def _faults(self, talk: _Talk) -> list[Fault]:
        if not self._repair_rounds:
            return []
        query = talk.query
        return find_faults(query.grid_map, query.start, query.goal, talk.waypoints)

    def _say(self, talk: _Talk, messages: tuple[Message, ...]) -> None:
        """Send the messages and read the answer into the talk. Raises EndpointFailure."""
        asked = time.monotonic()
        schema = path_schema(thinks=self.template.thinks)
        completion = self.client.complete(messages, talk.deadline, schema, self._late_s)
        talk.last_seconds = time.monotonic() - asked
        talk.prompt_tokens += completion.prompt_tokens
        talk.completion_tokens += completion.completion_tokens
        talk.messages = messages
        talk.text = completion.text
        talk.answer = _answer(completion)
        talk.waypoints = talk.lattice.to_cells(
            talk.answer.waypoints, talk.query.grid_map, (talk.query.start, talk.query.goal)
        )

    def _reply(self, talk: _Talk, answer: Answer) -> WaypointReply:
        return WaypointReply(
            waypoints=talk.waypoints if answer.status is SourceStatus.OK else (),
            label=self.label,
            status=answer.status,
            detail=answer.detail,
            text=talk.text,
            model=self.client.model,
            prompt=self.template.name,
            prompt_tokens=talk.prompt_tokens,
            completion_tokens=talk.completion_tokens,
            seconds=time.monotonic() - talk.started,
            messages=talk.messages,
            unit=talk.lattice.unit,
            instruction=_outcome(talk.query, answer),
        )


def _outcome(query: WaypointQuery, answer: Answer) -> str:
    """Say what became of the wish, '' where it is for others to say."""
    if not query.instruction:
        return ''
    if answer.status is SourceStatus.NO_WAYPOINTS:
        return 'the model gave no waypoints'
    return FOLLOWED if answer.status is SourceStatus.OK else ''


def _answer(completion: Completion) -> Answer:
    """Read a completion; say where it was refused or cut short."""
    answer = read_answer(completion.text)
    if answer.status is not SourceStatus.MALFORMED:
        return answer
    if completion.refusal:
        return answer._replace(detail=f'the model refused: {completion.refusal[:200]}')
    if completion.finish_reason == 'length':
        return answer._replace(detail=f'{answer.detail}; it was cut short at max_output_tokens')
    return answer


def _followed_by(talk: _Talk, question: str) -> tuple[Message, ...]:
    said = talk.text[-MAX_QUOTED_CHARS:].strip() or '(no answer)'
    return (*talk.messages, Message('assistant', said), Message('user', question))
