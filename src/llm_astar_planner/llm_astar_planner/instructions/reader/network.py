# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The network in numpy: a bidirectional GRU reads a sentence, another GRU writes its meaning.

Its weights are `reader.npz`, which `training/llm_astar_reader` makes. Every token that is written
is one that the language of meanings allows there, of slots that the sentence has.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.instructions.reader.features import features
from llm_astar_planner.instructions.reader.meaning import (
    CLAUSES,
    CLOSE,
    EACH,
    END,
    ONE,
    REGIONS,
    TOKENS,
    UNKNOWN,
    WISH,
)

FILE = Path(__file__).with_name('reader.npz')
# The hashes of the words that were seen in training, in the same file.
WORDS = 'words'
LONGEST = 32
Array = NDArray[np.float32]
NUMBER = {token: n for n, token in enumerate(TOKENS)}
ABOUT = frozenset(token for token in TOKENS if token.startswith('U_'))


def kind_tokens() -> dict[str, frozenset[str]]:
    """Return the tokens of each kind; slots are all that there could be."""
    slots = {kind: {t for t in TOKENS if t[0] == kind and t[1:].isdigit()} for kind in 'RLSK'}
    region = {*REGIONS, 'START', 'GOAL', UNKNOWN, *slots['R']} - {EACH}
    clause = (CLAUSES.keys() - {*REGIONS, WISH}) | ABOUT
    kinds = {
        't': clause | {WISH, END}, 'c': clause, 'r': region, 'w': region | {'WALLS'},
        'f': region | {EACH}, 'v': region | {EACH, CLOSE}, 'm': region | {CLOSE},
        'p': slots['R'] | {UNKNOWN}, 's': slots['S'], 'l': slots['L'] | {'D'}, 'k': slots['K'] | {ONE},
    }  # fmt: skip
    return {name: frozenset(tokens) for name, tokens in kinds.items()}


KINDS = kind_tokens()


def after(stack: str, token: str) -> str:
    """Return what is expected after a token; `stack` is what was, the next one first."""
    kind, rest = stack[0], stack[1:]
    if token == CLOSE:
        return rest
    again = kind if kind in 'vm' else ''
    return CLAUSES.get(token, '') + again + rest + ('t' if kind == 't' else '')


@cache
def weights() -> Mapping[str, Array]:
    """Return the arrays of the network, read once."""
    with np.load(FILE) as arrays:
        return {n: arrays[n].astype(np.float32) for n in arrays.files if n != WORDS}


@cache
def known_words() -> frozenset[int]:
    """Return the hashes of the words that the network has seen."""
    with np.load(FILE) as arrays:
        return frozenset(map(int, arrays[WORDS]))


def gru(inputs: Array, name: str, state: Array) -> Array:
    """Return the states [n, length, size] of a GRU over inputs [n, length, size]."""
    table = weights()
    into = inputs @ table[name.format('weight_ih')].T + table[name.format('bias_ih')]
    turn, bias = table[name.format('weight_hh')].T, table[name.format('bias_hh')]
    states = np.empty((*inputs.shape[:2], state.shape[1]), np.float32)
    for at in range(inputs.shape[1]):
        reset_in, update_in, new_in = np.split(into[:, at], 3, axis=1)
        reset, update, new = np.split(state @ turn + bias, 3, axis=1)
        update = sigmoid(update_in + update)
        new = np.tanh(new_in + sigmoid(reset_in + reset) * new)
        states[:, at] = state = (1.0 - update) * new + update * state
    return states


def sigmoid(values: Array) -> Array:
    """Return the logistic function."""
    return np.asarray(0.5 + 0.5 * np.tanh(0.5 * values))


def encoded(sentences: Sequence[Sequence[str]]) -> Array:
    """Return sentences of one length as float32 [n, length, size]."""
    table = weights()
    rows = {
        token: sum(weight * table['words.weight'][row] for row, weight in features(token))
        for sentence in sentences
        for token in sentence
    }
    layer = np.array([[rows[token] for token in sentence] for sentence in sentences], np.float32)
    for n in (0, 1):
        size = table[f'encoder.weight_hh_l{n}'].shape[1]
        zero = np.zeros((len(sentences), size), np.float32)
        ahead = gru(layer, f'encoder.{{}}_l{n}', zero)
        back = gru(layer[:, ::-1], f'encoder.{{}}_l{n}_reverse', zero)[:, ::-1]
        layer = np.concatenate((ahead, back), axis=2)
    return layer


def meanings(
    sentences: Sequence[Sequence[str]], names: Sequence[Mapping[str, str]]
) -> list[tuple[list[str], float]]:
    """Return the meanings of sentences of one length, each with its log probability.

    The values of `names` are the slots that each of the sentences has.
    """
    table = weights()
    code = encoded(sentences)
    state = np.tanh(code.mean(axis=1) @ table['start.weight'].T + table['start.bias'])
    has = np.array([token[0] not in 'RLSK' or not token[1:].isdigit() for token in TOKENS])
    has = has | np.array([[token in mine.values() for token in TOKENS] for mine in names])
    stacks, written = ['t'] * len(sentences), [[] for _ in sentences]  # type: ignore[var-annotated]
    scores = np.zeros(len(sentences))
    last = np.full(len(sentences), len(TOKENS))
    for _ in range(LONGEST):
        state = gru(table['tokens.weight'][last][:, None], 'decoder.{}_l0', state)[:, 0]
        logs = token_logs(state, code)
        allowed = np.array([mask(stack[:1]) for stack in stacks]) & has
        # A list may have to end where a sentence has no slot left that fits.
        logs = np.where(allowed, logs, -np.inf)
        last = logs.argmax(axis=1)
        for n, token in enumerate(last):
            if stacks[n]:
                scores[n] += logs[n, token]
                stacks[n] = after(stacks[n], TOKENS[token]) if TOKENS[token] != END else ''
                written[n] += [TOKENS[token]] if TOKENS[token] != END else []
        if not any(stacks):
            break
    is_whole = np.isfinite(scores) & ~np.array(list(map(bool, stacks)))
    return [
        (tokens if whole else [], float(score))
        for tokens, whole, score in zip(written, is_whole, scores)
    ]


def token_logs(state: Array, code: Array) -> Array:
    """Return the log probability of each token [n, tokens] at a state of the decoder."""
    table = weights()
    scores = (code @ (state @ table['query.weight'].T)[:, :, None])[:, :, 0]
    share = np.exp(scores - scores.max(axis=1, keepdims=True))
    share /= share.sum(axis=1, keepdims=True)
    context = (share[:, None] @ code)[:, 0]
    mixed = np.tanh(np.hstack((state, context)) @ table['mix.weight'].T + table['mix.bias'])
    logits = mixed @ table['out.weight'].T + table['out.bias']
    logits -= logits.max(axis=1, keepdims=True)
    return np.asarray(logits - np.log(np.exp(logits).sum(axis=1, keepdims=True)))


@cache
def mask(kind: str) -> NDArray[np.bool_]:
    """Return which tokens are of a kind; all where nothing is expected any more."""
    return np.array([not kind or token in KINDS[kind] for token in TOKENS])
