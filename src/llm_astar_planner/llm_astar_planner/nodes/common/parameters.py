# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A node's parameters, declared from the table: typed, described, ranged and checked when set."""

import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

from rcl_interfaces import msg
from rclpy.node import Node

from llm_astar_planner.parameter import Parameter, ParameterError
from llm_astar_planner.planning import parameters as tables

# What a node with Parameters is made with.
OVERRIDES = {'automatically_declare_parameters_from_overrides': True}
# Given the values a change would lead to, returns what is wrong with them, None for nothing.
Check = Callable[[dict[str, Any]], str | None]


def descriptor_of(parameter: Parameter) -> msg.ParameterDescriptor:
    """Return what `ros2 param describe` shows and rclpy enforces."""
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    descriptor = msg.ParameterDescriptor(
        description=parameter.sentence.replace('`', '') + unit, read_only=parameter.read_only
    )
    if parameter.choices:
        descriptor.additional_constraints = f'one of: {parameter.limits}'
    elif parameter.zero:
        descriptor.additional_constraints = f'{parameter.limits}: {parameter.zero}'
    elif parameter.between is not None:
        if isinstance(parameter.default, float):
            least, most = map(float, parameter.between)
            bounds = msg.FloatingPointRange(from_value=least, to_value=most)
            descriptor.floating_point_range = [bounds]
        else:
            lowest, highest = map(int, parameter.between)
            descriptor.integer_range = [msg.IntegerRange(from_value=lowest, to_value=highest)]
    return descriptor


class Parameters:
    """The declared parameters of a node, as plain values; `current` is a snapshot of all."""

    def __init__(self, node: Node, table: str, check: Check | None = None) -> None:
        """Declare the parameters that NODES lists under `table`, and those of OTHERS.

        The node has declared all overrides, which is how rclpy shows those that nobody knows.
        Raises ParameterError for an unknown name or an impossible value given at start,
        PluginError for a plug-in that cannot be imported.
        """
        self._node = node
        self._table = {parameter.name: parameter for parameter in tables.NODES[table]}
        self._others = tables.OTHERS.get(table, {})
        self._check = check
        given = {
            name: node.get_parameter(name).value
            for name in node.get_parameters_by_prefix('')
            if name.partition('.')[0] not in tables.ROS_NAMES
        }
        for name in given:
            node.undeclare_parameter(name)
        for_any_node: set[str] = set()
        for path in parameter_files(sys.argv):
            sections = tables.read_sections(path)
            tables.check_sections(sections, {node.get_name(): table})
            for_any_node.update(
                *(names for section, names in sections if section in tables.WILDCARDS)
            )
        own = [name for name in given if name.partition('.')[0] not in for_any_node]
        tables.check_names(table, own, shared=True)
        # Only now: no participant of the graph may have code imported later.
        for name, parameter in self._table.items():
            if parameter.plugins is not None and name in given:
                parameter.plugins.admit(given[name])
        self._declare(given)
        problem = self._problem(self.values())
        if problem:
            raise ParameterError(problem)
        self.current = self.values()
        node.add_on_set_parameters_callback(self._on_set)
        node.add_post_set_parameters_callback(self._on_changed)

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - of the parameter's type
        """Return a parameter's current value."""
        return self._node.get_parameter(name).value

    def values(self) -> dict[str, Any]:
        """Return every parameter's current value by name, without those of OTHERS."""
        return {name: self[name] for name in self._table}

    def _on_changed(self, _: list[Any]) -> None:
        """Take a new snapshot; `current` is never changed in place."""
        self.current = self.values()

    def _declare(self, given: dict[str, Any]) -> None:
        defaults = {name: parameter.default for name, parameter in self._table.items()}
        for name, ours in self._others.items():
            descriptor = msg.ParameterDescriptor(description=f'See {ours}')
            self._node.declare_parameter(name, defaults[ours], descriptor)
            defaults[ours] = given.get(name, defaults[ours])
        for name, parameter in self._table.items():
            self._node.declare_parameter(name, defaults[name], descriptor_of(parameter))

    def _problem(self, values: dict[str, Any]) -> str | None:
        for name, parameter in self._table.items():
            problem = parameter.problem(values[name])
            if problem:
                return problem
        return self._check(values) if self._check else None

    def _on_set(self, changed: list[Any]) -> msg.SetParametersResult:
        known = {change.name: change.value for change in changed if change.name in self._table}
        problem = self._problem(self.values() | known) if known else None
        return msg.SetParametersResult(successful=problem is None, reason=problem or '')


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the files that ROS arguments name with --params-file."""
    return [value for option, value in pairwise(arguments) if option == '--params-file']
