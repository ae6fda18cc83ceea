# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The pretrained encoder in numpy: the first layers of MiniLM, which have learnt to read orders.

MiniLM (Wang et al., NeurIPS 2020, arXiv 2002.10957) knows English from reading much of it, so a
word that no sentence of the training had is not new to it. Its weights began as those of
all-MiniLM-L6-v2 (sentence-transformers, Apache-2.0). Layers are as in BERT. It reads pieces of
words; a slot of a lifted sentence is one piece.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
# The first pieces: what begins and ends a sentence, and what stands for an unknown one.
BEGIN, END, UNKNOWN = '<begin>', '<end>', '<unknown>'
# What a piece begins with that goes on with a word.
INNER = '##'
HEADS, EPSILON = 12, 1e-12
# The most pieces of one word.
MOST_OF_A_WORD = 8
# Weights of four bits have a scale for each of so many.
GROUP = 64


def pieces(word: str, known: Mapping[str, int]) -> list[str]:
    """Return a word in the longest known pieces from the left; UNKNOWN for a letter not known."""
    found, start = [], 0
    while start < len(word):
        mark = INNER if start else ''
        ends = range(len(word), start, -1)
        end = next((end for end in ends if mark + word[start:end] in known), start + 1)
        piece = mark + word[start:end]
        found.append(piece if piece in known else UNKNOWN)
        start = end
    return found


def spelt(tokens: Sequence[str], known: Mapping[str, int]) -> list[str]:
    """Return the pieces of a lifted sentence; a slot is one."""
    inner = [piece for token in tokens for piece in pieces(token, known)[:MOST_OF_A_WORD]]
    return [BEGIN, *inner, END]


def encoded(
    shown: Sequence[Sequence[str]], known: Mapping[str, int], table: Mapping[str, Array]
) -> Array:
    """Return the states [n, length, size] of sentences in pieces, all of one length."""
    index = np.array([[known[piece] for piece in sentence] for sentence in shown])
    states = table['word.weight'][index] @ table['wide.weight'].T + table['pos'][: index.shape[1]]
    # All pieces in one table: a product with a few rows takes as long as one with many.
    states = normal(states.reshape(index.size, -1), table, 'eln')
    for n in range(sum(name.endswith('.q.weight') for name in table)):
        states = layer(states, len(shown), table, f'layers.{n}.')
    return states.reshape(*index.shape, -1)


def layer(states: Array, count: int, table: Mapping[str, Array], name: str) -> Array:
    """Return the states [pieces of all, size] of so many sentences after one more layer."""

    def head(part: str) -> Array:
        found = linear(states, table, name + part)
        return found.reshape(count, -1, HEADS, found.shape[1] // HEADS).swapaxes(1, 2)

    query, key, value = head('q'), head('k'), head('v')
    scores = query @ key.swapaxes(2, 3) / np.sqrt(np.float32(query.shape[-1]))
    mixed = (softmax(scores) @ value).swapaxes(1, 2).reshape(states.shape)
    states = normal(states + linear(mixed, table, f'{name}ao'), table, f'{name}aln')
    inner = linear(states, table, f'{name}fi')
    # GELU by its usual approximation.
    inner *= 0.5 + 0.5 * np.tanh(0.7978845608 * (inner + 0.044715 * inner * inner * inner))
    return normal(states + linear(inner, table, f'{name}fo'), table, f'{name}oln')


def linear(inputs: Array, table: Mapping[str, Array], name: str) -> Array:
    """Return a linear layer of inputs."""
    return np.asarray(inputs @ table[f'{name}.weight'].T + table[f'{name}.bias'])


def softmax(values: Array) -> Array:
    """Return shares along the last axis."""
    found = np.exp(values - values.max(axis=-1, keepdims=True))
    return np.asarray(found / found.sum(axis=-1, keepdims=True))


def normal(states: Array, table: Mapping[str, Array], name: str) -> Array:
    """Return states with mean 0 and variance 1, times a weight, and a bias."""
    middle = states - states.mean(axis=-1, keepdims=True)
    spread = np.sqrt((middle * middle).mean(axis=-1, keepdims=True) + EPSILON)
    return np.asarray(middle / spread * table[f'{name}.weight'] + table[f'{name}.bias'])


def unpacked(codes: NDArray[np.uint8], scales: NDArray[np.float32]) -> Array:
    """Return a table [rows, columns] of numbers of four bits, two in a byte of `codes`.

    `scales` [rows, columns / GROUP] are of each GROUP of a row.
    """
    both = np.stack((codes & 15, codes >> 4), axis=-1).reshape(*scales.shape, GROUP)
    return np.asarray((both.astype(np.float32) - 8) * scales[..., None]).reshape(len(codes), -1)
