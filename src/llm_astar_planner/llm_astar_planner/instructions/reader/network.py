# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The networks in numpy: two readers write the meaning of a sentence, a checker weighs one.

Each reads a sentence by an encoder of its own, MiniLM's layers (`encoder`) or a bidirectional
GRU. A GRU of the reader writes tokens that the language of meanings allows, of slots that the
sentence has. The checker looks at what the first reader has read: it reads a meaning in the light
of the sentence, and the sentence in that of the meaning. Their weights are `reader.npz`, which
`training/llm_astar_reader` makes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.instructions.reader import encoder
from llm_astar_planner.instructions.reader.encoder import linear, softmax
from llm_astar_planner.instructions.reader.lifting import SIGN, slot_name
from llm_astar_planner.instructions.reader.meaning import END, KINDS, TOKENS, after

FILE = Path(__file__).with_name('reader.npz')
# The hashes of the words that were seen in training, in the same file.
WORDS = 'words'
# The pieces of words that the pretrained encoder knows, in the same file, one a line.
PIECES = 'pieces'
# What the scales of the rows of a table are called by, after its name.
SCALE = '.scale'
# The parts of a GRU, what those of its way back are called after, and those of both ways.
GRU = ('weight_ih', 'bias_ih', 'weight_hh', 'bias_hh')
REVERSE, BOTH = '_reverse', '_both'
READERS = ('first', 'second')
PRETRAINED = READERS[0]
LONGEST = 32
Array = NDArray[np.float32]
NUMBER = {token: n for n, token in enumerate(TOKENS)}
# Of the table of embeddings: its rows, and the letters of the parts of words.
BUCKETS, PARTS = 8192, (3, 4)


@cache
def weights(network: str) -> Mapping[str, Array]:
    """Return the arrays of one of READERS or the checker, read once.

    Of a table the file has whole numbers of one byte, and a scale for each row.
    """
    with np.load(FILE) as arrays:
        names = [name for name in arrays.files if name.startswith(f'{network}.')]
        values = {name.partition('.')[2]: arrays[name] for name in names}
    scales = {
        name: values.pop(name).astype(np.float32) for name in [*values] if name.endswith(SCALE)
    }
    found = {name: scaled(value, scales.get(name + SCALE)) for name, value in values.items()}
    for back in [name for name in found if name.endswith(REVERSE)]:
        ahead = back.removesuffix(REVERSE)
        found[ahead + BOTH] = np.stack((found.pop(ahead), found.pop(back)))
    return found


def scaled(value: NDArray[Any], scale: Array | None) -> Array:
    """Return the numbers that whole ones of a file stand for, bytes for two of four bits each."""
    if scale is None:
        return value.astype(np.float32)
    return encoder.unpacked(value, scale) if value.dtype == np.uint8 else value * scale


@cache
def known_pieces() -> Mapping[str, int]:
    """Return the numbers of the pieces that the pretrained encoder knows."""
    with np.load(FILE) as arrays:
        return {piece: n for n, piece in enumerate(bytes(arrays[PIECES]).decode().split('\n'))}


@cache
def known_words() -> frozenset[int]:
    """Return the hashes of the words that the networks have seen."""
    with np.load(FILE) as arrays:
        return frozenset(map(int, arrays[WORDS]))


def gru(inputs: Array, table: Mapping[str, Array], name: str, state: Array) -> Array:
    """Return the states [..., n, length, size] of GRUs over inputs [..., n, length, size].

    Several GRUs, one for each of the first indices, take their steps together.
    """
    into, into_bias, turn, turn_bias = (table[name.format(part)] for part in GRU)
    told = inputs @ into.swapaxes(-1, -2)[..., None, :, :] + into_bias[..., None, None, :]
    turn, turn_bias = turn.swapaxes(-1, -2), turn_bias[..., None, :]
    size = state.shape[-1]
    states = np.empty((*inputs.shape[:-1], size), np.float32)
    for at in range(inputs.shape[-2]):
        now, before = told[..., at, :], state @ turn + turn_bias
        gates = sigmoid(now[..., : 2 * size] + before[..., : 2 * size])
        new = np.tanh(now[..., 2 * size :] + gates[..., :size] * before[..., 2 * size :])
        states[..., at, :] = state = new + gates[..., size:] * (state - new)
    return states


def both_ways(inputs: Array, table: Mapping[str, Array], name: str) -> Array:
    """Return the states of a bidirectional GRU over inputs [n, length, size]."""
    name += BOTH
    zero = np.zeros((2, len(inputs), table[name.format('weight_hh')].shape[-1]), np.float32)
    ahead, back = gru(np.stack((inputs, inputs[:, ::-1])), table, name, zero)
    return np.concatenate((ahead, back[:, ::-1]), axis=2)


def sigmoid(values: Array) -> Array:
    """Return the logistic function."""
    return np.asarray(0.5 + 0.5 * np.tanh(0.5 * values))


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


def encoded(sentences: Sequence[Sequence[str]], table: Mapping[str, Array]) -> Array:
    """Return sentences of one length as float32 [n, length, size]."""
    rows = {
        token: sum(weight * table['words.weight'][row] for row, weight in features(token))
        for sentence in sentences
        for token in sentence
    }
    layer = np.array([[rows[token] for token in sentence] for sentence in sentences], np.float32)
    for n in (0, 1):
        layer = both_ways(layer, table, f'encoder.{{}}_l{n}')
    return layer


@dataclass(frozen=True)
class Reading:
    """Sentences of one length as a reader has read them, to be asked for their meanings."""

    table: Mapping[str, Array]
    shown: Sequence[Sequence[str]]
    code: Array
    state: Array

    def step(self, state: Array, last: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the next state and the log probability of each token [n, tokens]."""
        table = self.table
        state = gru(table['tokens.weight'][last][:, None], table, 'decoder.{}_l0', state)[:, 0]
        scores = (self.code @ (state @ table['query.weight'].T)[:, :, None])[:, :, 0]
        context = (softmax(scores)[:, None] @ self.code)[:, 0]
        mixed = np.tanh(linear(np.hstack((state, context)), table, 'mix'))
        return state, np.log(softmax(linear(mixed, table, 'out')) + 1e-12)

    def log_probabilities(self, meanings: Sequence[Sequence[str]]) -> NDArray[np.float64]:
        """Return the log probability of a meaning of each sentence, all of one length."""
        state, last = self.state, np.full(len(self.shown), len(TOKENS))
        found = np.zeros(len(self.shown))
        for tokens in columns(meanings):
            state, logs = self.step(state, last)
            last = np.array([NUMBER[token] for token in tokens])
            found += logs[np.arange(len(last)), last]
        return found

    def written(self, names: Sequence[Mapping[str, str]]) -> list[tuple[list[str], float]]:
        """Return the likeliest meaning of each sentence with its log probability, [] for none.

        The values of `names` are the slots that each of the sentences has.
        """
        has = np.array([token[0] not in 'RLSK' or not token[1:].isdigit() for token in TOKENS])
        has = has | np.array([[token in mine.values() for token in TOKENS] for mine in names])
        count = len(self.shown)
        stacks, found = ['t'] * count, [[] for _ in names]  # type: ignore[var-annotated]
        scores, state, last = np.zeros(count), self.state, np.full(count, len(TOKENS))
        for _ in range(LONGEST):
            state, logs = self.step(state, last)
            allowed = np.array([mask(stack[:1]) for stack in stacks]) & has
            # A list may have to end where a sentence has no slot left that fits.
            logs = np.where(allowed, logs, -np.inf)
            last = logs.argmax(axis=1)
            for n, token in enumerate(last):
                if stacks[n]:
                    scores[n] += logs[n, token]
                    stacks[n] = after(stacks[n], TOKENS[token]) if TOKENS[token] != END else ''
                    found[n] += [TOKENS[token]] if TOKENS[token] != END else []
            if not any(stacks):
                break
        is_whole = np.isfinite(scores) & ~np.array(list(map(bool, stacks)))
        return [
            (tokens if whole else [], float(score))
            for tokens, whole, score in zip(found, is_whole, scores)
        ]


def columns(meanings: Sequence[Sequence[str]]) -> Iterator[Sequence[str]]:
    """Yield the tokens of meanings of one length step by step, and the end."""
    yield from zip(*meanings)
    yield [END] * len(meanings)


def reading(name: str, sentences: Sequence[Sequence[str]]) -> Reading:
    """Return a sentence with its slots numbered in several ways, as one of READERS reads it."""
    table, shown = weights(name), sentences
    if name == PRETRAINED:
        shown = [encoder.spelt(one, known_pieces()) for one in sentences]
        code = encoder.encoded(shown, known_pieces(), table)
    else:
        code = encoded(sentences, table)
    return Reading(table, shown, code, np.tanh(linear(code.mean(axis=1), table, 'start')))


def agreement(read: Reading, meanings: Sequence[Sequence[str]]) -> NDArray[np.float64]:
    """Return how sure the checker is that each sentence has its meaning, as a log odds.

    It looks at what the PRETRAINED reader has read; meanings are of one length.
    """
    table = weights('checker')
    code = linear(read.code, table, 'view')
    tokens = [[*meaning, END] for meaning in meanings]
    links = np.array([links_of(*pair) for pair in zip(read.shown, tokens)], np.float32)
    index = np.array([[NUMBER[token] for token in meaning] for meaning in tokens])
    inputs = np.concatenate((table['tokens.weight'][index], links @ code), axis=2)
    states = both_ways(inputs, table, 'meaning.{}_l0')
    asked = states @ table['query.weight'].T
    scores = np.asarray(asked @ code.transpose(0, 2, 1), np.float32)
    sides = []
    for name, mine, other in (
        ('meaning_side', states, softmax(scores) @ code),
        ('sentence_side', code, softmax(scores.transpose(0, 2, 1)) @ states),
    ):
        joint = np.concatenate((mine, other, mine * other), axis=2)
        side = np.tanh(linear(joint, table, name))
        sides += [side.max(axis=1), side.mean(axis=1)]
    mixed = np.tanh(linear(np.hstack(sides), table, 'mix'))
    return linear(mixed, table, 'out')[:, 0].astype(float)


def links_of(sentence: Sequence[str], meaning: Sequence[str]) -> list[list[float]]:
    """Return, for each token of a meaning, its share of each token of the sentence."""
    names = [slot_name(token) if token[0] == SIGN else '' for token in sentence]
    return [[(name == token) / max(1, names.count(token)) for name in names] for token in meaning]


@cache
def mask(kind: str) -> NDArray[np.bool_]:
    """Return which tokens are of a kind; all where nothing is expected any more."""
    return np.array([not kind or token in KINDS[kind] for token in TOKENS])
