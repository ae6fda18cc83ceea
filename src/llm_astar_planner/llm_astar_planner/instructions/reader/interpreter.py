# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Understands instructions by the small network, and is sure only where everything agrees."""

from collections import Counter
from dataclasses import replace

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions import fields, interpretation
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.grammar.interpreter import asked
from llm_astar_planner.instructions.grammar.selection import Unclear
from llm_astar_planner.instructions.grammar.vocabulary import vocabulary
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Interpreter,
    not_understood,
)
from llm_astar_planner.instructions.reader.check import doubt, is_likely, viewed
from llm_astar_planner.instructions.reader.meaning import NOTHING, Unreadable, Writer
from llm_astar_planner.instructions.specification import Specification, from_json

NAME = 'reader'
# What is said of a reading of the grammar that the networks find unlikely.
UNLIKELY = 'the networks read it otherwise'
# How many different readings are weighed.
CONSIDERED = 3


class ReaderInterpreter:
    """Understands instructions by a small network: an Interpreter.

    WHOLE only where `check` finds no doubt; else UNSURE, with a question, or NONE.
    """

    name = NAME

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:  # noqa: ARG002
        """Say what was understood of a text; takes some milliseconds. Never raises."""
        return interpretation.interpreted(text, NAME, lambda one: read_or_not(one, places))


class CheckedInterpreter:
    """Asks about what another interpreter has read whole where the networks find it unlikely.

    They have learnt from other sentences than its rules were written for: an Interpreter.
    """

    def __init__(self, inner: Interpreter) -> None:
        """Check what this one reads."""
        self.inner = inner
        self.name = inner.name

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:
        """Return what `inner` understood, as a question where that is unlikely. Never raises."""
        found = self.inner.interpret(text, places, time_limit)
        clauses = found.specification.clauses
        if not (found.is_whole and clauses):
            return found
        if is_likely(found.text, places, found.specification.to_json()['clauses']):
            return found
        doubted = Specification(asked(clauses, question_about(found.text, places)))
        status = interpretation.status_of(doubted)
        return replace(found, specification=doubted, status=status, detail=UNLIKELY)


def question_about(text: str, places: Places) -> str:
    """Return what is asked about a reading of a clean text, with '{meant}' for it."""
    question = vocabulary(viewed(text, places)[0].language).questions['model']
    return question.replace('{said}', text[: fields.MAX_QUESTION_CHARS // 3])


def read_or_not(text: str, places: Places) -> Interpretation:
    """Return what is read in a clean text, with the reason where nothing is."""
    try:
        return read(text, places)
    except (Unreadable, fields.SpecificationError, Unclear) as error:
        return not_understood(text, str(error), NAME)


def read(text: str, places: Places) -> Interpretation:
    """Return what the networks read in a clean text. Raises Unreadable or SpecificationError."""
    one, views = viewed(text, places)
    found = [meant for meant, _ in Counter(views.readings()).most_common(CONSIDERED)]
    clauses = found[0] if len(found) == 1 else max(found, key=views.weight)
    if not clauses:
        raise Unreadable('nothing that is read for certain')
    about = {
        str(lexeme.value): text[lexeme.start : lexeme.end][: fields.MAX_NAME_CHARS]
        for lexeme in one.lexemes
        if lexeme.kind == 'UNSUPPORTED'
    }
    writer = Writer(one.slots, {'': text[: fields.MAX_NAME_CHARS], **about})
    asked_for = [writer.clause(part) for part in clauses if part != (NOTHING,)]
    said = from_json({'version': 2, 'clauses': asked_for})
    reason = doubt(one, clauses, views)
    if reason:
        if all(isinstance(clause, Unknown) for clause in said.clauses):
            raise Unreadable(reason)
        said = Specification(asked(said.clauses, question_about(text, places)))
    return Interpretation(text, said, NAME, interpretation.status_of(said), reason)
