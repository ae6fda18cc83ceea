"""Understands route instructions by a grammar, without a model, in a millisecond."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.grammar.clauses import understand
from llm_astar_planner.instructions.grammar.lexer import Lexer
from llm_astar_planner.instructions.grammar.lexicon import lexicon
from llm_astar_planner.instructions.grammar.vocabulary import LANGUAGES, vocabulary
from llm_astar_planner.instructions.grammar.words import Word, read_words
from llm_astar_planner.instructions.interpretation import (
    InstructionError,
    Interpretation,
    Understanding,
    clean_instruction,
    not_understood,
)

NAME = 'grammar'
# A language is tried if it knows at least this share of the words that the best one knows.
WORTHWHILE = 0.5
# Languages tried of one text, and words and signs that it may have: 500 characters of brackets
# are no instruction.
MOST_LANGUAGES = 2
MOST_WORDS = 160


class GrammarInterpreter:
    """Understands instructions by vocabulary tables and a grammar: an Interpreter.

    It answers WHOLE or IRRELEVANT only if every word was read; of other instructions it gives the
    clauses that were read wholly, and Unknown for the rest.
    """

    name = NAME

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:  # noqa: ARG002
        """Say what was understood of a text; takes milliseconds, whatever the time limit.

        Never raises: a text that is too long is not understood.
        """
        began = time.perf_counter()
        try:
            clean = clean_instruction(text)
        except InstructionError as error:
            return not_understood(text[:80], str(error), NAME)
        if not clean:
            return Interpretation('', understood_by=NAME, status=Understanding.IRRELEVANT)
        words = read_words(clean)
        if len(words) > MOST_WORDS:
            return not_understood(clean, f'more than {MOST_WORDS} words and signs', NAME)
        best, most = not_understood(clean, '', NAME), -1.0
        for language in languages_of(words):
            understood, share = understand(clean, lexer_for(places, language))
            if share > most:
                best, most = understood, share
            if understood.is_whole:
                break
        return replace(best, seconds=time.perf_counter() - began)


@lru_cache(maxsize=64)
def lexer_for(places: Places, language: str) -> Lexer:
    """Return what reads instructions about some places in a language."""
    return Lexer(lexicon(places), vocabulary(language))


def languages_of(words: Sequence[Word]) -> Iterator[str]:
    """Yield the languages that a text may be in, the likeliest first, English where none is."""
    known = {
        language: sum(vocabulary(language).knows(word.text) for word in words if word.is_letters)
        for language in LANGUAGES
    }
    ordered = sorted(LANGUAGES, key=lambda language: -known[language])[:MOST_LANGUAGES]
    least = WORTHWHILE * known[ordered[0]]
    return (language for language in ordered if language == ordered[0] or known[language] > least)
