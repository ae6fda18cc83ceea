"""Misspelt words corrected by rapidfuzz, only where nothing else can be meant."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

# A word of a place or of the vocabulary is recognised with this many errors (letters left out,
# added, changed or exchanged) from this length on. In shorter words another word is too near:
# there only two exchanged letters and a doubled one count as an error.
SHORTEST = 4
LENGTHS = ((6, 1), (9, 2))


def corrections(word: str, known: Iterable[str]) -> list[str]:
    """Return the known words that a misspelt word may stand for, the nearest ones first."""
    from rapidfuzz import process  # noqa: PLC0415 (loaded when the first word is unknown)
    from rapidfuzz.distance import OSA  # noqa: PLC0415

    if len(word) < SHORTEST:
        return []
    scorer: Any = OSA.distance
    near = process.extract(word, known, scorer=scorer, score_cutoff=LENGTHS[-1][1], limit=8)
    return [other for other, distance, _ in near if is_misspelt(word, other, int(distance))]


def is_misspelt(word: str, other: str, distance: int) -> bool:
    """Whether a word may be another one with so many errors."""
    if word[0] != other[0] or word.startswith(other) or other.startswith(word):
        return squeezed(word) == squeezed(other)
    allowed = max((errors for length, errors in LENGTHS if len(other) >= length), default=0)
    # Two errors at the end are another word: 'pharmacist' is no pharmacy.
    if distance <= allowed and (distance == 1 or word[-1] == other[-1]):
        return True
    is_exchange = sorted(word) == sorted(other) and distance == 1
    return is_exchange or squeezed(word) == squeezed(other)


def squeezed(word: str) -> str:
    """Return a word with each doubled letter once."""
    return ''.join(letter for letter, before in zip(word, f' {word}') if letter != before)
