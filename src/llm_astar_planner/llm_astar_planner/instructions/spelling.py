# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""How many errors make one word of another."""

from __future__ import annotations


def errors_between(word: str, other: str) -> int:
    """Return how many letters were left out, added, changed or exchanged with the next one.

    No letter is changed twice: the optimal string alignment distance.
    """
    rows = [list(range(len(other) + 1))]
    for i, letter in enumerate(word, start=1):
        row = [i]
        for j, meant in enumerate(other, start=1):
            errors = min(rows[-1][j] + 1, row[-1] + 1, rows[-1][j - 1] + (letter != meant))
            if i > 1 and j > 1 and (letter, word[i - 2]) == (other[j - 2], meant):
                errors = min(errors, rows[-2][j - 2] + 1)
            row.append(errors)
        rows.append(row)
    return rows[-1][-1]
