"""The request fields that adapt to an endpoint, and the errors that say why."""

import pytest
from llm_astar_planner.waypoints.llm.protocol import Dialect, is_context_too_long
from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.source import SourceStatus


def refusal(body):
    return EndpointFailure(SourceStatus.ERROR, body, http=400, body=body)


def test_a_dialect_drops_one_field_after_the_other():
    dialect = Dialect(response_format='json_schema')
    everything = 'response_format, max_tokens and temperature are unknown'
    steps = []
    while dialect is not None:
        steps.append((dialect.response_format, dialect.tokens_field, dialect.temperature))
        dialect = dialect.adapted_to(refusal(everything))
    assert steps == [
        ('json_schema', 'max_tokens', 0.0),
        ('json_object', 'max_tokens', 0.0),
        ('text', 'max_tokens', 0.0),
        ('text', 'max_completion_tokens', 0.0),
        ('text', '', 0.0),
        ('text', '', None),
    ]
    assert Dialect().adapted_to(refusal('something else')) is None


@pytest.mark.parametrize(
    'words',
    [
        "This model's maximum context length is 4097 tokens",
        '{"code": "context_length_exceeded"}',
        'the request exceeds the available context size, try increasing it',
        'prompt is too long: 210000 tokens > 200000 maximum',
    ],
)
def test_the_errors_of_a_prompt_that_is_too_long_are_recognised(words):
    assert is_context_too_long(words)
    assert not is_context_too_long('max_tokens is unknown')
