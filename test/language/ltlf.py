"""Linear temporal logic on finite traces, by its textbook definition.

A formula is a text in prefix notation, as 'F & a F b', or what `parse` makes of it. Operators:
! & | i (implies) e (equivalent) X (next) N (weak next) F (eventually) G (always) U (until)
W (weak until) R (release) M (strong release); all else is an atom. At the end of a trace nothing
holds next, and everything holds weakly next.

Many traces are evaluated together: an atom is a table, bool [traces, positions], and `alive` of
the same shape says which positions a trace has, the first ones of its row.
"""

import numpy as np

UNARY = {'!', 'X', 'N', 'F', 'G'}
BINARY = {'&', '|', 'i', 'e', 'U', 'W', 'R', 'M'}


def parse(text):
    """Return a formula in prefix notation as nested tuples; ValueError where it is none."""
    words = text.split()
    formula, rest = _parse(words)
    if rest:
        raise ValueError(f'{text!r}: {" ".join(rest)!r} is left over')
    return formula


def _parse(words):
    if not words:
        raise ValueError('the formula ends too early')
    head, rest = words[0], words[1:]
    if head in UNARY:
        inner, rest = _parse(rest)
        return (head, inner), rest
    if head in BINARY:
        left, rest = _parse(rest)
        right, rest = _parse(rest)
        return (head, left, right), rest
    return head, rest


def atoms(formula):
    """Return the atoms of a formula in the order of their first appearance."""
    if isinstance(formula, str):
        return [formula]
    return list(dict.fromkeys(atom for part in formula[1:] for atom in atoms(part)))


def weakened(formula):
    """Return a formula whose until is weak where both sides are an atom or its negation.

    'stay away from b until you have been at a' does not say that a is visited. What always holds
    from the next position on holds where there is none.
    """
    if isinstance(formula, str):
        return formula
    head, *parts = formula
    parts = [weakened(part) for part in parts]
    if head == 'U' and all(_is_literal(part) for part in parts):
        head = 'W'
    if head == 'X' and parts[0][0] == 'G':
        head = 'N'
    return (head, *parts)


def _is_literal(formula):
    return isinstance(formula, str) or (formula[0] == '!' and isinstance(formula[1], str))


def holds(formula, letters, alive):
    """Tell for each trace whether a formula holds at its first position: bool [traces]."""
    return everywhere(formula, letters, alive)[:, 0]


def everywhere(formula, letters, alive):
    """Tell where a formula holds: bool [traces, positions]; False where a trace has ended."""
    if isinstance(formula, str):
        return letters[formula] & alive
    head, *parts = formula
    tables = [everywhere(part, letters, alive) for part in parts]
    one, two = tables[0], tables[-1]
    match head:
        case '!':
            return ~one & alive
        case '&':
            return one & two
        case '|':
            return one | two
        case 'i':
            return (~one | two) & alive
        case 'e':
            return (one == two) & alive
        case 'X':
            return np.pad(one[:, 1:], ((0, 0), (0, 1)))
        case 'N':
            return (np.pad(one[:, 1:], ((0, 0), (0, 1))) | is_last(alive)) & alive
        case 'F':
            return _backwards(one, alive, alive, weak=False)
        case 'G':
            return _backwards(np.zeros_like(one), one, alive, weak=True)
        case 'U' | 'W':
            return _backwards(two, one, alive, weak=head == 'W')
        case 'R':
            return _backwards(one & two, two, alive, weak=True)
        case 'M':
            return _backwards(one & two, two, alive, weak=False)
    raise ValueError(f'{head!r} is no operator')


def _backwards(goal, meanwhile, alive, *, weak):
    """Evaluate 'meanwhile until goal' from the last position to the first."""
    result = np.zeros_like(alive)
    after = np.full(len(alive), weak)
    for position in range(alive.shape[1] - 1, -1, -1):
        here = goal[:, position] | (meanwhile[:, position] & after)
        result[:, position] = here & alive[:, position]
        after = np.where(alive[:, position], here, weak)
    return result


def is_last(alive):
    """Tell which positions are the last ones of their traces."""
    return alive & ~np.pad(alive[:, 1:], ((0, 0), (0, 1)))
