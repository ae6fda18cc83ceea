# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The parser of one clause: lark's LALR(1), linear in the number of lexemes.

Written for what lark 1.x and lark-parser 0.12, which the ROS wheels install, have in common.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark, Token
from lark.exceptions import UnexpectedInput, VisitError
from lark.lexer import Lexer as LarkLexer

from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.meaning import ClauseCallbacks, ParsedClause
from llm_astar_planner.instructions.grammar.selection import Unclear
from llm_astar_planner.instructions.grammar.vocabulary import KINDS

# Typed differently by the versions of lark.
Lexer: Any = LarkLexer
GRAMMAR = Path(__file__).with_name('clauses.lark')


class LexemeLexer(Lexer):  # type: ignore[misc]
    """Hands the parser lexemes that were made before."""

    def __init__(self, _: object) -> None:
        """Take lark's configuration of a lexer, of which nothing is needed."""

    def lex(self, data: Sequence[Lexeme]) -> Iterator[Token]:
        """Yield a token for each lexeme; one of a kind that the grammar lacks ends the parse."""
        for lexeme in data:
            yield Token(lexeme.kind if lexeme.kind in KINDS.valued else f'_{lexeme.kind}', lexeme)


@cache
def clause_parser() -> Any:  # noqa: ANN401
    """Return the parser, built when the first clause is read."""
    grammar = GRAMMAR.read_text(encoding='utf-8')
    return Lark(grammar, parser='lalr', lexer=LexemeLexer, transformer=ClauseCallbacks())


def parse_clause(lexemes: Sequence[Lexeme]) -> ParsedClause:
    """Return what the lexemes of one clause say. Raises Unclear where it cannot be said."""
    try:
        reading: ParsedClause = clause_parser().parse(lexemes)
    except VisitError as error:
        if isinstance(error.orig_exc, Unclear):
            raise error.orig_exc from error
        raise
    except UnexpectedInput as error:
        raise Unclear('') from error
    return reading
