# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Run a node from `main` to a clean exit."""

import contextlib
import faulthandler
import gc
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import rclpy
from llm_astar_msgs_adapter.errors import LlmAstarError, printable
from rclpy.context import Context
from rclpy.exceptions import (
    InvalidHandle,
    InvalidNamespaceException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    InvalidTopicNameException,
)
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions, install_signal_handlers
from rclpy.utilities import remove_ros_args
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_topic_name import validate_topic_name

from llm_astar_planner.nodes.common.process import handling, limit_heaps

RCLError = rclpy_implementation.RCLError
UnknownROSArgsError = rclpy_implementation.UnknownROSArgsError
# What a user can correct at start: printed as one line, never as a traceback.
USER_ERRORS = (LlmAstarError, InvalidParameterTypeException, InvalidParameterValueException)


class ArgumentError(LlmAstarError, ValueError):
    """A command line that a node does not understand."""


ENDING = (signal.SIGINT, signal.SIGTERM)
# A signal that arrives between two steps interrupts neither, so no step waits for longer.
LONGEST_WAIT = 1.0
# How long a thread that writes a long path may delay a cancel request, in seconds.
SWITCH_SECONDS = 0.001
# Seconds after which a process that cannot leave the graph is ended; `ros2 launch` kills it after
# ten.
LONGEST_LEAVE = 8.0


def spin(executor: Executor, context: Context, stopped: threading.Event | None = None) -> None:
    """Spin until the context is shut down or `stopped` is set, then return without an error."""
    while context.ok() and not (stopped and stopped.is_set()):
        spin_once(executor, context)


def spin_once(executor: Executor, context: Context) -> None:
    """Handle one callback. Raises RCLError, but for what a shutdown causes."""
    try:
        executor.spin_once(timeout_sec=LONGEST_WAIT)
    except ExternalShutdownException:
        pass
    except InvalidHandle:
        # Another thread destroyed an entity while the executor collected what it waits for;
        # rclpy guards the entities against that, but not their event handlers.
        pass
    except RCLError as error:
        # A signal may end the context between two steps of the executor; and an action server
        # that a deactivated node has destroyed may still be in the executor's wait set.
        if context.ok() and 'wait set' not in str(error):
            raise


class SpinThread:
    """Spins a node in a thread of its own, until `close`."""

    def __init__(self, node: Node) -> None:
        """Start to spin a node that nobody else spins."""
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._stopped = threading.Event()
        self._thread = threading.Thread(
            target=spin, args=(self._executor, node.context, self._stopped), daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop; without this the process may abort at exit."""
        self._stopped.set()
        # Something to do: merely woken, the executor would go on waiting.
        self._executor.create_task(int)
        self._thread.join()
        self._executor.shutdown()


def side_node(parent: Node, name: str, **options: Any) -> Node:  # noqa: ANN401 - create_node's
    """Make a hidden node beside `parent`, for a SpinThread: what `parent` does cannot delay it.

    Names are remapped by the parent: a `__node` remap given here would rename both alike.
    """
    return rclpy.create_node(
        f'_{parent.get_name()}_{name}',
        namespace=parent.get_namespace(),
        context=parent.context,
        start_parameter_services=False,
        enable_rosout=False,
        use_global_arguments=False,
        **options,
    )


def leave(node: Node) -> None:
    """Destroy a node as its process ends; end the process where that takes too long.

    Fast DDS may block there for minutes with Python's lock held if a peer leaves at the same
    moment (eProsima/Fast-DDS issue 6513), so no Python thread or signal handler can run.
    """
    faulthandler.dump_traceback_later(LONGEST_LEAVE, exit=True)
    try:
        node.destroy_node()
    finally:
        faulthandler.cancel_dump_traceback_later()


def prepare_log_folder() -> None:
    """Name a temporary folder for the logs of ROS where it could not write; it would not start."""
    if os.environ.get('ROS_LOG_DIR'):
        return
    try:
        folder = Path(os.environ.get('ROS_HOME') or Path(os.environ['HOME'], '.ros'), 'log')
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (KeyError, OSError):
        folder = Path(tempfile.gettempdir(), f'ros_{os.getuid()}', 'log')
        os.environ['ROS_LOG_DIR'] = str(folder)
        sys.stderr.write(f'there is no home to write to, so ROS logs to {folder} (ROS_LOG_DIR)\n')


@contextlib.contextmanager
def joined(name: str, namespace: str | None = None, **init_options: Any) -> Iterator[Node]:  # noqa: ANN401 - rclpy.init's
    """Join the graph with a node of a command, and leave it in the end, after Ctrl-C too."""
    with contextlib.ExitStack() as undo:
        prepare_log_folder()
        with deferred_signals():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO, **init_options)
            undo.callback(rclpy.try_shutdown)
            node = rclpy.create_node(
                name, namespace=namespace, start_parameter_services=False, enable_rosout=False
            )
            undo.callback(leave, node)
        yield node


@contextlib.contextmanager
def deferred_signals() -> Iterator[None]:
    """Keep SIGINT and SIGTERM until the block ends: half a node aborts the process at exit."""
    if threading.current_thread() is not threading.main_thread():  # which alone gets them
        yield
        return
    arrived: list[int] = []
    with handling(ENDING, lambda number, _: arrived.append(number)):
        yield
    for first in arrived[:1]:
        signal.raise_signal(first)


def run_node(
    make_node: Callable[[], Node],
    args: Sequence[str] | None = None,
    make_executor: Callable[[], Executor] = SingleThreadedExecutor,
    make_others: Callable[[Any], list[Node]] = lambda _: [],
) -> int:
    """Spin a node until SIGINT or SIGTERM; return 0 then, and 2 if it cannot start.

    `make_others` gets the node and returns those to spin beside it.
    """
    executor: Executor | None = None
    prepare_log_folder()
    limit_heaps()
    try:
        # An executor made after a signal fails, so signals wait for it; the node takes its time.
        with deferred_signals():
            rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
            check_arguments(args)
            executor = make_executor()
        install_signal_handlers(SignalHandlerOptions.ALL)
        nodes = [make_node()]
        try:
            nodes += make_others(nodes[0])
            reduce_latency()
            for node in nodes:
                executor.add_node(node)
            spin(executor, nodes[0].context)
        finally:
            for node in nodes:
                leave(node)
    except KeyboardInterrupt:
        pass
    except Exception as error:
        # What a signal interrupted may fail in any way.
        if executor is not None and not rclpy.ok():
            return 0
        message = user_message(error)
        if message is None:
            raise
        sys.stderr.write(f'error: {printable(message)}\n')
        return 2
    finally:
        # A second Ctrl-C must not interrupt the exit that the first one started.
        for number in ENDING:
            signal.signal(number, signal.SIG_IGN)
        rclpy.try_shutdown()
        end_threads(executor)
    return 0


def check_arguments(args: Sequence[str] | None) -> None:
    """Raise ArgumentError for the first argument that is not for ROS."""
    unknown = remove_ros_args(args)[1:]
    if unknown:
        raise ArgumentError(
            f'{unknown[0]!r} is not an option of this node; parameters are given as '
            '--ros-args -p NAME:=VALUE, and --help lists them'
        )


def user_message(error: Exception) -> str | None:
    """Return an error that a user can correct in one line, None for another."""
    if isinstance(error, UnknownROSArgsError):
        return f'unknown ROS arguments: {error}'
    if isinstance(error, (*USER_ERRORS, RCLError)):
        # rcl describes files and arguments that it cannot read in several lines.
        return printable(str(error))
    return None


def end_threads(executor: Executor | None) -> None:
    """Let the idle threads of an executor end.

    Python wakes those that it knows when the process exits, and waits for all. One that was just
    being started when a signal came is not known to it.
    """
    pool = getattr(executor, '_executor', None)  # rclpy's own, which it never shuts down
    if pool is not None:
        pool.shutdown(wait=False, cancel_futures=True)


def reduce_latency() -> None:
    """Keep the interpreter itself from delaying cancel requests."""
    sys.setswitchinterval(SWITCH_SECONDS)
    # Objects of imported modules are never freed. Scanning them in each full collection would
    # stop every thread for 0.1 to 0.2 s.
    gc.freeze()


class NodeNameError(LlmAstarError, ValueError):
    """A namespace or a node name that ROS does not allow."""


def check_names(namespace: str, *nodes: str) -> str:
    """Return a namespace with its leading slash. Raises NodeNameError for a name ROS forbids."""
    namespace = f'/{namespace.strip("/")}'
    try:
        validate_namespace(namespace)
        for name in nodes:
            validate_topic_name(name)
    except (InvalidNamespaceException, InvalidTopicNameException) as error:
        raise NodeNameError(' '.join(str(error).split())) from None
    return namespace
