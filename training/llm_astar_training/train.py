"""Train the waypoint model: resumable, seeded, on a CPU or a GPU.

`python -m llm_astar_training.train --out out/training` starts a training, or resumes from the
checkpoint in that folder, and writes checkpoint.pt, curve.csv and the exported model.npz. Ctrl-C
ends it after the current step, with all of these written.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_planner.waypoints.learned import featurise
from torch import Tensor
from torch.nn import functional as fn
from tqdm import tqdm

from llm_astar_training import batches
from llm_astar_training.batches import Batch
from llm_astar_training.export import write_weights
from llm_astar_training.maps import KINDS, RECIPE
from llm_astar_training.network import Network, Shape

LEARNING_RATE = 1.5e-3
WARM_UP_STEPS = 300
WEIGHT_DECAY = 0.02
MAX_GRADIENT = 1.0
# The decay of the running mean of the weights, which is evaluated and exported.
MEAN_DECAY = 0.999
# Batches drawn ahead of the step that needs them.
PREFETCH = 3


class CheckpointError(LlmAstarError, ValueError):
    """A checkpoint of a different run; the message names the file and what differs."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; an interrupted run exits with 130."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    if options.steps <= 0 and options.minutes <= 0:
        parser.error(f'--minutes: {options.minutes} is not above 0')
    torch.set_num_threads(options.threads)
    try:
        trainer = Trainer(options)
    except CheckpointError as error:
        parser.error(str(error))
    if trainer.progress >= 1:
        tqdm.write(f'{trainer.out}: is trained to the end; train longer, or name another --out')
    elif not trainer.run():
        tqdm.write('Interrupted: the same command continues from here.')
        raise SystemExit(130)


class Trainer:
    """The network, its optimiser, the running mean and the progress, kept in one checkpoint."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Start, or resume from the checkpoint in the folder. Raises CheckpointError."""
        self.options = options
        self.out = Path(options.out)
        self.out.mkdir(parents=True, exist_ok=True)
        self.device = torch.device('cuda' if torch.cuda.is_available() else 'cpu')
        torch.manual_seed(options.seed)
        shape = Shape(width=options.width, layers=options.layers)
        self.network = Network(shape).to(self.device)
        self.mean = {k: v.detach().clone() for k, v in self.network.state_dict().items()}
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), LEARNING_RATE, (0.9, 0.98), weight_decay=WEIGHT_DECAY
        )
        self.step, self.maps, self.seconds = 0, 0, 0.0
        self.resume()
        self.held_out = batches.held_out(options.held_out)

    @property
    def progress(self) -> float:
        """The share of the training that is done, from 0; 1 or more at the end."""
        if self.options.steps:
            return self.step / self.options.steps
        return self.seconds / (60 * self.options.minutes)

    def run(self) -> bool:
        """Train, evaluate and save from time to time; tell whether training is complete."""
        bar = tqdm(total=100, unit='%', initial=int(100 * self.progress))
        losses: list[float] = []
        saved = clock = time.monotonic()
        with stop_on_interrupt() as interrupted:
            for batch in self.batches():
                losses.append(self.learn(batch))
                self.step += 1
                self.maps += len(batch.size)
                now = time.monotonic()
                self.seconds += now - clock
                clock = now
                bar.set_postfix(step=self.step, loss=losses[-1], refresh=False)
                bar.update(min(100, int(100 * self.progress)) - bar.n)
                done = self.progress >= 1 or interrupted.is_set()
                if interrupted.is_set():
                    tqdm.write('Stopping: evaluating and saving; Ctrl-C again ends it at once.')
                if done or now - saved > self.options.save_every:
                    tqdm.write(self.evaluate_and_save(float(np.mean(losses))))
                    losses.clear()
                    saved = time.monotonic()
                if done:
                    break
        bar.close()
        return self.progress >= 1

    def batches(self) -> Iterator[Batch]:
        """Yield the batches from the current step on, prefetched by a thread."""
        steps = itertools.count(self.step)
        with ThreadPoolExecutor(1) as pool:

            def submit() -> Future[Batch]:
                seed, most = self.options.seed, self.options.most_maps
                left_out = [KINDS.index(name) for name in self.options.leave_out]
                return pool.submit(batches.step_batch, seed, next(steps), most, left_out)

            ahead = deque(submit() for _ in range(PREFETCH))
            try:
                while True:
                    yield ahead.popleft().result()
                    ahead.append(submit())
            finally:
                for future in ahead:
                    future.cancel()

    def learn(self, batch: Batch) -> float:
        """Take one step of the optimiser; return the loss."""
        for group in self.optimiser.param_groups:
            group['lr'] = LEARNING_RATE * rate_factor(self.step, self.progress)
        self.network.train()
        loss = hop_loss(self.network, batch, self.device)
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), MAX_GRADIENT)
        self.optimiser.step()
        decay = min(MEAN_DECAY, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for name, value in self.network.state_dict().items():
                self.mean[name].lerp_(value, 1 - decay)
        return float(loss.detach())

    def evaluate_and_save(self, loss: float) -> str:
        """Write curve, checkpoint and model; return a sentence on how good the model is."""
        network = Network(self.network.shape)
        network.load_state_dict({name: value.cpu() for name, value in self.mean.items()})
        row = {'step': self.step, 'maps': self.maps, 'minutes': round(self.seconds / 60, 2),
               'loss': round(loss, 4), **evaluate(network, self.held_out)}  # fmt: skip
        with (self.out / 'curve.csv').open('a', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, list(row))
            if file.tell() == 0:
                writer.writeheader()
            writer.writerow(row)
        state = {
            'network': self.network.state_dict(), 'mean': self.mean, 'step': self.step,
            'optimiser': self.optimiser.state_dict(), 'maps': self.maps,
            'seconds': self.seconds, 'shape': asdict(self.network.shape),
            'seed': self.options.seed,
            'left_out': sorted(self.options.leave_out),
        }  # fmt: skip
        partial = self.out / 'checkpoint.partial'
        torch.save(state, partial)
        os.replace(partial, self.out / 'checkpoint.pt')
        arrays = {name: value.numpy() for name, value in network.state_dict().items()}
        model = self.out / 'model.npz'
        write_weights(model, arrays, asdict(network.shape))
        valid = (f'{100 * row[f"valid_{name}"]:.1f} %' for name in ('recipe', 'wide'))
        return f'{model}: step {self.step}, valid greedy, recipe and wider: {" and ".join(valid)}'

    def resume(self) -> None:
        """Load the checkpoint, if there is one. Raises CheckpointError."""
        path = self.out / 'checkpoint.pt'
        if not path.exists():
            return
        state: dict[str, Any] = torch.load(path, map_location=self.device, weights_only=True)
        # Checkpoints of before had every kind.
        state.setdefault('left_out', [])
        expected = {
            'shape': asdict(self.network.shape),
            'seed': self.options.seed,
            'left_out': sorted(self.options.leave_out),
        }
        for name, value in expected.items():
            if state.get(name) != value:
                found = f'{name}: is {state.get(name)}, not {value}'
                raise CheckpointError(f'{path}: {found}; name another --out')
        self.network.load_state_dict(state['network'])
        self.mean = state['mean']
        self.optimiser.load_state_dict(state['optimiser'])
        self.step, self.maps, self.seconds = state['step'], state['maps'], state['seconds']


def hop_loss(network: Network, batch: Batch, device: torch.device) -> Tensor:
    """Return the weighted mean over the rows of the cross entropy of the next hops."""
    logits = hop_logits(network, batch, device)
    hops, weights = (torch.from_numpy(x).to(device) for x in (batch.hops, batch.weights))
    return (-(hops * fn.log_softmax(logits, -1)).sum(-1) * weights).sum() / weights.sum()


def hop_logits(network: Network, batch: Batch, device: torch.device) -> Tensor:
    """Return the logits [n, N, N], with impossible hops masked."""
    features = featurise(batch.barriers, batch.size, batch.endpoints)
    inputs = (features.nodes, features.barriers, features.pairs)
    logits = network(*(torch.from_numpy(x).to(device) for x in inputs))
    others = ~torch.eye(logits.shape[-1], dtype=torch.bool, device=device)
    possible = torch.from_numpy(batch.usable).to(device)[:, None] & others
    return logits.masked_fill(~possible, -1e9)


@torch.no_grad()
def evaluate(network: Network, problems: list[Batch]) -> dict[str, float]:
    """Return the loss and the share of valid greedy routes, on the recipe's and wider maps."""
    network.eval()
    device = torch.device('cpu')
    results: dict[str, list[tuple[float, float, int]]] = {'recipe': [], 'wide': []}
    for batch in problems:
        loss = float(hop_loss(network, batch, device))
        routes = batches.greedy_routes(hop_logits(network, batch, device).numpy(), batch.usable)
        name = 'recipe' if batch.kind == RECIPE else 'wide'
        results[name].append((loss, batches.valid_share(routes, batch.distances), len(routes)))
    found = {}
    for name, rows in results.items():
        losses, valid, counts = zip(*rows)
        found[f'loss_{name}'] = round(float(np.average(losses, weights=counts)), 4)
        found[f'valid_{name}'] = round(float(np.average(valid, weights=counts)), 4)
    return found


@contextmanager
def stop_on_interrupt() -> Iterator[threading.Event]:
    """Yield an event that the first Ctrl-C sets; the second Ctrl-C ends the program."""
    interrupted = threading.Event()

    def interrupt(*_: object) -> None:
        interrupted.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)


def rate_factor(step: int, progress: float) -> float:
    """Return the factor on the learning rate: a warm-up, then half a cosine."""
    warm = min(1.0, (step + 1) / WARM_UP_STEPS)
    return warm * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(progress, 1.0))))


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    parser = argparse.ArgumentParser('llm_astar_training.train', description=__doc__)
    parser.add_argument('--out', default='out/training', help='folder of the checkpoint')
    parser.add_argument('--minutes', type=float, default=60, help='how long to train')
    parser.add_argument('--steps', type=int, default=0, help='train so many steps instead')
    parser.add_argument('--seed', type=int, default=0, help='seed of weights and maps')
    parser.add_argument('--threads', type=int, default=os.cpu_count() or 1)
    parser.add_argument('--width', type=int, default=Shape.width)
    parser.add_argument('--layers', type=int, default=Shape.layers)
    parser.add_argument(
        '--leave-out', action='append', default=[], choices=KINDS[1:], metavar='KIND',
        help=f'draw no maps of this kind, of {", ".join(KINDS[1:])}; may be repeated',
    )  # fmt: skip
    parser.add_argument('--most-maps', type=int, default=batches.MAX_MAPS, help='maps per batch')
    parser.add_argument('--held-out', type=int, default=1000, help='held-out maps of the recipe')
    parser.add_argument('--save-every', type=float, default=420, help='seconds between saves')
    return parser


if __name__ == '__main__':
    main()
