"""The nodes as processes of a command, which end with it however it ends."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import IO

from llm_astar_planner.nodes.common.process import PARENT_VARIABLE

STOP_SECONDS = 10.0
# What ends a command but would not let it stop its nodes.
ENDING = (signal.SIGTERM, signal.SIGHUP)


@contextlib.contextmanager
def running_nodes(
    arguments: Mapping[str, Sequence[str]], log: IO[str] | None = None
) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Start the named nodes, each with its arguments; stop them in the end, SIGTERM included.

    They write to `log`, None for where this process writes. The kernel stops them should this
    process be killed.
    """
    nodes: dict[str, subprocess.Popen[bytes]] = {}
    with ended_by_signals():
        try:
            for name, words in arguments.items():
                nodes[name] = start_node(name, words, log)
            yield nodes
        finally:
            stop_nodes(nodes)


def start_node(name: str, words: Sequence[str], log: IO[str] | None) -> subprocess.Popen[bytes]:
    """Start a node in a session of its own, so that Ctrl-C is left to this process."""
    return subprocess.Popen(  # noqa: S603 - our own modules, no shell
        [sys.executable, '-m', 'llm_astar_planner.nodes', name, *words],
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=subprocess.STDOUT if log else None,
        env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
        start_new_session=True,
    )


def stop_nodes(nodes: Mapping[str, subprocess.Popen[bytes]]) -> None:
    """Stop all nodes; say which had to be killed or had failed."""
    for node in nodes.values():
        node.terminate()
    for name, node in nodes.items():
        try:
            code = node.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            node.kill()
            code = node.wait()
        # A node that has no signal handler yet is ended by the signal itself.
        if code not in (0, -signal.SIGTERM):
            sys.stderr.write(f'{name} ended with exit code {code}\n')


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise SystemExit with the exit code of a process that they ended.

    One that is ignored, as under nohup, stays so.
    """

    def end(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise SystemExit(128 + number)

    before = [
        (number, signal.signal(number, end))
        for number in ENDING
        if signal.getsignal(number) is not signal.SIG_IGN
    ]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
