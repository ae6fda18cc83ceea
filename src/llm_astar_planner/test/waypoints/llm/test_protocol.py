"""The request fields that adapt to an endpoint, and the errors that say why."""

from llm_astar_planner.waypoints.llm.protocol import Dialect
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
