"""Flags that several commands share."""

from __future__ import annotations

import math
from typing import Any

from llm_astar_planner.parameter import ParameterError


def add_graph_options(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--namespace` and `--node`, which name a running planner."""
    group.add_argument(
        '--namespace', default='/', metavar='NAME', help="the planner's namespace (default: /)"
    )
    group.add_argument(
        '--node',
        default='planner_node',
        metavar='NAME',
        help='name of the planner (default: %(default)s)',
    )


def check_time_limit(seconds: float) -> None:
    """Check the `--time-limit` of waits. Raises ParameterError."""
    if not 0.0 < seconds < math.inf:
        raise ParameterError(f'--time-limit: {seconds:g} is not a number of seconds above 0')
