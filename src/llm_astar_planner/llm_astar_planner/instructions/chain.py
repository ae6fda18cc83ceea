# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Interpreters in a chain, with a memory of what was understood."""

import logging
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import replace
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.caches import Recent
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import (
    COSTS,
    Interpretation,
    Interpreter,
    Understanding,
    not_understood,
)
from llm_astar_planner.instructions.reader.interpreter import NAME as READER
from llm_astar_planner.instructions.reader.interpreter import (
    UNLIKELY,
    CheckedInterpreter,
    ReaderInterpreter,
)
from llm_astar_planner.instructions.transcript import InstructionRecorder
from llm_astar_planner.waypoints.config import SOURCE, SourceSettings
from llm_astar_planner.waypoints.source import MESSAGE

_LOG = logging.getLogger(__name__)
CACHE_SIZE = 256
# How long a model is not asked again about a sentence after it did not answer.
FAILED_S = 10.0
# The longest answer to an instruction: ten clauses.
MAX_OUTPUT_TOKENS = 400

Key = tuple[str, str]
MAX_WAITING = 8
MAX_CALLBACKS = 32
DROPPED = 'dropped, since newer questions came'
OnAnswer = Callable[[Interpretation], None]
Waiting = tuple[Interpretation, Places, list[OnAnswer]]


class CachedInterpreter:
    """Remembers interpretations by sentence and places, and asks once for what is asked twice.

    What was not answered in time is remembered for FAILED_S seconds only. Thread-safe.
    """

    def __init__(self, inner: Interpreter, size: int = CACHE_SIZE) -> None:
        """Remember the last `size` interpretations of `inner`."""
        self.inner = inner
        self._lock = threading.RLock()
        # Each with the time (monotonic) until which it holds.
        self._known: Recent[Key, tuple[Interpretation, float]] = Recent(size)
        self._running: dict[Key, Future[Interpretation]] = {}

    @property
    def name(self) -> str:
        """The name of the wrapped interpreter."""
        return self.inner.name

    def known(self, text: str, places: Places) -> Interpretation | None:
        """Return what is remembered of a sentence, None if nothing is."""
        with self._lock:
            found, until = self._known.get((text, places.digest), (None, math.inf))
        return found if time.monotonic() < until else None

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Return what is remembered, or ask; who asks while it is asked waits for that answer."""
        key = text, places.digest
        with self._lock:
            found = self.known(text, places)
            if found is not None:
                return as_remembered(found)
            running = self._running.get(key)
            if running is None:
                mine = self._running[key] = Future()
        if running is not None:
            return wait_for(running, text, time_limit)
        try:
            answer = self.inner.interpret(text, places, time_limit)
        except Exception as error:  # noqa: BLE001 - no sentence may ever stop a plan
            _LOG.exception('the interpreter %s failed', self.name)
            answer = not_understood(text, f'{type(error).__name__} in {self.name}')
        # A missing answer is not remembered for long, an answer for ever.
        seconds = FAILED_S if answer.status is Understanding.PENDING else math.inf
        with self._lock:
            self._known[key] = answer, time.monotonic() + seconds
            del self._running[key]
        mine.set_result(answer)
        return answer


def as_remembered(interpretation: Interpretation) -> Interpretation:
    """Return an interpretation from memory: no time, no tokens."""
    return replace(interpretation, seconds=0.0, prompt_tokens=0, output_tokens=0)


def wait_for(running: Future[Interpretation], text: str, time_limit: float) -> Interpretation:
    """Return the answer to a question that another thread asked, PENDING if it takes longer."""
    try:
        return as_remembered(running.result(min(time_limit, threading.TIMEOUT_MAX)))
    except FutureTimeoutError:
        detail = f'no answer within {time_limit:.1f} s'
        return not_understood(text, detail, status=Understanding.PENDING)


class ChainInterpreter:
    """Asks interpreters one after the other until one has settled a sentence.

    If none has, the fullest of the partial readings is taken. Each interpreter remembers its
    answers. Thread-safe where its parts are.
    """

    name = 'chain'

    def __init__(self, interpreters: Sequence[Interpreter], size: int = CACHE_SIZE) -> None:
        """Chain interpreters, the quickest first; each remembers `size` sentences."""
        self.parts = tuple(CachedInterpreter(part, size) for part in interpreters)

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Return what the chain understands within `time_limit` seconds. Never raises."""
        started = time.monotonic()
        readings: list[Interpretation] = []
        for part in self.parts:
            # The reader is asked too where the grammar has a question: it may be sure.
            is_asked = part.name == READER and not any(one.is_whole for one in readings)
            if any(map(is_settled, readings)) and not is_asked:
                break
            left = time_limit - (time.monotonic() - started)
            readings.append(part.interpret(text, places, max(0.0, left)))
        return fullest(readings)


def is_settled(reading: Interpretation) -> bool:
    """Whether nobody else need be asked: all is read, and not by the reader with a question."""
    return reading.is_whole or (reading.is_read and reading.understood_by != READER)


def fullest(readings: Sequence[Interpretation]) -> Interpretation:
    """Return the reading to use, with the seconds, tokens and reasons of all.

    That is a whole one without guesses, else the one with most clauses that stand in the sentence;
    of equal ones one that the networks do not doubt, then a whole one, then one that is not of the
    small reader, then the earlier, since the surest interpreter comes first. Where none is whole
    and one has yet to answer, it is PENDING.
    """
    best = max(readings, key=rank)
    others = [] if best.is_read else [part.detail for part in readings if part is not best]
    # Two readings of the grammar, here and in another process, have the same reasons.
    reasons = [reason for detail in (best.detail, *others) for reason in detail.split('; ')]
    pending = not best.is_read and any(part.status is Understanding.PENDING for part in readings)
    return replace(
        best,
        status=Understanding.PENDING if pending else best.status,
        detail='; '.join(filter(None, dict.fromkeys(reasons))),
        **{name: sum(getattr(one, name) for one in readings) for name in COSTS},
    )


def rank(reading: Interpretation) -> tuple[bool, float, bool, bool, bool]:
    """Return what readings are compared by; the greatest is the best. A guess counts half."""
    known = reading.specification.enforceable
    sure = reading.is_whole and bool(known) and not any(clause.unsure for clause in known)
    count = sum(0.5 if clause.unsure else 1.0 for clause in known)
    is_other = reading.understood_by != READER
    return sure, count, reading.detail != UNLIKELY, reading.is_read, is_other


def make_interpreter(values: Mapping[str, Any]) -> Interpreter:
    """Make the interpreter that the settings of a waypoint source name.

    The grammar and the reader come first; then, with `source` endpoint, the model, with replay
    the recorded replies of `transcript`. Values that are no settings of a source are ignored.
    Raises SettingsError, or TranscriptError for a file.
    """
    settings = SourceSettings(**{name: values[name] for name in SOURCE if name in values})
    settings.check()
    slow = make_slow_interpreter(settings)
    grammar = CheckedInterpreter(GrammarInterpreter())
    return ChainInterpreter([grammar, ReaderInterpreter(), *([slow] if slow else [])])


def make_slow_interpreter(settings: SourceSettings) -> Interpreter | None:
    """Make the interpreter behind those of the robot, None where the settings name none."""
    if settings.source not in ('replay', 'endpoint'):
        return None
    # With an HTTP client, which planner_node does without: a fifth of what it imports.
    from llm_astar_planner.instructions.model import interpreter as models  # noqa: PLC0415
    from llm_astar_planner.waypoints.llm.client import ChatClient  # noqa: PLC0415

    if settings.source == 'replay':
        known, model = settings.transcript, settings.model
        return models.ReplayInterpreter(known, model) if known else None
    tokens = min(settings.max_output_tokens, MAX_OUTPUT_TOKENS)
    # Models keep to the form best when held to the schema; what refuses it falls back.
    # The form is that of prompts for waypoints.
    asked = replace(settings, max_output_tokens=tokens, response_format='json_schema')
    asked = replace(asked, prompt_form=MESSAGE)
    recorder = InstructionRecorder(settings.record) if settings.record else None
    return models.ModelInterpreter(ChatClient(asked), recorder)


class BackgroundInterpreter:
    """Returns the quick interpreter's answer at once, and calls back with the slow one's.

    One worker thread asks the slow interpreter, the newest sentence first. Of more than
    MAX_WAITING sentences the oldest is dropped, and of more than MAX_CALLBACKS callbacks for one
    sentence too: they get the quick answer, still PENDING. Close it when done. Thread-safe.
    """

    def __init__(self, quick: Interpreter, slow: Interpreter, time_limit: float = 120.0) -> None:
        """Start the worker. `time_limit` is the seconds that the slow one may take."""
        self._quick = CachedInterpreter(quick)
        self._time_limit = time_limit
        self._changed = threading.Condition()
        self._waiting: OrderedDict[Key, Waiting] = OrderedDict()
        self._closed = False
        self.ask(slow)

    def ask(self, slow: Interpreter) -> None:
        """Ask this slow interpreter from now on, what waits already included.

        What the one before has answered is forgotten; it still answers the question it is asked.
        """
        with self._changed:
            self._slow = asked = CachedInterpreter(slow)
            self._changed.notify_all()
        threading.Thread(
            target=self._work, args=(asked,), name='instructions', daemon=True
        ).start()

    def interpret_now(
        self, text: str, places: Places, on_answer: OnAnswer | None = None
    ) -> Interpretation:
        """Return what is understood now; PENDING where the slow interpreter is asked as well.

        `on_answer` is then called, on another thread, with the final interpretation, or with
        what is PENDING still if the slow interpreter did not answer.
        """
        reading = self._quick.interpret(text, places, 0.0)
        if is_settled(reading):
            return reading
        known = self._slow.known(text, places)
        if known is not None and known.status is not Understanding.PENDING:
            return fullest([reading, known])
        with self._changed:
            if self._closed:
                return reading
            key = text, places.digest
            _, _, callbacks = self._waiting.pop(key, (reading, places, []))
            callbacks += [on_answer] if on_answer else []
            dropped = [(reading, callback) for callback in callbacks[:-MAX_CALLBACKS]]
            self._waiting[key] = reading, places, callbacks[-MAX_CALLBACKS:]
            dropped += self._drop_oldest() if len(self._waiting) > MAX_WAITING else []
            self._changed.notify()
        self._tell_dropped(dropped)
        return replace(reading, status=Understanding.PENDING)

    def close(self) -> None:
        """End the worker after the question that it is asking; the rest is dropped."""
        with self._changed:
            self._closed = True
            dropped = [one for _ in list(self._waiting) for one in self._drop_oldest()]
            self._changed.notify_all()
        self._tell_dropped(dropped)

    def _drop_oldest(self) -> list[tuple[Interpretation, OnAnswer]]:
        _, (reading, _, callbacks) = self._waiting.popitem(last=False)
        return [(reading, callback) for callback in callbacks]

    def _tell_dropped(self, dropped: list[tuple[Interpretation, OnAnswer]]) -> None:
        for reading, callback in dropped:
            pending = replace(reading, status=Understanding.PENDING, detail=DROPPED)
            self._tell(callback, pending)

    def _work(self, slow: CachedInterpreter) -> None:
        while True:
            with self._changed:
                while not (self._waiting or self._closed or self._slow is not slow):
                    self._changed.wait()
                if self._closed or self._slow is not slow:
                    return
                _, (reading, places, callbacks) = self._waiting.popitem(last=True)
            answer = slow.interpret(reading.text, places, self._time_limit)
            for callback in callbacks:
                self._tell(callback, fullest([reading, answer]))

    def _tell(self, callback: OnAnswer, interpretation: Interpretation) -> None:
        try:
            callback(interpretation)
        except Exception:  # noqa: BLE001 - a callback must not end the worker
            _LOG.exception('the callback of an instruction failed')
