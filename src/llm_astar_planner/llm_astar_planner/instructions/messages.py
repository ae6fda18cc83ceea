# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Questions about instructions and their answers, as the JSON texts that nodes exchange.

Whatever a peer sends is bounded in size, and never evaluated.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from llm_astar_planner.instructions.fields import as_mapping, as_number
from llm_astar_planner.instructions.interpretation import (
    COSTS,
    Interpretation,
    Understanding,
    status_of,
)
from llm_astar_planner.instructions.specification import from_json
from llm_astar_planner.instructions.text import InstructionError

# Characters of a question, and of one with the places of the map.
MAX_QUESTION = 64_000
MAX_QUESTION_WITH_PLACES = 4_000_000
# Characters of a name that the asker gave to a question, and of a question that is echoed.
MAX_ID = 100
MAX_ECHO = 1000
MAX_DETAIL = 1000
NO_INSTRUCTION = 'there is no instruction'
STATUSES = {status.value: status for status in Understanding}


class QuestionFormatError(InstructionError):
    """A question that cannot be read; the message names the field. `id` is the asker's, or ''."""

    def __init__(self, message: str, id: str = '') -> None:  # noqa: A002 - the field's name
        """Take the message."""
        super().__init__(message)
        self.id = id


@dataclass(frozen=True)
class Question:
    """What does a text mean? `id` is returned with the answer.

    `places` is a GeoJSON FeatureCollection that nobody has checked, None where none was sent.
    """

    text: str
    id: str = ''
    places: Mapping[str, Any] | None = None

    def to_text(self) -> str:
        """Return the question as the text of a message."""
        others = {'id': self.id, 'places': self.places}
        said = {name: value for name, value in others.items() if value}
        return json.dumps({'text': self.text, **said})


def parse_question(data: str, limit: int = MAX_QUESTION) -> Question:
    """Read a question: the text alone, or JSON with `text`, and `id` and `places` if needed.

    Raises QuestionFormatError, also for a message of more than `limit` characters.
    """
    if len(data) > limit:
        raise QuestionFormatError(f'question: {len(data)} characters are more than {limit}')
    if not data.strip():
        raise QuestionFormatError(NO_INSTRUCTION)
    if not data.lstrip().startswith('{'):
        return Question(data)
    fields = parse_object(data)
    name = fields.get('id', '')
    if not isinstance(name, str) or len(name) > MAX_ID:
        raise QuestionFormatError(f'id: is not a text of at most {MAX_ID} characters')
    text, places = fields.get('text'), fields.get('places')
    if not isinstance(text, str):
        raise QuestionFormatError('text: is not a text', name)
    if not text.strip():
        raise QuestionFormatError(NO_INSTRUCTION, name)
    if not (places is None or isinstance(places, dict)):
        raise QuestionFormatError('places: is not a GeoJSON FeatureCollection', name)
    return Question(text, name, places)


def parse_object(data: str) -> dict[str, Any]:
    """Read a JSON object. Raises QuestionFormatError."""
    try:
        value = json.loads(data)
    except RecursionError:
        raise QuestionFormatError('question: is nested too deeply') from None
    except ValueError as error:
        raise QuestionFormatError(f'question: is not JSON: {error}') from None
    if not isinstance(value, dict):
        raise QuestionFormatError('question: is not a JSON object')
    return value


def answer_text(question: Question, interpretation: Interpretation) -> str:
    """Return the answer to a question as the text of a message; the question is echoed."""
    head = {'question': question.text[:MAX_ECHO], 'id': question.id, 'error': ''}
    return json.dumps(head | interpretation.to_json())


def error_text(question: Question, error: Exception) -> str:
    """Return the answer to a question that cannot be answered as the text of a message."""
    name = error.id if isinstance(error, QuestionFormatError) else question.id
    return json.dumps({'question': question.text[:MAX_ECHO], 'id': name, 'error': str(error)})


def parse_answer(data: str) -> tuple[str, Interpretation | str]:
    """Read an answer: the id of its question, and what was understood, or the error.

    Raises QuestionFormatError or SpecificationError where it is malformed.
    """
    if len(data) > MAX_QUESTION:
        raise QuestionFormatError(f'answer: {len(data)} characters are more than {MAX_QUESTION}')
    fields = parse_object(data)
    name, error = fields.get('id'), fields.get('error')
    if not isinstance(name, str):
        raise QuestionFormatError('id: is not a text')
    if isinstance(error, str) and error:
        return name, error[:MAX_DETAIL]
    return name, interpretation_from_json(fields)


def interpretation_from_json(value: object) -> Interpretation:
    """Read what `Interpretation.to_json` wrote.

    A status that claims more than the clauses say is lowered to what they say. Raises
    SpecificationError or QuestionFormatError.
    """
    fields = as_mapping(value, 'interpretation')
    specification = from_json(fields.get('specification'))
    status = STATUSES.get(str(fields.get('status')))
    if status is None:
        raise QuestionFormatError(f'status: is not one of {", ".join(STATUSES)}')
    if status in (Understanding.WHOLE, Understanding.UNSURE, Understanding.IRRELEVANT):
        status = status_of(specification)
    texts = {one: as_bounded_text(fields, one) for one in ('text', 'understood_by', 'detail')}
    costs = {one: of(as_number(fields.get(one, 0), one, 0.0, 1e9)) for one, of in COSTS.items()}
    values: dict[str, Any] = {**texts, **costs}
    return Interpretation(specification=specification, status=status, **values)


def as_bounded_text(fields: Mapping[str, Any], name: str) -> str:
    """Return a text, cut to what a message may hold. Raises QuestionFormatError otherwise."""
    value = fields.get(name, '')
    if not isinstance(value, str):
        raise QuestionFormatError(f'{name}: is not a text')
    return value[:MAX_DETAIL]
