"""Whether a word of a sentence may be a word of a name: inflected or misspelt."""

from __future__ import annotations

from rapidfuzz.distance import OSA

from llm_astar_planner.instructions.model.vocabulary import is_known

ENDINGS = ('es', 'en', 's', 'n', 'e')
MIN_STEM = 4
MIN_MISSPELT = 5
# From this many letters on, two of them may be wrong, else one.
LONG_WORD = 8


def same_word(word: str, known: str) -> bool:
    """Return whether a word of a sentence may be a word of a name: inflected or misspelt."""
    if word == known:
        return True
    if word[0] != known[0] or len(known) < MIN_STEM:
        return False
    if undoubled(word) == undoubled(known) or (
        len(word) >= MIN_STEM and stem(word) == stem(known)
    ):
        return True
    return not is_known(word) and is_misspelt(word, known)


def is_misspelt(word: str, known: str) -> bool:
    """Return whether a word may be another one with wrong letters, or two letters swapped."""
    if min(len(word), len(known)) < MIN_MISSPELT and sorted(word) != sorted(known):
        return False
    allowed = 2 if len(known) >= LONG_WORD else 1
    return OSA.distance(word, known, score_cutoff=allowed) <= allowed


def undoubled(word: str) -> str:
    """Return a word with doubled letters written once: 'wal' and 'wall' are the same then."""
    return ''.join(a for a, b in zip(word, f'{word[1:]} ') if a != b)


def stem(word: str) -> str:
    """Return a word without the ending of a plural or a case."""
    if word.endswith('ies') and len(word) > MIN_STEM:
        return f'{word[:-3]}y'
    for ending in ENDINGS:
        if word.endswith(ending) and len(word) - len(ending) >= MIN_STEM:
            return word[: -len(ending)]
    return word
