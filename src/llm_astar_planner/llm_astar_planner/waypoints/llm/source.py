# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The source that asks a language model behind an OpenAI-compatible endpoint, with a cache."""

import contextlib
import threading
import time
from collections.abc import Hashable
from dataclasses import KW_ONLY, dataclass, field, replace

from llm_astar_planner.caches import Recent
from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.async_query import QueryQueue, QueryTask, start_query
from llm_astar_planner.waypoints.config import SourceContext, SourceSettings
from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.protocol import Completion
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.prompts import examples as prompts
from llm_astar_planner.waypoints.prompts import map_description as maps
from llm_astar_planner.waypoints.prompts import template as templates
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.replay import RecordingSource, SampleResolver
from llm_astar_planner.waypoints.source import Message, SourceStatus, WaypointQuery, WaypointReply
from llm_astar_planner.waypoints.transcript import TranscriptWriter

# How many seconds a request that missed its deadline may go on, to answer the next query.
LATE_S = 60.0
# Different queries of a cached source that may run at a time; the endpoint's client lets fewer
# requests through.
MAX_PENDING = 16
# How much of an answer is quoted to the model when it is asked to correct it.
MAX_QUOTED_CHARS = 4000


def answer_of(completion: Completion) -> WaypointReply:
    """Parse a completion; the detail says if the model refused or the reply was cut short."""
    answer = read_answer(completion.text)
    if answer.status is not SourceStatus.MALFORMED:
        return answer
    if completion.refusal:
        return replace(answer, detail=f'the model refused: {completion.refusal[:200]}')
    if completion.finish_reason == 'length':
        return replace(answer, detail=f'{answer.detail}; it was cut short at max_output_tokens')
    return answer


@dataclass(eq=False)
class EndpointSource:
    """Describes the map to a model, reads its reply, and asks again where that may help.

    A reply without a list of points is asked for once more. A request that is running when the
    time is up goes on for `late_s` seconds, for callers that keep a late answer.
    `resolver` makes prompts use the coordinates of the maps of a dataset.
    """

    client: ChatClient
    prompt: prompts.Prompt
    settings: SourceSettings = field(default_factory=SourceSettings)
    late_s: float = 0.0
    resolver: SampleResolver = field(default_factory=SampleResolver)

    name = 'endpoint'

    @property
    def label(self) -> str:
        """Name of the model, or of the host if no model is configured."""
        return f'endpoint:{self.client.model or self.client.endpoint.host}'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask the model; a failure is a reply with its status. Returns by the time limit."""
        deadline = time.monotonic() + min(self.settings.timeout_s, query.time_limit)
        conversation = Conversation(self, query, deadline)
        try:
            conversation.ask()
        except EndpointFailure as failure:
            return replace(conversation.reply(), status=failure.status, detail=str(failure))
        return conversation.reply()


@dataclass(eq=False)
class Conversation:
    """One query to a model: the turn that counts so far, and what all turns took.

    `turn` has what the model was asked last, its text, and what the text says. `deadline` and
    `started` are times of time.monotonic.
    """

    source: EndpointSource
    query: WaypointQuery
    deadline: float
    turn: WaypointReply = field(default_factory=WaypointReply)
    lattice: maps.Lattice = field(default_factory=maps.Lattice)
    prompt_tokens: int = 0
    completion_tokens: int = 0
    started: float = field(default_factory=time.monotonic)

    def ask(self) -> None:
        """Ask for a path, and once more where the reply held no list. Raises EndpointFailure."""
        source, (_, lattice) = self.source, self.source.resolver.resolve(self.query)
        most, template = source.settings.max_prompt_tokens, source.prompt.template
        description = maps.describe(self.query, lattice=lattice, max_tokens=most)
        self.lattice = description.lattice
        examples = source.prompt.examples(self.query, description, most)
        messages = template.render(description, source.prompt.form, examples)
        if source.client.dialect.response_format != 'text':
            messages = templates.ask_for_json(messages, thinks=template.thinks)
        self.turn = WaypointReply(messages=messages)
        self._send(messages)
        is_list = self.turn.status is not SourceStatus.MALFORMED
        # Only where an answer as slow as that one would still come in time.
        if is_list or 2.0 * time.monotonic() - self.started >= self.deadline:
            return
        answer = self.turn.text[-MAX_QUOTED_CHARS:].strip() or '(no answer)'
        again = Message('assistant', answer), Message('user', prompts.ASK_FOR_A_LIST)
        with contextlib.suppress(EndpointFailure):
            self._send((*messages, *again))

    def reply(self) -> WaypointReply:
        """Return the reply to the query: the turn that counts."""
        source = self.source
        return replace(
            self.turn, label=source.label, model=source.client.model, prompt=source.prompt.name,
            prompt_tokens=self.prompt_tokens, completion_tokens=self.completion_tokens,
            seconds=time.monotonic() - self.started, unit=self.lattice.unit,
        )  # fmt: skip

    def _send(self, messages: tuple[Message, ...]) -> None:
        """Send the messages and read the answer. Raises EndpointFailure."""
        client, prompt = self.source.client, self.source.prompt
        schema = templates.path_schema(thinks=prompt.template.thinks)
        completion = client.complete(messages, self.deadline, schema, self.source.late_s)
        self.prompt_tokens += completion.prompt_tokens
        self.completion_tokens += completion.completion_tokens
        answer = answer_of(completion)
        waypoints = self.lattice.to_cells(answer.waypoints, self.query)
        provenance = sources.Provenance(
            completion.finish_reason[: sources.MAX_NAME], completion.fingerprint, prompt.digest,
            temperature=client.dialect.temperature, seed=client.dialect.seed,
        )  # fmt: skip
        self.turn = replace(answer, waypoints=waypoints, messages=messages, provenance=provenance)


@dataclass(eq=False)
class CachedSource:
    """Answers from memory where it can; queries `inner` once for identical concurrent queries.

    When a caller's time is up the query continues in the background, as long as `inner` lets it,
    and its late reply goes to the cache. Keyed by the costmap (map and rules), start, goal
    and sample; of more than `size` replies the least recently used is dropped.
    `model` and `prompt` label the replies of failures. Thread-safe.
    """

    inner: sources.WaypointSource
    _: KW_ONLY
    model: str = ''
    prompt: str = ''
    size: int = 256
    timeout_s: float = 4.0

    def __post_init__(self) -> None:
        """Start with an empty cache and no running query."""
        # Reentrant: a query that the queue refuses is answered on the thread that puts it there.
        self._lock = threading.RLock()
        self._queue = QueryQueue(MAX_PENDING, MAX_PENDING, MAX_PENDING)
        self._replies: Recent[Hashable, WaypointReply] = Recent(self.size)
        self._running: dict[Hashable, QueryTask] = {}

    @property
    def name(self) -> str:
        """The name of the wrapped source."""
        return self.inner.name

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the reply in memory, else wait up to `timeout_s` or the query's time limit."""
        started = time.monotonic()
        query = replace(query, time_limit=min(self.timeout_s, query.time_limit))
        key = (query.costmap.key, query.start, query.goal, query.sample)
        with self._lock:
            kept = self._replies.get(key)
            if kept is not None:
                detail = f'from the cache; {kept.detail}' if kept.detail else 'from the cache'
                return replace(
                    kept, detail=detail, prompt_tokens=0, completion_tokens=0, seconds=0.0
                )
            task = self._running.get(key)
            if task is None:
                if len(self._running) >= MAX_PENDING:
                    detail = f'{MAX_PENDING} queries are running'
                    return self._failure(SourceStatus.REFUSED, detail, started)
                task = self._running[key] = start_query(
                    self.inner, query, lambda reply: self._store(key, reply), self._queue
                )
                if task.reply is not None:
                    del self._running[key]
        task.wait(query.time_limit, query.stop)
        if task.reply is not None:
            return task.reply
        detail = f'no answer within {query.time_limit:.1f} s; a late one is kept for the next time'
        return self._failure(SourceStatus.TIMEOUT, detail, started)

    def _store(self, key: Hashable, reply: WaypointReply) -> None:
        with self._lock:
            # A reply without a route is kept too; after a failure the source is asked again.
            if reply.status.is_answer:
                self._replies[key] = reply
            self._running.pop(key, None)

    def _failure(self, status: SourceStatus, detail: str, started: float) -> WaypointReply:
        return WaypointReply(
            label=f'{self.name}:{self.model}', status=status, detail=detail, model=self.model,
            prompt=self.prompt, seconds=time.monotonic() - started,
        )  # fmt: skip


def make_endpoint(context: SourceContext) -> sources.WaypointSource:
    """Make the source that asks a language model, with a cache and, if set, a recording.

    Raises SettingsError, TemplateError, ExamplesError or OSError where a setting cannot be used.
    """
    settings = context.settings
    template, count = settings.template, settings.retrieved_examples
    library = prompts.load_example_library(settings.examples_file, count) if count else None
    prompt = prompts.Prompt(template, settings.prompt_form, library, count)
    source: sources.WaypointSource = EndpointSource(
        ChatClient(settings, template.stop), prompt, settings, LATE_S,
        SampleResolver(context.dataset),
    )  # fmt: skip
    if settings.record:
        source = RecordingSource(source, TranscriptWriter(settings.record), context.dataset)
    return CachedSource(
        source, model=settings.model, prompt=prompt.name,
        timeout_s=settings.timeout_s,
    )  # fmt: skip


def client_of(source: sources.WaypointSource) -> ChatClient | None:
    """Return the endpoint's client inside a source, for its state and counts, or None."""
    inner: object = source
    while isinstance(inner, (CachedSource, RecordingSource)):
        inner = inner.inner
    return inner.client if isinstance(inner, EndpointSource) else None
