"""Trains the readers and the checker from nothing, or goes on: `-m llm_astar_reader.train`.

Each round makes new sentences, mixes in those of people where their files are, and writes a
checkpoint, so that a run can be ended and resumed at any time. The weights are in `reader.npz`.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import time
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import torch
from llm_astar_planner.instructions.reader.network import PIECES, known_pieces
from torch import nn
from torch.nn import functional

from llm_astar_reader.generate import vocabulary
from llm_astar_reader.network import BEGIN, NUMBER, Pretrained, Reader, exported
from llm_astar_reader.people import known_words, misread, people
from llm_astar_reader.samples import Sample, batches

PAD = -100
# The greatest rate of learning, also that of layers that were trained before.
RATE, PRETRAINED_RATE, WARM = 2e-3, 5e-4, 0.02
# What is wrong of the checker counts less than what is wrong of the reader.
CHECKER_SHARE = 0.3
# What the parameters of layers that were trained before begin with, and those of the checker.
PRETRAINED_PARTS, CHECKER = ('word.', 'wide.', 'pos', 'eln.', 'layers.'), 'checker.'
DEVICE = 'cuda' if torch.cuda.is_available() else 'cpu'
# Of each network: how it is made, its seed, the share of people's sentences, wrong meanings.
NETWORKS: dict[str, tuple[Callable[[], nn.Module], int, float, int]] = {
    'first': (Pretrained, 2, 0.8, 3),
    'second': (Reader, 3, 0.85, 0),
}


def targets(meanings: Sequence[Sequence[str]]) -> tuple[torch.Tensor, torch.Tensor]:
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


def loss_of(network: nn.Module, batch: Sequence[Sample]) -> torch.Tensor:
    """Return what is to be made small: of the reader by tokens, of the checker by meanings."""
    sentences, meanings = zip(*batch)
    before, wanted = (part.to(DEVICE) for part in targets([some[0] for some in meanings]))
    if isinstance(network, Reader):
        return token_loss(network(sentences, before), wanted)
    logits, checked = network(sentences, before, meanings)
    right = torch.zeros_like(checked)
    right[:, 0] = 1.0
    # Which of several meanings it is, and whether one by itself is right.
    which = functional.cross_entropy(checked, right.argmax(1))
    alone = functional.binary_cross_entropy_with_logits(checked, right)
    return token_loss(logits, wanted) + CHECKER_SHARE * (which + alone)


def token_loss(logits: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """Return the loss of the tokens that are written."""
    return functional.cross_entropy(logits.flatten(0, 1), wanted.flatten(), ignore_index=PAD)


def train(name: str, minutes: float, out: Path, threads: int = 1) -> None:
    """Train one network for some minutes of computing in all."""
    torch.set_num_threads(threads)
    kind, seed, share, wrongs = NETWORKS[name]
    path = out / f'{name}.pt'
    torch.manual_seed(seed)
    network = initialised(kind()).to(DEVICE)
    groups = [
        {'params': [value], 'rate': PRETRAINED_RATE if key.startswith(PRETRAINED_PARTS) else RATE}
        for key, value in network.named_parameters()
    ]
    optimizer = torch.optim.AdamW(groups, lr=RATE, betas=(0.9, 0.98), weight_decay=0.02)
    state = {'round': 0, 'seconds': 0.0}
    if path.exists():
        saved = torch.load(path, map_location=DEVICE)
        network.load_state_dict(saved['network'])
        optimizer.load_state_dict(saved['optimizer'])
        state = saved['state']
    human = people()
    wrong = misread() if wrongs else {}
    human += [one for one in human if tuple(one[0]) in wrong]
    total = minutes * 60
    while state['seconds'] < total:
        began = time.process_time()
        draw = random.Random(f'{seed} {state["round"]}')
        losses = []
        network.train()
        for batch in batches(draw, human, share, wrongs, wrong):
            done = min(1.0, (state['seconds'] + time.process_time() - began) / total)
            for group in optimizer.param_groups:
                group['lr'] = group['rate'] * rate(done)
            loss = loss_of(network, batch)
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            losses.append(loss.item())
        seconds = state['seconds'] + time.process_time() - began
        state = {'round': state['round'] + 1, 'seconds': seconds}
        saved = {
            'network': network.state_dict(), 'optimizer': optimizer.state_dict(), 'state': state,
        }  # fmt: skip
        torch.save(saved, path.with_suffix('.new'))
        path.with_suffix('.new').replace(path)
        say(
            f'{name}, round {state["round"]}: loss {np.mean(losses):.4f}, '
            f'{seconds / 60:.1f} of {minutes:g} minutes'
        )


def rate(done: float) -> float:
    """Return the share of the learning rate when a share of the time is done."""
    return min(1.0, done / WARM + 0.05) * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * done)))


def initialised(network: nn.Module) -> nn.Module:
    """Return a network with the weights that it has before it is trained."""
    return network.with_minilm() if isinstance(network, Pretrained) else network


def export(out: Path) -> None:
    """Write the weights of all networks into one file."""
    arrays: dict[str, Any] = {PIECES: np.frombuffer('\n'.join(known_pieces()).encode(), np.uint8)}
    for name, (kind, *_) in NETWORKS.items():
        network = kind()
        network.load_state_dict(torch.load(out / f'{name}.pt', map_location='cpu')['network'])
        for key, value in exported(network).items():
            arrays[key if key.startswith(CHECKER) else f'{name}.{key}'] = value
    words = sorted(crc32(word.encode()) for word in vocabulary(with_nouns=False) | known_words())
    np.savez_compressed(out / 'reader.npz', words=np.array(words, np.uint32), **arrays)


def main() -> None:
    """Train the networks side by side."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, required=True)
    parser.add_argument('--minutes', type=float, default=35.0, help='of computing, for each')
    parser.add_argument('--only', choices=NETWORKS, help='one of the networks')
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    names = [args.only] if args.only else list(NETWORKS)
    made = get_context('spawn')
    running = [made.Process(target=train, args=(name, args.minutes, args.out)) for name in names]
    for one in running:
        one.start()
    for one in running:
        one.join()
    if all((args.out / f'{name}.pt').exists() for name in NETWORKS):
        export(args.out)


def say(text: str) -> None:
    """Print progress at once."""
    sys.stdout.write(f'{text}\n')
    sys.stdout.flush()


if __name__ == '__main__':
    main()
