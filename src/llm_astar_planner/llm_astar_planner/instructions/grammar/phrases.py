"""A dictionary of phrases that finds the longest one at a word."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Generic, TypeVar

from llm_astar_planner.instructions.grammar.words import Word

Value = TypeVar('Value')
END = ''


class Phrases(Generic[Value]):
    """Phrases (tuples of comparable words), each with the values that were added under it.

    It is a trie: to look for the longest phrase at a word takes as many steps as that phrase has
    words. `skipped` words, articles, may stand within a phrase without being part of it.
    """

    def __init__(self, skipped: Collection[str] = ()) -> None:
        """Start without phrases."""
        self.skipped = frozenset(skipped)
        self.words: set[str] = set()
        self._root: dict[str, Any] = {}

    def add(self, phrase: Sequence[str], value: Value) -> None:
        """Add a value under a phrase; the same value counts once."""
        node = self._root
        for word in phrase:
            node = node.setdefault(word, {})
            self.words.add(word)
        values = node.setdefault(END, [])
        if phrase and value not in values:
            values.append(value)

    @property
    def starts(self) -> frozenset[str]:
        """The first words of all phrases."""
        return frozenset(self._root)

    def longest(self, words: Sequence[Word], start: int) -> tuple[int, list[Value]]:
        """Return how many words the longest phrase at `start` takes, and its values."""
        node, best, values = self._root, 0, []
        for index in range(start, len(words)):
            text = words[index].text
            if text in node:
                node = node[text]
                if END in node:
                    best, values = index + 1 - start, node[END]
            elif index == start or text not in self.skipped:
                break
        return best, values
