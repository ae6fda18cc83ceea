"""The source that asks a language model behind an OpenAI-compatible endpoint."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from typing import NamedTuple

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.protocol import Completion, is_context_too_long
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.llm.route_feedback import (
    ASK_FOR_A_LIST,
    Fault,
    find_faults,
    follow_up,
)
from llm_astar_planner.waypoints.prompts.instruction import instruction_section
from llm_astar_planner.waypoints.prompts.map_description import (
    Description,
    Lattice,
    describe,
    describe_coarser,
)
from llm_astar_planner.waypoints.prompts.reply_parser import parse_reply
from llm_astar_planner.waypoints.prompts.template import Template, ask_for_json, path_schema
from llm_astar_planner.waypoints.source import (
    FOLLOWED,
    Message,
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
)
from llm_astar_planner.waypoints.transcript import SampleResolver

# How much of an answer is quoted to the model when it is asked to correct it.
MAX_QUOTED_CHARS = 4000


class Answer(NamedTuple):
    """The points a model wrote, in the coordinates of its prompt, or why there are none."""

    waypoints: tuple[Waypoint, ...]
    status: SourceStatus
    detail: str


def read_answer(text: str) -> Answer:
    """Parse a model's text: OK with points, NO_WAYPOINTS for an empty list, else MALFORMED."""
    points = parse_reply(text)
    if points:
        return Answer(points, SourceStatus.OK, '')
    if points is not None:
        return Answer((), SourceStatus.NO_WAYPOINTS, 'the model answered with an empty list')
    if not text.strip():
        return Answer((), SourceStatus.MALFORMED, 'the reply is empty')
    return Answer((), SourceStatus.MALFORMED, 'no list of points in the reply')


def answer_of(completion: Completion) -> Answer:
    """Parse a completion; the detail says if the model refused or the reply was cut short."""
    answer = read_answer(completion.text)
    if answer.status is not SourceStatus.MALFORMED:
        return answer
    if completion.refusal:
        return answer._replace(detail=f'the model refused: {completion.refusal[:200]}')
    if completion.finish_reason == 'length':
        return answer._replace(detail=f'{answer.detail}; it was cut short at max_output_tokens')
    return answer


class EndpointSource:
    """Describes the map to a model, reads its reply, and asks again where that may help.

    A reply without a list of points is asked for once more. With `repair_rounds`, the model is
    asked to correct a route that collides.
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
        """Take the client that requests are made with.

        A request that is running when the time is up goes on for `late_s` seconds, for callers
        that keep a late answer. `dataset` makes prompts use the coordinates of its maps.
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
        """Who answers: the model, or the host where no model is named."""
        return f'endpoint:{self.client.model or self.client.endpoint.host}'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask the model; a failure is a reply with its status. Returns by the time limit."""
        deadline = time.monotonic() + min(self._timeout_s, query.time_limit)
        conversation = Conversation(self.client, self.template, query, deadline, self._late_s)
        try:
            self._ask(conversation, query)
        except EndpointFailure as failure:
            return conversation.reply(Answer((), failure.status, str(failure)), self.label)
        conversation.ask_for_a_list()
        conversation.repair(self._repair_rounds)
        return conversation.reply(conversation.answer, self.label)

    def _ask(self, conversation: Conversation, query: WaypointQuery) -> None:
        """Ask, and once more with a coarser map where the prompt does not fit the context."""
        _, lattice = self._resolver.resolve(query)
        description = describe(
            query.costmap,
            query.start,
            query.goal,
            lattice=lattice,
            max_tokens=self._max_prompt_tokens,
        )
        try:
            conversation.ask(description)
        except EndpointFailure as failure:
            if not (failure.http == 413 or is_context_too_long(failure.body)):
                raise
            coarser = describe_coarser(description, query.costmap, query.start, query.goal)
            conversation.ask(coarser)


class Conversation:
    """One query to a model: the messages so far, what they cost, and the best answer."""

    def __init__(
        self,
        client: ChatClient,
        template: Template,
        query: WaypointQuery,
        deadline: float,
        late_s: float,
    ) -> None:
        """Start without messages; `deadline` is a time of time.monotonic."""
        self.answer = read_answer('')
        self._client = client
        self._template = template
        self._query = query
        self._deadline = deadline
        self._late_s = late_s
        self._started = time.monotonic()
        self._lattice = Lattice()
        self._messages: tuple[Message, ...] = ()
        self._text = ''
        self._waypoints: tuple[Waypoint, ...] = ()
        self._prompt_tokens = 0
        self._completion_tokens = 0
        self._last_seconds = 0.0

    def ask(self, description: Description) -> None:
        """Ask for a path on the described map. Raises EndpointFailure."""
        self._lattice = description.lattice
        instruction = self._query.instruction
        section = instruction_section(instruction, self._query.grid_map, self._lattice)
        messages = self._template.render(description, section if instruction else '')
        if self._client.dialect.response_format != 'text':
            messages = ask_for_json(messages, thinks=self._template.thinks)
        self._messages = messages
        self._send(messages)

    def ask_for_a_list(self) -> None:
        """Ask once more where the reply held no list; a failure of that changes nothing."""
        if self.answer.status is SourceStatus.MALFORMED and self._has_time():
            with contextlib.suppress(EndpointFailure):
                self._send(self._followed_by(ASK_FOR_A_LIST))

    def repair(self, rounds: int) -> None:
        """Tell the model what collides, up to `rounds` times; keep the route with least faults."""
        faults = self._faults() if rounds else []
        for _ in range(rounds):
            if not faults or self.answer.status is not SourceStatus.OK or not self._has_time():
                return
            before = self.answer, self._waypoints, self._text, self._messages
            try:
                self._send(self._followed_by(follow_up(faults, self._lattice)))
            except EndpointFailure:
                return
            new_faults = self._faults()
            if self.answer.status is not SourceStatus.OK or len(new_faults) > len(faults):
                self.answer, self._waypoints, self._text, self._messages = before
                return
            faults = new_faults

    def reply(self, answer: Answer, label: str) -> WaypointReply:
        """Return the reply to the query, given the answer that counts."""
        if answer.status is SourceStatus.OK:
            instruction = FOLLOWED
        elif answer.status is SourceStatus.NO_WAYPOINTS:
            instruction = 'the model gave no waypoints'
        else:
            instruction = ''
        return WaypointReply(
            waypoints=self._waypoints if answer.status is SourceStatus.OK else (),
            label=label,
            status=answer.status,
            detail=answer.detail,
            text=self._text,
            model=self._client.model,
            prompt=self._template.name,
            prompt_tokens=self._prompt_tokens,
            completion_tokens=self._completion_tokens,
            seconds=time.monotonic() - self._started,
            messages=self._messages,
            unit=self._lattice.unit,
            instruction=instruction if self._query.instruction else '',
        )

    def _has_time(self) -> bool:
        """Return whether an answer as slow as the last one would still come in time."""
        return time.monotonic() + self._last_seconds < self._deadline

    def _faults(self) -> list[Fault]:
        query = self._query
        return find_faults(query.costmap, query.start, query.goal, self._waypoints)

    def _followed_by(self, question: str) -> tuple[Message, ...]:
        answer = self._text[-MAX_QUOTED_CHARS:].strip() or '(no answer)'
        return (*self._messages, Message('assistant', answer), Message('user', question))

    def _send(self, messages: tuple[Message, ...]) -> None:
        """Send the messages and read the answer. Raises EndpointFailure."""
        asked = time.monotonic()
        schema = path_schema(thinks=self._template.thinks)
        completion = self._client.complete(messages, self._deadline, schema, self._late_s)
        self._last_seconds = time.monotonic() - asked
        self._prompt_tokens += completion.prompt_tokens
        self._completion_tokens += completion.completion_tokens
        self._messages = messages
        self._text = completion.text
        self.answer = answer_of(completion)
        self._waypoints = self._lattice.to_cells(
            self.answer.waypoints, self._query.costmap, (self._query.start, self._query.goal)
        )
