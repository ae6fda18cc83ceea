"""The order in which the grammar reads the words of a clause, and what 'stop at' is in a route."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.words import word_set

NEG, FIRST, PRONOUN = 'NEG', 'FIRST', 'PRONOUN'
VERBS = word_set(
    'AVOID AROUND_VERB SKIP MISS VISIT ENTER PASSBY MOVE STAY USE CLOSE END PASS LEAVE '
    'WITHIN CLOSER APPROACH ALONG GIVE FETCH STOP STOPBY'
)
# Verbs of which a comma does not part the infinitive: 'vergiss nicht, A zu besuchen'.
GOVERNING = frozenset({NEG, 'AVOID', 'SKIP', 'MISS'})
# After these the route goes on; `ENROUTE` is 'on your way'.
ENROUTE = 'ENROUTE'
GOES_ON = word_set('VISIT STOP STOPBY THEN BEFORE END MOVE USE PASS PASSBY THROUGH ENTER')
# A verb after one of these belongs to it: 'before you enter A'.
ORDER_WORDS = frozenset({'BEFORE', 'AFTER', 'UNTIL', 'ONLYAFTER'})
# 'stop at A': the end or a visit; 'stop off at A': a visit, but 'do not stop at A' is none.
STOP, STOPBY, END = 'STOP', 'STOPBY', 'END'


def with_stops(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes with 'stop at' as the end of the route, or as a visit where it goes on.

    Where only conditions of the way follow ('stop at A and avoid B') nobody knows which.
    """
    result: list[Lexeme] = []
    goes_on = any(lexeme.kind == ENROUTE for lexeme in lexemes)
    is_limited = False
    for at in range(len(lexemes) - 1, -1, -1):
        lexeme = lexemes[at]
        if lexeme.kind == STOP and (at == 0 or lexemes[at - 1].kind != FIRST):
            kind = STOPBY if goes_on else STOP if is_limited else END
            lexeme = replace(lexeme, kind=kind)
        elif lexeme.kind == STOP:
            lexeme = replace(lexeme, kind=STOPBY)
        is_refused = at > 0 and lexemes[at - 1].kind in GOVERNING
        goes_on = goes_on or (lexeme.kind in GOES_ON and not is_refused)
        is_limited = is_limited or lexeme.kind in VERBS or lexeme.kind == NEG
        if lexeme.kind != ENROUTE:
            result.append(lexeme)
    return result[::-1]


def in_reading_order(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return a piece with its negation first and a verb at its end before what it governs."""
    lexemes = with_only_after(lexemes)
    negations = [lexeme for lexeme in lexemes if lexeme.kind == NEG]
    rest = [lexeme for lexeme in lexemes if lexeme.kind != NEG]
    order = next((n for n, one in enumerate(rest) if n and one.kind in ORDER_WORDS), None)
    if order is not None:
        head, tail = verb_first(rest[:order]), verb_first(rest[order + 1 :])
        return with_visits([*negations, *head, rest[order], *tail])
    return with_visits(negations + verb_first(rest))


def with_only_after(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return 'only enter A after B' as 'enter A only after B'."""
    kinds = [lexeme.kind for lexeme in lexemes]
    if kinds.count('ONLY') != 1 or 'AFTER' not in kinds:
        return lexemes
    return [
        replace(lexeme, kind='ONLYAFTER') if lexeme.kind == 'AFTER' else lexeme
        for lexeme in lexemes
        if lexeme.kind != 'ONLY'
    ]


def verb_first(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return lexemes with a verb at their end before them: 'die Küche meiden'.

    After another verb if that governs it: 'vergiss die Küche nicht zu besuchen'.
    """
    kinds = [lexeme.kind for lexeme in lexemes]
    others = [n for n, kind in enumerate(kinds[:-1]) if kind in VERBS]
    if not kinds or kinds[-1] not in VERBS or any(kinds[n] not in GOVERNING for n in others):
        return lexemes
    at = others[-1] + 1 if others else 0
    return [*lexemes[:at], lexemes[-1], *lexemes[at:-1]]


def with_visits(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return lexemes with 'drive' and 'to' as one, but not in 'drive to the north of A'."""
    result: list[Lexeme] = []
    for at, lexeme in enumerate(lexemes):
        before = result[-1].kind if result else ''
        after = [one.kind for one in lexemes[at + 1 : at + 3]]
        if before == 'MOVE' and lexeme.kind in ('THROUGH', 'TO') and after != ['SIDE', 'OF']:
            result[-1] = replace(result[-1], kind='VISIT')
        elif before == 'MOVE' and lexeme.kind == PRONOUN:
            result[-1:] = [replace(result[-1], kind='VISIT'), lexeme]
        else:
            result.append(lexeme)
    return result
