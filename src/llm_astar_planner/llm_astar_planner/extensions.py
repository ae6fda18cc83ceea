# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What other packages add to this one, found by their entry points.

`llm_astar.commands` names packages of commands (`COMMANDS` and a module each), `llm_astar.nodes`
the `main` of nodes, and `llm_astar.pictures` what draws for `--png`. llm_astar_lab adds all three;
nothing here imports it.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from llm_astar_planner.parameter import ParameterError

LAB = 'llm_astar_lab'
# The names of its commands, for the error where it is not installed.
LAB_COMMANDS = (
    'play', 'demo', 'bench', 'evaluate', 'instruct-bench', 'report', 'compare', 'draw', 'dataset',
    'transcript', 'record',
)  # fmt: skip


def extensions(kind: str) -> dict[str, EntryPoint]:
    """Return the entry points of the group `llm_astar.KIND`, by name."""
    return {entry.name: entry for entry in entry_points(group=f'llm_astar.{kind}')}


def find_drawing(name: str) -> EntryPoint:
    """Return what draws for a command; loading it imports matplotlib.

    Raises ParameterError where the package with it is not installed.
    """
    found = extensions('pictures').get(name)
    if found is None:
        raise not_installed('--png is drawn by code')
    return found


def not_installed(what: str) -> ParameterError:
    """Return the error that something is in the laboratory, which is not installed."""
    ways = f'`make install` or `pip install ./src/{LAB}` installs it'
    return ParameterError(f'{what} of the package {LAB}, which is not installed; {ways}')
