"""Train the waypoint model: resumable, seeded, on a CPU or a GPU.

`python -m llm_astar_training.train --out out/training` trains from nothing, or goes on from the
last checkpoint in that folder, and writes checkpoint.pt, curve.csv and the exported model.npz.
Ctrl-C ends it after the step at hand with all of these written.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from llm_astar_planner.waypoints.learned.features import featurise
from torch import Tensor
from torch.nn import functional as fn
from tqdm import tqdm

from llm_astar_training.batches import Batch, held_out, step_batch
from llm_astar_training.export import export
from llm_astar_training.judge import greedy_routes, valid_ratio
from llm_astar_training.maps import RECIPE
from llm_astar_training.network import Network, Shape

RATE = 1.5e-3
WARM_UP_STEPS = 300
DECAY = 0.02
MOST_GRADIENT = 1.0
# The running mean of the weights, which is what is judged and exported.
MEAN = 0.999
AHEAD = 3


class CheckpointError(ValueError):
    """A checkpoint that another run made; the message names it and what differs."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; an interrupted run exits with 130."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.steps <= 0 and options.minutes <= 0:
        parser.error(f'--minutes: {options.minutes} is not above 0')
    torch.set_num_threads(options.threads)
    try:
        trainer = Trainer(options)
    except CheckpointError as error:
        parser.error(str(error))
    if trainer.progress >= 1:
        tqdm.write(f'{trainer.out}: is trained to the end; ask for more, or name another --out')
    elif not trainer.run():
        tqdm.write('Interrupted: the same command goes on from here.')
        raise SystemExit(130)


class Trainer:
    """Network, optimiser, running mean and the clock, kept in one checkpoint."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Start anew or from the checkpoint in the folder. Raises CheckpointError."""
        self.options = options
        self.out = Path(options.out)
        self.out.mkdir(parents=True, exist_ok=True)
        self.device = torch.device('cuda' if torch.cuda.is_available() else 'cpu')
        torch.manual_seed(options.seed)
        self.network = Network(Shape(width=options.width, layers=options.layers))
        self.network.to(self.device)
        self.mean = {k: v.detach().clone() for k, v in self.network.state_dict().items()}
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), RATE, (0.9, 0.98), weight_decay=DECAY
        )
        self.step, self.maps, self.seconds = 0, 0, 0.0
        self._resume()
        self.held_out = held_out(options.held_out)

    @property
    def progress(self) -> float:
        """How much of the training is done, 0 to 1."""
        if self.options.steps:
            return self.step / self.options.steps
        return self.seconds / (60 * self.options.minutes)

    def run(self) -> bool:
        """Train, judging and saving on the way; tell whether it came to the end."""
        bar = tqdm(total=100, unit='%', initial=int(100 * self.progress))
        losses: list[float] = []
        saved = clock = time.monotonic()
        with _ending_on_interrupt() as asked:
            for batch in self._batches():
                losses.append(self._learn(batch))
                self.step += 1
                self.maps += len(batch.size)
                now = time.monotonic()
                self.seconds += now - clock
                clock = now
                bar.set_postfix(step=self.step, loss=losses[-1], refresh=False)
                bar.update(min(100, int(100 * self.progress)) - bar.n)
                ends = self.progress >= 1 or asked.is_set()
                if asked.is_set():
                    tqdm.write('Stopping: judging and saving; Ctrl-C again ends it at once.')
                if ends or now - saved > self.options.save_every:
                    tqdm.write(self._judge_and_save(float(np.mean(losses))))
                    losses.clear()
                    saved = time.monotonic()
                if ends:
                    break
        bar.close()
        return self.progress >= 1

    def _batches(self) -> Iterator[Batch]:
        """Yield the batches from the current step on, drawn ahead on a thread."""
        seed, most = self.options.seed, self.options.most_maps
        with ThreadPoolExecutor(1) as pool:
            ahead = [pool.submit(step_batch, seed, self.step + n, most) for n in range(AHEAD)]
            step = self.step + AHEAD
            try:
                while True:
                    yield ahead.pop(0).result()
                    ahead.append(pool.submit(step_batch, seed, step, most))
                    step += 1
            finally:
                for future in ahead:
                    future.cancel()

    def _learn(self, batch: Batch) -> float:
        for group in self.optimiser.param_groups:
            group['lr'] = RATE * _rate(self.step, self.progress)
        self.network.train()
        loss = hop_loss(self.network, batch, self.device)
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), MOST_GRADIENT)
        self.optimiser.step()
        mean = min(MEAN, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for name, value in self.network.state_dict().items():
                self.mean[name].lerp_(value, 1 - mean)
        return float(loss.detach())

    def _judge_and_save(self, loss: float) -> str:
        """Write curve, checkpoint and model; return in words how good it is and where it lies."""
        network = Network(self.network.shape)
        network.load_state_dict({name: value.cpu() for name, value in self.mean.items()})
        row = {'step': self.step, 'maps': self.maps, 'minutes': round(self.seconds / 60, 2),
               'loss': round(loss, 4), **judge(network, self.held_out)}  # fmt: skip
        curve = self.out / 'curve.csv'
        is_new = not curve.exists()
        with curve.open('a', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, list(row))
            if is_new:
                writer.writeheader()
            writer.writerow(row)
        state = {
            'network': self.network.state_dict(), 'mean': self.mean, 'step': self.step,
            'optimiser': self.optimiser.state_dict(), 'maps': self.maps,
            'seconds': self.seconds, 'shape': asdict(self.network.shape),
            'seed': self.options.seed,
        }  # fmt: skip
        partial = self.out / 'checkpoint.partial'
        torch.save(state, partial)
        os.replace(partial, self.out / 'checkpoint.pt')
        arrays = {name: value.numpy() for name, value in network.state_dict().items()}
        model = self.out / 'model.npz'
        export(arrays, asdict(network.shape), model)
        valid = (f'{100 * row[f"valid_{name}"]:.1f} %' for name in ('recipe', 'wide'))
        return f'{model}: step {self.step}, valid greedy, recipe and wider: {" and ".join(valid)}'

    def _resume(self) -> None:
        path = self.out / 'checkpoint.pt'
        if not path.exists():
            return
        state: dict[str, Any] = torch.load(path, map_location=self.device, weights_only=True)
        asked = {'shape': asdict(self.network.shape), 'seed': self.options.seed}
        for name, value in asked.items():
            if state.get(name) != value:
                raise CheckpointError(
                    f'{path}: {name}: is {state.get(name)}, not {value}; name another --out'
                )
        self.network.load_state_dict(state['network'])
        self.mean = state['mean']
        self.optimiser.load_state_dict(state['optimiser'])
        self.step, self.maps, self.seconds = state['step'], state['maps'], state['seconds']


def hop_loss(network: Network, batch: Batch, device: torch.device) -> Tensor:
    """Return the mean cross entropy of the next hops over the rows, weighted."""
    logits = hop_logits(network, batch, device)
    hops, weights = (torch.from_numpy(x).to(device) for x in (batch.hops, batch.weights))
    return (-(hops * fn.log_softmax(logits, -1)).sum(-1) * weights).sum() / weights.sum()


def hop_logits(network: Network, batch: Batch, device: torch.device) -> Tensor:
    """Return the logits [n, N, N] with what can be no hop masked."""
    features = featurise(batch.barriers, batch.size, batch.ends)
    inputs = (features.nodes, features.barriers, features.pairs)
    logits = network(*(torch.from_numpy(x).to(device) for x in inputs))
    others = ~torch.eye(logits.shape[-1], dtype=torch.bool, device=device)
    possible = torch.from_numpy(batch.usable).to(device)[:, None] & others
    return logits.masked_fill(~possible, -1e9)


@torch.no_grad()
def judge(network: Network, batches: list[Batch]) -> dict[str, float]:
    """Return the loss and the ratio of valid greedy routes, on the recipe's and wider maps."""
    network.eval()
    device = torch.device('cpu')
    results: dict[str, list[tuple[float, float, int]]] = {'recipe': [], 'wide': []}
    for batch in batches:
        loss = float(hop_loss(network, batch, device))
        routes = greedy_routes(hop_logits(network, batch, device).numpy(), batch.usable)
        name = 'recipe' if batch.kind == RECIPE else 'wide'
        results[name].append((loss, valid_ratio(routes, batch.apart), len(routes)))
    found = {}
    for name, rows in results.items():
        losses, valid, counts = zip(*rows)
        found[f'loss_{name}'] = round(float(np.average(losses, weights=counts)), 4)
        found[f'valid_{name}'] = round(float(np.average(valid, weights=counts)), 4)
    return found


@contextmanager
def _ending_on_interrupt() -> Iterator[threading.Event]:
    """Give what the first Ctrl-C sets; the second one ends the program as ever."""
    asked = threading.Event()

    def ask(*_: object) -> None:
        asked.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def _rate(step: int, progress: float) -> float:
    """Return the part of the full rate: a warm-up, then half a cosine."""
    warm = min(1.0, (step + 1) / WARM_UP_STEPS)
    return warm * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(progress, 1.0))))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser('llm_astar_training.train', description=__doc__)
    parser.add_argument('--out', default='out/training', help='folder of the checkpoint')
    parser.add_argument('--minutes', type=float, default=60, help='how long to train')
    parser.add_argument('--steps', type=int, default=0, help='train so many steps instead')
    parser.add_argument('--seed', type=int, default=0, help='of weights and maps')
    parser.add_argument('--threads', type=int, default=os.cpu_count() or 1)
    parser.add_argument('--width', type=int, default=Shape.width)
    parser.add_argument('--layers', type=int, default=Shape.layers)
    parser.add_argument('--most-maps', type=int, default=256, help='maps a batch')
    parser.add_argument('--held-out', type=int, default=1000, help='held-out maps of the recipe')
    parser.add_argument(
        '--save-every', type=float, default=420, help='seconds; judging takes a part of a minute'
    )
    return parser


if __name__ == '__main__':
    main()
