# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What was understood of an instruction, and who understands instructions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Protocol

import numpy as np
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from numpy.typing import NDArray

from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.fields import MAX_NAME_CHARS
from llm_astar_planner.instructions.route import not_driven
from llm_astar_planner.instructions.specification import NOTHING_ASKED, Specification
from llm_astar_planner.instructions.text import PREFER, InstructionError, clean_instruction


class Understanding(Enum):
    """How much of an instruction was understood."""

    WHOLE = 'understood'
    # Everything was read, but something of it only if the person says so.
    UNSURE = 'unsure'
    PARTLY = 'partly understood'
    NONE = 'not understood'
    IRRELEVANT = 'nothing about the route'
    PENDING = 'not understood yet'


# The fields that say what an interpretation has cost, and their types.
COSTS = {'seconds': float, 'prompt_tokens': int, 'output_tokens': int}


@dataclass(frozen=True)
class Interpretation:
    """What was understood of an instruction.

    - `text`: the instruction as one clean line.
    - `specification`: what is enforced and verified.
    - `understood_by`: 'grammar' or the name of the model; '' if nobody understood anything.
    - `status`; `detail`: why something was not understood, '' if nothing is to be said.
    - `seconds`: wall time; `prompt_tokens`, `output_tokens`: of a model, 0 of the grammar.
    """

    text: str
    specification: Specification = NOTHING_ASKED
    understood_by: str = ''
    status: Understanding = Understanding.NONE
    detail: str = ''
    seconds: float = 0.0
    prompt_tokens: int = 0
    output_tokens: int = 0

    @property
    def is_whole(self) -> bool:
        """Whether every word was read for certain."""
        return self.status in (Understanding.WHOLE, Understanding.IRRELEVANT)

    @property
    def is_read(self) -> bool:
        """Whether every word was read, be it with a question."""
        return self.is_whole or self.status is Understanding.UNSURE

    @property
    def questions(self) -> tuple[str, ...]:
        """What a person is to be asked, each question once; () where all is certain."""
        asked = (clause.unsure for clause in self.specification.clauses if clause.unsure)
        return tuple(dict.fromkeys(asked))

    def confirmed(self) -> Interpretation:
        """Return it with its questions answered with yes."""
        return self.answered(dict.fromkeys(self.questions, True))

    def answered(self, answers: Mapping[str, bool]) -> Interpretation:
        """Return it with some of its questions answered: what was not meant is not understood."""
        clauses: list[Clause] = []
        for one in self.specification.clauses:
            asked = '' if one.unsure in answers else one.unsure
            is_meant = answers.get(one.unsure, True)
            unknown = Unknown(text=one.phrase()[:MAX_NAME_CHARS])
            clauses.append(replace(one, unsure=asked) if is_meant else unknown)
        specification = Specification(tuple(clauses))
        is_pending = self.status is Understanding.PENDING
        status = self.status if is_pending else status_of(specification)
        return replace(self, specification=specification, status=status)

    @property
    def sentence(self) -> str:
        """The canonical English sentence of what was understood."""
        return self.specification.sentence

    def summary(self) -> str:
        """Return one line for logs: 'understood by grammar: avoid the kitchen'."""
        by = f' by {self.understood_by}' if self.understood_by else ''
        sentence = f': {self.sentence}' if self.sentence else ''
        detail = f' ({self.detail})' if self.detail else ''
        return f'{self.status.value}{by}{sentence}{detail}'

    def to_json(self) -> dict[str, Any]:
        """Return the form of `~/interpretation`, `--json` and transcripts."""
        return {
            **vars(self),
            'status': self.status.value,
            'specification': self.specification.to_json(),
            'sentence': self.sentence,
            'questions': list(self.questions),
        }


@dataclass(frozen=True, eq=False)
class RouteInstruction:
    """An instruction as a plan request carries it.

    - `policy`: `prefer` takes the path that violates the clauses least, `require` gives no path
      unless every `must` clause is satisfied.
    - `driven`: float64 [n, 2] metres, the way driven since the goal and the instruction were
      given. `want_prices`: whether the outcome says what each clause costs.
    """

    interpretation: Interpretation
    places: Places = NO_PLACES
    policy: str = PREFER
    driven: NDArray[np.float64] = field(default_factory=not_driven)
    want_prices: bool = True


class Interpreter(Protocol):
    """Understands instructions: the grammar, a model, a replay, or a chain of them."""

    @property
    def name(self) -> str:
        """Name in reports: 'grammar', 'endpoint', 'replay'."""

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Say what was understood of a clean text within `time_limit` seconds. Never raises."""


def interpreted(text: str, name: str, read: Callable[[str], Interpretation]) -> Interpretation:
    """Return what `read` understands of a text as one clean line, with the time it took.

    What is no instruction is not understood, and what is empty asks nothing.
    """
    began = time.perf_counter()
    try:
        clean = clean_instruction(text)
    except InstructionError as error:
        return not_understood(text[:80], str(error), name)
    if not clean:
        return Interpretation('', understood_by=name, status=Understanding.IRRELEVANT)
    return replace(read(clean), seconds=time.perf_counter() - began)


def status_of(specification: Specification) -> Understanding:
    """Return how much was understood, judged by the unknown clauses and the questions.

    What a path does not have is understood.
    """
    clauses = specification.clauses
    if any(clause.kind == Unknown.kind for clause in clauses):
        return Understanding.PARTLY if specification.enforceable else Understanding.NONE
    if any(clause.unsure for clause in clauses):
        return Understanding.UNSURE
    return Understanding.WHOLE if clauses else Understanding.IRRELEVANT


def not_understood(
    text: str, detail: str, understood_by: str = '', status: Understanding = Understanding.NONE
) -> Interpretation:
    """Return the interpretation of a text of which nothing was understood."""
    specification = Specification((Unknown(text=text[:80]),) if text else ())
    return Interpretation(text, specification, understood_by, status, detail)
