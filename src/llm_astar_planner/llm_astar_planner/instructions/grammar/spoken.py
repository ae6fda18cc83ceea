# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers of several words before a unit: 'a hundred and forty centimetres' is 140 cm.

The lexicon knows numbers of one word: of 'setenta y cinco centímetros' it would take the 5 alone.
"""

import re
from collections.abc import Sequence

from llm_astar_planner.instructions.grammar.vocabulary import read_table
from llm_astar_planner.instructions.grammar.words import Word

UNIT = re.compile('([cz]enti|milli|deci|mili)?met(er|re|ro)n?s?|[cm]?m')
# The words for each number in all languages, and what joins them.
NUMBER_WORDS: dict[int, list[str]] = {
    int(n): words.split() for n, words in read_table('numbers').items()
}
NUMBERS = {word: n for n, words in NUMBER_WORDS.items() for word in words}
JOINTS = {'and', 'und', 'et', 'y'}
# What a German number in one word is made of: 'hundertfünfundsiebzig'.
PARTS = re.compile('|'.join(sorted({*NUMBERS, *JOINTS}, key=len, reverse=True)))


def with_spoken_numbers(words: Sequence[Word]) -> list[Word]:
    """Return words with each number of several before a unit as one word in digits."""
    found: list[Word] = []
    for word in words:
        if UNIT.fullmatch(word.text):
            found = with_last_number(found)
        found.append(word)
    return found


def with_last_number(words: list[Word]) -> list[Word]:
    """Return words with those of a number at their end as one word in digits."""
    at = len(words)
    while at and all(part in NUMBERS or part in JOINTS for part in parts(words[at - 1].text)):
        at -= 1
    while at < len(words) and words[at].text in JOINTS:
        at += 1
    said = [part for word in words[at:] for part in parts(word.text)]
    total = value(said)
    # One word alone is in the lexicon, but this one.
    is_several = len(said) > 1 or said == ['cien']
    if not is_several or said[-1] in JOINTS or total is None:
        return words
    return [*words[:at], Word(str(total), words[at].start, words[-1].end)]


def parts(text: str) -> list[str]:
    """Return the numbers that a word is made of; the word where it is made of something else."""
    found = PARTS.findall(text)
    return found if found and ''.join(found) == text else [text]


def value(said: Sequence[str]) -> int | None:
    """Return the number that words say, None where they are several numbers."""
    total, room = 0, 1000
    for before, word in zip(('', *said), said):
        number = NUMBERS.get(word, 0)
        if number == 100 and total < 10:
            total, room = 100 * max(1, total), 100
        elif number == 20 and total % 100 == 4:  # quatre-vingts
            total, room = total + 76, 20
        elif 0 < number < room:
            total += number
            # 'soixante-quinze', and what else may follow tens.
            room = 20 if number == 60 else 10 if number >= 20 else 0
        elif before == 'und' and number in range(20, 100, 10) and total % 100 < 10:
            total, room = total + number, 0
        elif number:
            return None
    return total
