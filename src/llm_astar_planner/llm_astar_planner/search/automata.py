"""Deterministic automata over the regions that a path is in (to be replaced)."""

from __future__ import annotations


class Automaton:
    """An automaton."""


def visits(groups: tuple[tuple[int, ...], ...]) -> Automaton:
    """Visit."""
    raise NotImplementedError


def before(first: int, second: int, price: float) -> Automaton:
    """Before."""
    raise NotImplementedError


def then(first: int, second: int) -> Automaton:
    """Then."""
    raise NotImplementedError


def never_after(first: int, second: int, price: float) -> Automaton:
    """Never after."""
    raise NotImplementedError


def entries(deep: int, near: int, at_least: int, at_most: int | None, price: float) -> Automaton:
    """Count."""
    raise NotImplementedError
