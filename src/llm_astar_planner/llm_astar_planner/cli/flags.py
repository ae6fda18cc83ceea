"""Flags that several commands share, and the old spellings of flags that were renamed."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from llm_astar_planner.parameter import ParameterError


class OldFlag(argparse.Action):
    """A flag that was renamed to `present`: it still sets the value, with a warning."""

    def __init__(self, *args: Any, present: str, **kwargs: Any) -> None:  # noqa: ANN401 - of argparse
        """Take the present flag."""
        super().__init__(*args, **kwargs)
        self.present = present

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,  # noqa: ANN401 - of the flag's type
        option_string: str | None = None,
    ) -> None:
        """Set the value of the present flag."""
        del parser
        setattr(namespace, self.dest, values)
        warn_renamed(str(option_string), self.present)


def warn_renamed(old: str, present: str) -> None:
    """Warn that a flag has another name now."""
    sys.stderr.write(f'llm-astar: warning: {old} is deprecated: it became {present}\n')


def add_old_flag(group: Any, old: str, present: str, dest: str, **facts: Any) -> None:  # noqa: ANN401 - argparse keeps its types private
    """Add the old spelling of a flag that sets `dest`; `facts` are more words of argparse."""
    group.add_argument(
        old,
        dest=dest,
        action=OldFlag,
        present=present,
        default=argparse.SUPPRESS,
        help=argparse.SUPPRESS,
        **facts,
    )


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
