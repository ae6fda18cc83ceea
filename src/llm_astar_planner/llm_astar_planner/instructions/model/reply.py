"""From the text of a model's reply to an interpretation; the same for live and replayed ones."""

from __future__ import annotations

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    not_understood,
    status_of,
)
from llm_astar_planner.instructions.model.answer import read_answer
from llm_astar_planner.instructions.model.grounding import grounded
from llm_astar_planner.instructions.transcript import Exchange


def interpret_reply(exchange: Exchange, places: Places) -> Interpretation:
    """Return what a model's reply says of its instruction, held against the sentence.

    A reply without clauses that can be read gives status NONE.
    """
    answer = read_answer(exchange.reply, places)
    if answer is None:
        nothing = not_understood(exchange.text, 'the reply holds no list of clauses')
        specification, status, detail = nothing.specification, nothing.status, nothing.detail
    else:
        specification, detail = grounded(answer.clauses, exchange.text, places)
        status = status_of(specification)
        if answer.unreadable:
            detail = f'{detail}; {answer.unreadable} clauses were unreadable'.removeprefix('; ')
    return Interpretation(
        exchange.text,
        specification,
        exchange.model,
        status,
        detail,
        exchange.seconds,
        exchange.prompt_tokens,
        exchange.output_tokens,
    )
