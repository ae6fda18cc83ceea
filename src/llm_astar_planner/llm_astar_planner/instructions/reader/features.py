# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What the network knows a token by: the whole word and its parts, hashed, so that none is new."""

from functools import lru_cache
from zlib import crc32

BUCKETS = 8192
# Letters of the parts of words.
PARTS = (3, 4)


@lru_cache(maxsize=8192)
def features(token: str) -> tuple[tuple[int, float], ...]:
    """Return the rows of the table of embeddings that a token is the sum of, with weights.

    A slot, '@R3', is its kind and its number.
    """
    if token[0] == '@':
        return bucket(token[:2]), bucket(f'#{token[2:]}')
    padded = f'<{token}>'
    parts = [padded[at : at + n] for n in PARTS for at in range(len(padded) - n + 1)]
    return (bucket(f'={token}'), *(bucket(part, 1.0 / len(parts)) for part in parts))


def bucket(text: str, weight: float = 1.0) -> tuple[int, float]:
    """Return the row of a text, and a weight."""
    return crc32(text.encode()) % BUCKETS, weight
