"""Run a node from main to a clean end."""

from __future__ import annotations

import faulthandler
import gc
import signal
import sys
import threading
from collections.abc import Callable, Sequence

import rclpy
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMapError
from llm_astar_msgs_adapter.maps.grid_map import GridMapError
from llm_astar_msgs_adapter.maps.map_server import MapServerError
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.context import Context
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
)
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from llm_astar_planner.parameter import ParameterError

# What a user can put right at start: told in one line, never as a traceback.
USER_ERRORS = (
    ParameterError,
    BarrierMapError,
    GridMapError,
    MapServerError,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)

# A signal that falls between two steps wakes nobody up: no step waits for longer.
LONGEST_WAIT = 0.5
# What a thread that writes a long path may keep a cancel from being heard, in seconds.
SWITCH_SECONDS = 0.001
# Seconds after which a process that cannot leave the graph is ended: `ros2 launch` kills it after
# ten.
LONGEST_LEAVE = 8.0


def spin(executor: Executor, context: Context, stopped: threading.Event | None = None) -> None:
    """Spin until the context is shut down or `stopped` is set, and return quietly then."""
    while context.ok() and not (stopped and stopped.is_set()):
        _spin_once(executor, context)


def _spin_once(executor: Executor, context: Context) -> None:
    try:
        executor.spin_once(timeout_sec=LONGEST_WAIT)
    except ExternalShutdownException:
        pass
    except RCLError as error:
        # A signal may end the context between two steps of the executor; and an action server that
        # a managed node takes back may still be on the list of what to wait for.
        if context.ok() and 'wait set' not in str(error):
            raise


class SpinThread:
    """Spins a node on a thread of its own, from `start` to `close`."""

    def __init__(self, node: Node) -> None:
        """Take a node that nobody else spins."""
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._stopped = threading.Event()
        self._thread = threading.Thread(
            target=spin, args=(self._executor, node.context, self._stopped), daemon=True
        )

    def start(self) -> None:
        """Begin to spin."""
        self._thread.start()

    def close(self) -> None:
        """End: without it the process may abort at its exit."""
        self._stopped.set()
        self._executor.wake()
        self._thread.join()
        self._executor.shutdown()


def leave(node: Node) -> None:
    """Take the last node of a process out of the graph; end the process where that cannot be done.

    Fast DDS may spin there for minutes, with Python's lock held, when a peer leaves at the same
    moment (eProsima/Fast-DDS issue 6513), so no thread or signal handler of Python's gets to run.
    """
    faulthandler.dump_traceback_later(LONGEST_LEAVE, exit=True)
    try:
        node.destroy_node()
    finally:
        faulthandler.cancel_dump_traceback_later()


def run(
    make_node: Callable[[], Node],
    args: Sequence[str] | None = None,
    make_executor: Callable[[], Executor] = SingleThreadedExecutor,
) -> int:
    """Spin a node until SIGINT or SIGTERM; return 0 then, 2 where it cannot start."""
    try:
        rclpy.init(args=args)
        # Before the node, which takes its time: made after a signal, an executor breaks.
        executor = make_executor()
        node = make_node()
        try:
            _be_prompt()
            executor.add_node(node)
            spin(executor, node.context)
        finally:
            leave(node)
    except KeyboardInterrupt:
        pass
    except UnknownROSArgsError as error:
        sys.stderr.write(f'error: unknown ROS arguments: {error}\n')
        return 2
    except USER_ERRORS as error:
        sys.stderr.write(f'error: {error}\n')
        return 2
    except RCLError as error:
        # rcl tells of files and arguments it cannot read over several lines.
        sys.stderr.write(f'error: {" ".join(str(error).split())}\n')
        return 2
    finally:
        # A second Ctrl-C must not break what the first one began.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        rclpy.try_shutdown()
    return 0


def _be_prompt() -> None:
    """Keep the interpreter's own doings from holding up whoever cancels."""
    sys.setswitchinterval(SWITCH_SECONDS)
    # What the imports left stays for good. Looked through at each full collection, it would hold
    # every thread up for a tenth of a second or two.
    gc.freeze()
