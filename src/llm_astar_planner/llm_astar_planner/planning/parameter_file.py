# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""ROS parameter files, read without ROS and checked against the table of parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_msgs_adapter.files import read_yaml

from llm_astar_planner.parameter import ParameterError, Scalar
from llm_astar_planner.planning.parameters import NODES, OTHERS, check_names
from llm_astar_planner.plugins import PluginError

WILDCARDS = ('*', '**')


def read_parameter_files(
    paths: Sequence[str | Path], nodes: Sequence[str] = ('planner_node', 'llm_client_node')
) -> dict[str, dict[str, Scalar]]:
    """Return what parameter files set, checked, by node and parameter name.

    A later file overrides an earlier one.

    Sections of a node, in any namespace, and of wildcards count; those of other nodes do not.
    Plug-ins that they name as `package.module:name` are imported, so only the user may name files.
    Raises ParameterError naming the file and the parameter.
    """
    found: dict[str, dict[str, Scalar]] = {node: {} for node in nodes}
    for path in paths:
        sections = read_sections(path)
        if not any(name in (*nodes, *WILDCARDS) for name, _ in sections):
            raise ParameterError(f'{path}: has no ros__parameters for {" or ".join(nodes)}')
        try:
            check_sections(sections, {node: node for node in NODES})
            for node in nodes:
                found[node].update(_collected(node, sections))
        except (ParameterError, PluginError) as error:
            raise ParameterError(f'{path}: {error}') from None
    return found


def read_sections(path: str | Path) -> list[tuple[str, Mapping[str, Any]]]:
    """Return the sections of a parameter file, wildcards first: node name and parameters.

    Raises ParameterError if it is not a parameter file.
    """
    content = read_yaml(path, ParameterError)
    if not isinstance(content, dict):
        raise ParameterError(
            f'{path}: a ROS parameter file is expected: planner_node: ros__parameters: ...'
        )
    sections = list(_sections(content))
    for node, parameters in sections:
        for name in parameters:
            if not isinstance(name, str):
                raise ParameterError(
                    f'{path}: {node}: {short_repr(name)} is not the name of a parameter'
                )
    return sorted(sections, key=lambda section: section[0] not in WILDCARDS)


def _sections(content: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name, inner in content.items():
        if not isinstance(inner, dict):
            continue
        parameters = inner.get('ros__parameters')
        if isinstance(parameters, dict):
            yield str(name).rsplit('/', 1)[-1], parameters
        elif parameters is None:
            yield from _sections(inner)


def check_sections(
    sections: Sequence[tuple[str, Mapping[str, Any]]], tables: Mapping[str, str]
) -> None:
    """Raise ParameterError for a name in a section of `tables`' nodes that does not exist.

    In a wildcard section only misspellings are refused: others may be of another package. `tables`
    names, for each node as sections call it, its entry in NODES.
    """
    for name, parameters in sections:
        if name in tables:
            check_names(tables[name], parameters)
        elif name in WILDCARDS:
            check_names('planner_node', parameters, wildcard=True)


def _collected(
    node: str, sections: Sequence[tuple[str, Mapping[str, Any]]]
) -> Iterator[tuple[str, Scalar]]:
    """Yield what sections set of a node; the names of OTHERS give way."""
    given: dict[str, Any] = {}
    for name, parameters in sections:
        if name in (node, *WILDCARDS):
            given.update(parameters)
    for other, ours in OTHERS.get(node, {}).items():
        if other in given:
            given = {ours: given[other]} | given
    for item in NODES[node]:
        if item.name in given:
            if item.plugins is not None:
                item.plugins.admit(given[item.name])
            yield item.name, item.read(given[item.name])
