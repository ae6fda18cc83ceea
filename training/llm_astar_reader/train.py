"""Trains the reader from nothing, or goes on: `python -m llm_astar_reader.train --out DIR`.

Each round makes new sentences, mixes in those of people where their files are, and writes a
checkpoint, so that a run can be ended and resumed at any time. The weights are in `reader.npz`.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from zlib import crc32

import numpy as np
import torch
from llm_astar_planner.instructions.reader.lifting import SLOTS
from llm_astar_planner.instructions.reader.meaning import TOKENS
from torch.nn import functional

from llm_astar_reader.generate import made, noisy, vocabulary
from llm_astar_reader.network import Reader, exported
from llm_astar_reader.people import known_words, people

Words = list[str]
Pair = tuple[Words, Words]
NUMBER = {token: n for n, token in enumerate(TOKENS)}
BEGIN, PAD = len(TOKENS), -100
BATCH, ROUND, LONGEST, MOST_TOKENS = 96, 9_600, 40, 24
RATE = 2e-3


def renumbered(tokens: Words, meaning: Words, draw: random.Random) -> Pair | None:
    """Return a pair with its slots numbered anew; None where it has too many of them."""
    names: dict[str, str] = {}
    for token in tokens:
        if token[0] == '@':
            kind = 'R' if token[1] in 'ROGYX' else token[1]
            names.setdefault(f'{kind}{token[2:]}', kind)
    table: dict[str, str] = {}
    for kind, most in SLOTS.items():
        mine = [name for name, one in names.items() if one == kind]
        if len(mine) > most:
            return None
        # In order of mention, as they come in use, or in any order.
        numbers: Sequence[int] = draw.sample(range(1, most + 1), len(mine))
        if draw.random() < 0.4:
            numbers = range(1, len(mine) + 1)
        table |= {name: f'{kind}{n}' for name, n in zip(mine, numbers)}

    def shown(token: str) -> str:
        if token[0] != '@':
            return token
        kind = 'R' if token[1] in 'ROGYX' else token[1]
        return token[:2] + table[f'{kind}{token[2:]}'][1:]

    try:
        return [shown(token) for token in tokens], [table.get(t, t) for t in meaning]
    except KeyError:
        return None


def sample(draw: random.Random, human: list[Pair], share: float) -> Pair | None:
    """Return a pair for training: made, or a sentence of a person with noise."""
    if human and draw.random() < share:
        tokens, meaning = draw.choice(human)
        tokens = noisy([t for t in tokens if t != ',' or draw.random() > 0.2], draw)
        if draw.random() < 0.15:
            tokens = [*draw.choice((['please', ','], ['bitte'], ['ok', ',']))] + tokens
        if tokens and tokens[-1] == '.' and draw.random() < 0.5:
            tokens = tokens[:-1]
    else:
        tokens, meaning = made(draw)
    pair = renumbered(tokens, meaning, draw)
    if pair is None or not 0 < len(pair[0]) <= LONGEST or len(meaning) > MOST_TOKENS:
        return None
    if any(token not in NUMBER for token in pair[1]):
        return None
    return pair


def batches(draw: random.Random, human: list[Pair], share: float) -> list[list[Pair]]:
    """Return batches of sentences of one length each."""
    pairs = [pair for _ in range(ROUND) if (pair := sample(draw, human, share))]
    pairs.sort(key=lambda pair: len(pair[0]))
    found: list[list[Pair]] = []
    for _, group in itertools.groupby(pairs, key=lambda pair: len(pair[0])):
        some = list(group)
        draw.shuffle(some)
        found += [some[at : at + BATCH] for at in range(0, len(some), BATCH)]
    draw.shuffle(found)
    return found


def targets(meanings: Sequence[Words]) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the tokens before and the tokens to write, int64 [n, steps]."""
    steps = max(map(len, meanings)) + 1
    before = torch.zeros(len(meanings), steps, dtype=torch.long)
    wanted = torch.full((len(meanings), steps), PAD)
    for n, meaning in enumerate(meanings):
        row = torch.tensor([NUMBER[token] for token in meaning] + [0])
        wanted[n, : len(row)] = row
        before[n, 0] = BEGIN
        before[n, 1 : len(row)] = row[:-1]
    return before, wanted


def main() -> None:
    """Train for some minutes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, required=True)
    parser.add_argument('--minutes', type=float, default=20.0, help='of computing, in all')
    parser.add_argument('--people', type=float, default=0.45, help='share of their sentences')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--threads', type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / 'checkpoint.pt'
    torch.manual_seed(args.seed)
    network = Reader()
    optimizer = torch.optim.Adam(network.parameters(), lr=RATE, betas=(0.9, 0.99))
    state = {'round': 0, 'seconds': 0.0}
    if path.exists():
        saved = torch.load(path)
        network.load_state_dict(saved['network'])
        optimizer.load_state_dict(saved['optimizer'])
        state = saved['state']
    human = people()
    say(
        f'{len(human)} sentences of people, {sum(p.numel() for p in network.parameters())} weights'
    )
    words = sorted(crc32(word.encode()) for word in vocabulary(with_nouns=False) | known_words())
    total = args.minutes * 60
    while state['seconds'] < total:
        began = time.process_time()
        draw = random.Random(f'{args.seed} {state["round"]}')
        losses = []
        network.train()
        for batch in batches(draw, human, args.people):
            done = min(1.0, (state['seconds'] + time.process_time() - began) / total)
            for group in optimizer.param_groups:
                group['lr'] = RATE * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * done)))
            before, wanted = targets([meaning for _, meaning in batch])
            logits = network([tokens for tokens, _ in batch], before)
            loss = functional.cross_entropy(
                logits.flatten(0, 1), wanted.flatten(), ignore_index=PAD
            )
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            losses.append(loss.item())
        state = {
            'round': state['round'] + 1,
            'seconds': state['seconds'] + time.process_time() - began,
        }
        saved = {
            'network': network.state_dict(), 'optimizer': optimizer.state_dict(), 'state': state,
        }  # fmt: skip
        torch.save(saved, path.with_suffix('.new'))
        path.with_suffix('.new').replace(path)
        np.savez(args.out / 'reader.npz', words=np.array(words, np.uint32), **exported(network))
        say(
            f'round {state["round"]}: loss {np.mean(losses):.4f}, '
            f'{state["seconds"] / 60:.1f} of {args.minutes:g} minutes'
        )


def say(text: str) -> None:
    """Print progress at once."""
    sys.stdout.write(f'{text}\n')
    sys.stdout.flush()


if __name__ == '__main__':
    main()
