"""The nodes over DDS on a map that changes: which plans are on the newest, and how fast.

planner_node and llm_client_node run as processes. A map with moving obstacles is published, and
callers ask for plans; both go on whatever the nodes do. Run it with
`python -m benchmarks.live_graph --help`.
"""

from __future__ import annotations

import argparse
import itertools
import os
import signal
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import grid_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from llm_astar_planner.nodes import MODULES
from llm_astar_planner.nodes.common.entities import LATCHED
from llm_astar_planner.nodes.tools.planner_client import PlannerClient, PlannerClientError
from llm_astar_planner.planning.planner import Planner
from nav_msgs.msg import OccupancyGrid
from rclpy.publisher import Publisher

from benchmarks.cases import SEED, Query, drawn_case
from benchmarks.live_maps import CONFIG, sequence, to_grid
from benchmarks.map_families import boxes

NODES = ('planner_node', 'llm_client_node')
# Maps are made beforehand, and shown forwards and backwards.
DISTINCT_MAPS = 40
QUERIES = 40
LONGEST_ANSWER = 20.0
SAMPLE_PERIOD_S = 1.0
READY_S = 120.0
RULES = ('robot_radius', 'inflation_radius', 'cost_scaling_factor')


class Usage(NamedTuple):
    """What a process has taken: CPU seconds since its start, threads, resident bytes."""

    cpu: float
    threads: int
    memory: int

    @classmethod
    def of(cls, pid: int) -> Usage:
        """Read it from /proc."""
        after_name = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
        ticks, pages = sum(map(int, after_name[11:13])), int(after_name[21])
        ticks_a_second, page = os.sysconf('SC_CLK_TCK'), os.sysconf('SC_PAGE_SIZE')
        return cls(ticks / ticks_a_second, int(after_name[17]), pages * page)


@dataclass
class World:
    """The maps that are shown, which of them is the newest, and what may be asked on them."""

    maps: list[OccupancyGrid]
    digests: list[str]
    queries: list[tuple[Pose2D, Pose2D]]
    # Which map, counted from 1, was the last one of each content.
    shown: dict[str, int] = field(default_factory=dict)
    # How many are published, and how many of them a caller has received.
    published: int = 0
    received: int = 0

    def turns(self) -> Iterator[tuple[str, OccupancyGrid]]:
        """Yield the maps for ever, forwards and backwards."""
        there = list(zip(self.digests, self.maps))
        return itertools.cycle([*there, *there[-2:0:-1]])

    def show(self, publisher: Publisher, turn: tuple[str, OccupancyGrid]) -> None:
        """Publish a map; it is the newest as soon as that is done."""
        digest, message = turn
        number = self.published + 1
        # Known before it can be planned on.
        self.shown[digest] = number
        message.header.stamp = Time(sec=number)
        publisher.publish(message)
        self.published = number

    def receive(self, message: OccupancyGrid) -> None:
        """Note that a caller has a map."""
        self.received = max(self.received, message.header.stamp.sec)


class Answer(NamedTuple):
    """One answer: when it was asked for, how long it took, and on which map it was planned.

    Maps are counted from 1. At the moment of the question so many were published, and so many
    received by a caller.
    """

    asked: float
    seconds: float
    number: int
    published: int
    received: int


def make_world(size: int) -> World:
    """Draw the maps and queries, the same ones every time."""
    static = boxes(size, np.random.default_rng(SEED))
    static[[0, -1]] = static[:, [0, -1]] = True
    passable = Planner(to_grid(static), CONFIG).costmap.blocked
    cells: list[Query] = list(drawn_case('live', passable, QUERIES).problems[0].queries)
    messages = [
        grid_to_message(to_grid(blocked), Time())
        for blocked in sequence(static, cells[0], DISTINCT_MAPS)
    ]
    digests = [grid_from_message(message).digest for message in messages]
    grid = to_grid(static)
    return World(messages, digests, [poses_of(query, grid) for query in cells])


def poses_of(query: Query, grid_map: GridMap) -> tuple[Pose2D, Pose2D]:
    """Return start and goal of a query in metres."""
    (start, goal) = grid_map.grid_to_world(query).tolist()
    return Pose2D(*start), Pose2D(*goal)


@contextmanager
def node_process(name: str, checkout: Path | None) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node, of another checkout where one is given, and end it as Ctrl-C would."""
    environment = dict(os.environ)
    if checkout is not None:
        packages = ('llm_astar_msgs_adapter', 'llm_astar_planner')
        environment['PYTHONPATH'] = ':'.join(str(checkout / 'src' / name) for name in packages)
    rules = [f'{rule}:={getattr(CONFIG, rule)}' for rule in RULES]
    options = [word for rule in rules for word in ('-p', rule)] if name == NODES[0] else []
    command = [sys.executable, '-m', f'llm_astar_planner.nodes.{MODULES[name]}']
    arguments = ['--ros-args', '--log-level', 'error', *options]
    node = subprocess.Popen([*command, *arguments], env=environment)  # noqa: S603 - our own
    try:
        yield node
    finally:
        node.send_signal(signal.SIGINT)
        try:
            node.wait(20.0)
        except subprocess.TimeoutExpired:
            node.kill()


class Run:
    """A publisher of maps and callers, each on a thread of its own, until `stop`."""

    def __init__(self, world: World, rate: float, callers: Sequence[PlannerClient]) -> None:
        """Publish maps, and ask each caller's questions, `rate` times a second."""
        self.answers: list[Answer] = []
        self.failures: list[float] = []
        self._world = world
        self._period = 1.0 / rate
        self._stopped = threading.Event()
        publisher = callers[0].node.create_publisher(OccupancyGrid, 'map', LATCHED)
        callers[-1].listen(OccupancyGrid, 'map', world.receive, LATCHED)
        self._threads = [threading.Thread(target=self.publish, args=(publisher,))]
        self._threads += [
            threading.Thread(target=self.ask, args=(caller, (number + 0.5) / len(callers)))
            for number, caller in enumerate(callers)
        ]

    def start(self) -> None:
        """Start all."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End all."""
        self._stopped.set()
        for thread in self._threads:
            thread.join()

    def ticks(self, phase: float) -> Iterator[float]:
        """Yield once a period, and leave out those that were missed, until stopped."""
        due = time.monotonic() + phase * self._period
        while not self._stopped.wait(max(0.0, due - time.monotonic())):
            yield due
            late = time.monotonic() - due
            due += self._period * max(1, -int(-late // self._period))

    def publish(self, publisher: Publisher) -> None:
        """Show one map after the other."""
        for _, turn in zip(self.ticks(0.0), self._world.turns()):
            self._world.show(publisher, turn)

    def ask(self, caller: PlannerClient, phase: float) -> None:
        """Ask one question after the other, at no fixed moment between two maps."""
        random = np.random.default_rng(round(1e3 * phase))
        for _, (start, goal) in zip(self.ticks(phase), itertools.cycle(self._world.queries)):
            time.sleep(random.uniform(0.0, 0.5 * self._period))
            asked, world = time.monotonic(), self._world
            published, received = world.published, world.received
            try:
                _, report, seconds = caller.call(start, goal, seconds=LONGEST_ANSWER)
            except PlannerClientError:
                self.failures.append(asked)
                continue
            number = world.shown.get(report.map_digest, 0)
            self.answers.append(Answer(asked, seconds, number, published, received))


def measure(world: World, options: argparse.Namespace, checkout: Path | None) -> None:
    """Run the nodes of a checkout and print what they did."""
    with ExitStack() as stack:
        nodes = {name: stack.enter_context(node_process(name, checkout)) for name in NODES}
        callers = [
            stack.enter_context(PlannerClient(rclpy.create_node(f'caller_{number}')))
            for number in range(options.callers)
        ]
        run = Run(world, options.rate, callers)
        run.start()
        try:
            callers[0].wait_until_ready(client='llm_client_node', seconds=READY_S)
            time.sleep(options.warm_up)
            begin = time.monotonic()
            usage = {name: [Usage.of(node.pid)] for name, node in nodes.items()}
            while time.monotonic() < begin + options.seconds:
                time.sleep(SAMPLE_PERIOD_S)
                for name, node in nodes.items():
                    usage[name].append(Usage.of(node.pid))
            elapsed = time.monotonic() - begin
        finally:
            run.stop()
            for caller in callers:
                caller.node.destroy_node()
        sys.stdout.write(f'{checkout or "this checkout"}, {elapsed:.0f} s\n')
        print_answers([one for one in run.answers if one.asked >= begin])
        unanswered = sum(asked >= begin for asked in run.failures)
        sys.stdout.write(f'  not answered: {unanswered}\n')
        for name, samples in usage.items():
            print_usage(name, samples, elapsed)


def print_answers(answers: Sequence[Answer]) -> None:
    """Print how many answers were on the newest map, and how long they took."""
    count = len(answers)
    of_published = sum(answer.number >= answer.published for answer in answers) / count
    of_received = sum(answer.number >= answer.received for answer in answers) / count
    behind = statistics.fmean(max(0, answer.published - answer.number) for answer in answers)
    times = [1e3 * answer.seconds for answer in answers]
    most = np.percentile(times, 95)
    sys.stdout.write(
        f'  {count} answers; of {100 * of_published:.1f} % the map was the newest published, of '
        f'{100 * of_received:.1f} % the newest received; {behind:.2f} maps behind on average\n'
        f'  median {statistics.median(times):.0f} ms, 95 % within {most:.0f} ms\n'
    )


def print_usage(name: str, samples: Sequence[Usage], elapsed: float) -> None:
    """Print the CPU, the threads and the memory of a process: at the start, the end, the most."""
    first, last = samples[0], samples[-1]
    threads = [sample.threads for sample in samples]
    memory = [sample.memory / 2**20 for sample in samples]
    sys.stdout.write(
        f'  {name}: {100 * (last.cpu - first.cpu) / elapsed:.0f} % of a core; '
        f'threads {threads[0]} to {threads[-1]}, at most {max(threads)}; '
        f'{memory[0]:.0f} to {memory[-1]:.0f} MiB, at most {max(memory):.0f}\n'
    )


def parser() -> argparse.ArgumentParser:
    """Return the command line."""
    made = argparse.ArgumentParser(description=__doc__)
    made.add_argument('--seconds', type=float, default=60.0, help='how long to measure')
    made.add_argument('--warm-up', type=float, default=10.0, help='seconds before that')
    made.add_argument('--size', type=int, default=1000, help='cells a side')
    made.add_argument('--rate', type=float, default=5.0, help='maps, and calls, a second')
    made.add_argument('--callers', type=int, default=2)
    made.add_argument(
        '--checkout',
        type=Path,
        action='append',
        default=[],
        help='also measure the nodes of another checkout',
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the nodes of this checkout, then those of others."""
    options = parser().parse_args(arguments)
    os.environ.setdefault('ROS_DOMAIN_ID', str(40 + os.getpid() % 60))
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    world = make_world(options.size)
    rclpy.init()
    try:
        for checkout in (*options.checkout, None):
            measure(world, options, checkout)
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
