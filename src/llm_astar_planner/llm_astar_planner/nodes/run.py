"""Run a node from main to a clean end."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import rclpy
from llm_astar_msgs_adapter.barrier_map import BarrierMapError
from llm_astar_msgs_adapter.grid_map import GridMapError
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from llm_astar_planner.nodes.parameters import ParameterError

# What a user can put right at start: told in one line, never as a traceback.
USER_ERRORS = (
    ParameterError,
    BarrierMapError,
    GridMapError,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)


def run(
    make_node: Callable[[], Node],
    args: Sequence[str] | None = None,
    make_executor: Callable[[], Executor] = SingleThreadedExecutor,
) -> int:
    """Spin a node until SIGINT or SIGTERM; return 0 then, 2 where it cannot start."""
    rclpy.init(args=args)
    try:
        node = make_node()
        try:
            executor = make_executor()
            executor.add_node(node)
            executor.spin()
        finally:
            node.destroy_node()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except USER_ERRORS as error:
        sys.stderr.write(f'error: {error}\n')
        return 2
    finally:
        rclpy.try_shutdown()
    return 0
