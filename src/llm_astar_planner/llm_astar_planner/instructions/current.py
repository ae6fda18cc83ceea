# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The instruction that is set: understood once, by the grammar at once and then by a model.

The questions about it that a person has answered are remembered for each map.
"""

import fcntl
import json
import math
import threading
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from llm_astar_msgs_adapter.files import read_json
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places

from llm_astar_planner.caches import Recent
from llm_astar_planner.instructions.chain import BackgroundInterpreter, OnAnswer, make_interpreter
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Interpreter,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.text import clean_instruction

# Seconds after which a model that did not answer is asked again: more than its missing answer is
# remembered, and each time twice as long, as many times as this.
ASK_AGAIN_S = 15.0
MAX_DOUBLINGS = 6
# Seconds for one question, longer than the process that is asked gives its model.
LIMIT_S = 150.0
# A text in each language of the grammar.
FIRST_TEXTS = ('avoid that', 'vermeide das', 'evita eso', 'évite cela')
# Answers that are remembered; the oldest are forgotten.
SIZE = 1024
# The map by the digest of its places, the canonical sentence of the clause, and the question.
Key = tuple[str, str, str]


class ConfirmationsError(LlmAstarError, ValueError):
    """A file of confirmations cannot be used; the message names it."""


class Confirmations:
    """Remembers answers to questions, and gives them where the same is asked again. Thread-safe.

    With a `path` they are kept in a JSON file, which is written after each answer.
    """

    def __init__(self, path: str | Path | None = None, size: int = SIZE) -> None:
        """Remember the last `size` answers. Raises ConfirmationsError for a file that is none."""
        self._path = None if path is None else Path(path)
        self._size = size
        self._lock = threading.Lock()
        self._known: Recent[Key, bool] = Recent(size)
        if self._path is not None and self._path.exists():
            self._known.update(load(self._path, size))

    def __len__(self) -> int:
        """Return the number of answers."""
        return len(self._known)

    def remember(self, interpretation: Interpretation, places: Places, answer: bool) -> None:
        """Remember one answer to all questions of an interpretation.

        Raises OSError, or ConfirmationsError where another program spoilt the file.
        """
        clauses = interpretation.specification.clauses
        new = {key_of(clause, places): answer for clause in clauses if clause.unsure}
        with self._lock:
            self._known.update(new)
            if self._path is not None:
                with alone(self._path):
                    if self._path.exists():  # what others have written since
                        self._known.update({**load(self._path, self._size), **new})
                    save(self._path, self._known)

    def applied(self, interpretation: Interpretation, places: Places) -> Interpretation:
        """Return an interpretation with what is answered already: sure, or not understood."""
        asked = [clause for clause in interpretation.specification.clauses if clause.unsure]
        with self._lock:
            known = {one.unsure: self._known.get(key_of(one, places)) for one in asked}
        answers = {question: answer for question, answer in known.items() if answer is not None}
        return interpretation.answered(answers) if answers else interpretation


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Keep other processes from writing a file of answers meanwhile. Raises OSError."""
    with path.with_name(f'{path.name}.lock').open('w', encoding='utf-8') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def key_of(clause: Clause, places: Places) -> Key:
    """Return what an answer is remembered by."""
    return places.digest, clause.sentence(), clause.unsure


def load(path: Path, size: int) -> dict[Key, bool]:
    """Read a file of answers. Raises ConfirmationsError."""
    entries = read_json(path, ConfirmationsError)
    with raising(ConfirmationsError, f'{path}: not a list of answers: ', TypeError, ValueError):
        return {
            (str(digest), str(sentence), str(question)): bool(answer)
            for digest, sentence, question, answer in entries[-size:]
        }


def save(path: Path, known: Mapping[Key, bool]) -> None:
    """Write a file of answers, whole or not at all. Raises OSError."""
    text = json.dumps([[*key, answer] for key, answer in known.items()], ensure_ascii=False)
    new = path.with_name(f'{path.name}.new')
    new.write_text(text, encoding='utf-8')
    new.replace(path)


class RemoteInterpreter(Interpreter, Protocol):
    """An interpreter in another process, such as llm_client_node."""

    @property
    def ready(self) -> bool:
        """Whether it can be asked."""

    def drop_oldest(self) -> None:
        """Answer all but the newest questions with PENDING, at once."""


class InstructionReader:
    """Reads instructions: grammar and reader at once, and a remote interpreter when it answers.

    What a person has answered, of `confirmations`, is not asked again.
    """

    def __init__(
        self, remote: RemoteInterpreter | None, confirmations: Confirmations | None = None
    ) -> None:
        """Take the remote interpreter, None if there is none to be asked."""
        self.confirmations = Confirmations() if confirmations is None else confirmations
        self._local = make_interpreter({})
        self._remote = remote
        self._background: BackgroundInterpreter | None = None
        if remote is not None:
            self._background = BackgroundInterpreter(self._local, remote, LIMIT_S)

    @property
    def ready(self) -> bool:
        """Whether the remote interpreter can be asked."""
        return self._remote is not None and self._remote.ready

    def prepare(self, places: Places) -> None:
        """Do now what the first question about these places needs, in each language."""
        for text in FIRST_TEXTS:
            self._local.interpret(text, places, 0.0)

    def read(self, text: str, places: Places, on_answer: OnAnswer) -> Interpretation:
        """Return what is understood now of a clean text.

        PENDING means that `on_answer` is called with the rest, on another thread.
        """
        background, applied = self._background, self.confirmations.applied

        def on_reading(answer: Interpretation) -> None:
            on_answer(applied(answer, places))

        if background is not None and self.ready:
            return applied(background.interpret_now(text, places, on_reading), places)
        reading = applied(self._local.interpret(text, places, 0.0), places)
        if background is None or self._remote is None or reading.is_read:
            return reading
        detail = f'{self._remote.name} is not there to be asked'
        return replace(reading, detail='; '.join(filter(None, (reading.detail, detail))))

    def restart(self) -> None:
        """Forget what the remote interpreter answered: it may answer differently from now on."""
        if self._remote is not None and self._background is not None:
            self._background.ask(self._remote)
            # Otherwise each change would leave a thread that waits for an answer.
            self._remote.drop_oldest()

    def close(self) -> None:
        """Ask no more."""
        if self._background is not None:
            self._background.close()


class CurrentInstruction:
    """The instruction that is set, with what is understood of it so far. Thread-safe."""

    def __init__(self, reader: InstructionReader, on_change: Callable[[], None]) -> None:
        """Start without an instruction.

        `on_change` is called whenever something else is understood, on any thread.
        """
        self.instruction: RouteInstruction | None = None
        self._places = NO_PLACES
        self._reader = reader
        self._on_change = on_change
        # Reentrant: a question may drop an older one, which is answered on the same thread.
        self._lock = threading.RLock()
        self._text = ''
        self._number = 0
        # When to ask next, in monotonic seconds; and whether the question was answered before.
        self._ask_at = math.inf
        self._is_answered = False
        self._failures = 0

    def set(self, text: str, places: Places) -> None:
        """Set the instruction, '' for none. Raises InstructionError for one that is too long."""
        clean = clean_instruction(text)
        with self._lock:
            if (clean, places.digest) != (self._text, self._places.digest):
                self._text, self._places = clean, places
                self._failures = 0
                self.read()

    @property
    def questions(self) -> tuple[str, ...]:
        """What the person is to be asked about the instruction."""
        instruction = self.instruction
        return () if instruction is None else instruction.interpretation.questions

    def confirm(self, answer: bool = True) -> bool:
        """Answer the questions about the instruction, all of them; return whether there were any.

        With yes the clauses hold as they were read, with no they are not understood. The answer
        is remembered for this map. Raises OSError or ConfirmationsError, once it holds, where it
        cannot be kept.
        """
        with self._lock:
            if self.instruction is None or not self.questions:
                return False
            reading = self.instruction.interpretation
            self.use(reading.answered(dict.fromkeys(reading.questions, answer)))
            self._reader.confirmations.remember(reading, self._places, answer)
            return True

    def ask_again(self, *, anew: bool = False) -> None:
        """Ask about an instruction that is not answered yet; to be called now and then.

        `anew` asks also about one that is, since the remote interpreter has changed. What is
        understood already holds until the answer comes.
        """
        with self._lock:
            if anew:
                self._reader.restart()
            if anew or (time.monotonic() >= self._ask_at and self._reader.ready):
                self.read(keep=self._is_answered)

    def read(self, *, keep: bool = False) -> None:
        """Understand the instruction; an earlier question about it is forgotten.

        `keep` keeps what is understood already, unless now all of it is understood at once.
        """
        self._number += 1
        self._ask_at = math.inf
        if not self._text:
            self.use(None)
            return
        is_asked = self._reader.ready
        on_answer = partial(self.take, self._number)
        reading = self._reader.read(self._text, self._places, on_answer)
        is_read = reading.is_read
        if not (is_asked or is_read):
            self._ask_at = 0.0  # as soon as somebody is there to be asked
        if is_read or not keep:
            self._is_answered = is_asked and reading.status is not Understanding.PENDING
            self.use(reading)

    def take(self, number: int, answer: Interpretation) -> None:
        """Use an answer, unless the instruction was read again since its question."""
        with self._lock:
            if number != self._number:
                return
            is_answer = answer.status is not Understanding.PENDING
            if not is_answer:
                delay = ASK_AGAIN_S * 2 ** min(self._failures, MAX_DOUBLINGS)
                self._ask_at = time.monotonic() + delay
                self._failures += 1
            if is_answer or not self._is_answered:
                self._is_answered = is_answer
                self.use(answer)

    def use(self, interpretation: Interpretation | None) -> None:
        """Use an interpretation from now on."""
        before, after = self.instruction, None
        if interpretation is not None:
            after = RouteInstruction(interpretation, self._places)
        self.instruction = after
        if meaning(before) != meaning(after):
            self._on_change()


def meaning(instruction: RouteInstruction | None) -> Hashable:
    """Return what decides plans and reports; equal for equal ones."""
    if instruction is None:
        return None
    understood = instruction.interpretation
    digest = instruction.places.digest
    return understood.text, understood.specification, understood.status, digest
