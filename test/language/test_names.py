"""A sentence with a name that is not on the map is never wholly understood.

800 sentences, or 8,000 with LLM_ASTAR_JUDGE_ALL; `pytest -s` prints those that are.
"""

import os

from language import names
from language.judge import read, say
from language.mutations import ENGLISH
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter

NUMBER = 8000 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 800


def test_no_sentence_with_an_unknown_name_is_wholly_understood():
    interpreter = GrammarInterpreter()
    found = [
        (unknown, read(interpreter, text, ENGLISH.places)) for text, unknown in names.cases(NUMBER)
    ]
    whole = [(unknown, reading) for unknown, reading in found if reading.is_certain]
    asked = sum(reading.asks for _, reading in found)
    say(f'{len(found)} sentences: {len(whole)} wholly understood, {asked} asked about')
    for unknown, reading in whole:
        say(f'{unknown!r}: {reading.text!r} -> {reading.words()}')
    assert not whole
