"""Questions about instructions as nodes exchange them; a peer may send anything."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from instruction_places import HOSPITAL
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.instructions.messages import (
    MAX_ECHO,
    MAX_QUESTION,
    Question,
    QuestionFormatError,
    answer_text,
    error_text,
    parse_answer,
    parse_question,
)
from llm_astar_planner.instructions.regions import NamedPlace
from llm_astar_planner.instructions.specification import Specification

AVOID = Avoid(region=NamedPlace('kitchen'))
WHOLE = Interpretation(
    'avoid the kitchen', Specification((AVOID,)), 'grammar', Understanding.WHOLE, '', 0.5, 3, 4
)
JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)


def test_a_text_alone_and_json_are_questions():
    assert parse_question(' visit the lab') == Question(' visit the lab')
    asked = Question('visit the lab', 'x1', HOSPITAL.to_geojson())
    assert parse_question(asked.to_text()) == Question(
        asked.text, asked.id, json.loads(json.dumps(asked.places))
    )


@pytest.mark.parametrize(
    ('data', 'problem'),
    [
        ('{', 'question: is not JSON'),
        ('{"a":' * 50_000, 'question: 250000 characters are more than'),
        ('{"a":' * 12_000, 'question: is n'),
        ('{}', 'text: is not a text'),
        ('{"text": 1}', 'text: is not a text'),
        (' ', 'there is no instruction'),
        (Question('', 'x1').to_text(), 'there is no instruction'),
        ('{"text": "a", "id": 1}', 'id: is not a text of at most 100'),
        (json.dumps({'text': 'a', 'id': 'x' * 101}), 'id: is not a text of at most 100'),
        ('{"text": "a", "places": "b"}', 'places: is not a GeoJSON FeatureCollection'),
        ('x' * (MAX_QUESTION + 1), '64001 characters are more than 64000'),
    ],
)
def test_a_malformed_question_is_refused_by_its_field(data, problem):
    with pytest.raises(QuestionFormatError, match=problem):
        parse_question(data)


def test_an_answer_is_read_back_as_it_was_written():
    text = answer_text(Question('avoid the kitchen', 'x1'), WHOLE)
    assert parse_answer(text) == ('x1', WHOLE)
    assert json.loads(text)['sentence'] == 'avoid the kitchen'


def test_an_error_names_the_question_and_is_bounded():
    text = error_text(Question('y' * 5000, 'x1'), QuestionFormatError('text: is bad'))
    assert parse_answer(text) == ('', 'text: is bad')
    assert len(json.loads(text)['question']) == MAX_ECHO
    text = error_text(Question('y', 'x1'), LlmAstarError('places: are bad'))
    assert parse_answer(text) == ('x1', 'places: are bad')


@pytest.mark.parametrize(
    ('clauses', 'status'),
    [
        ((AVOID, Unknown(text='foo')), Understanding.PARTLY),
        ((Unknown(text='foo'),), Understanding.NONE),
    ],
)
def test_an_answer_cannot_claim_to_have_understood_what_it_calls_unknown(clauses, status):
    claimed = Interpretation('a', Specification(clauses), 'x', Understanding.WHOLE)
    _, understood = parse_answer(answer_text(Question('a', 'x1'), claimed))
    assert understood.status is status


@given(JSON, st.text(max_size=30))
def test_whatever_is_sent_is_read_or_refused(value, text):
    fields = json.loads(answer_text(Question('a', 'x1'), WHOLE))
    name = list(fields)[len(text) % len(fields)]
    for data in (text, json.dumps(value), json.dumps({**fields, name: value})):
        for parse in (parse_question, parse_answer):
            with contextlib.suppress(LlmAstarError):
                parse(data)
