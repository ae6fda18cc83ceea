"""Node parameters declared from a table: typed, described, ranged and checked when set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node

Scalar = bool | int | float | str
# Given the values a change would lead to, returns why they cannot be, or ''.
Check = Callable[[dict[str, Any]], str]


@dataclass(frozen=True)
class Parameter:
    """One parameter: its default gives its type; `choices` or a range bounds it.

    A fixed parameter can be set at start only.
    """

    name: str
    default: Scalar
    description: str
    choices: Sequence[str] = ()
    minimum: float | None = None
    maximum: float | None = None
    fixed: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """Return what `ros2 param describe` shows and rclpy enforces."""
        descriptor = ParameterDescriptor(description=self.description, read_only=self.fixed)
        if self.choices:
            descriptor.additional_constraints = 'one of: ' + ', '.join(self.choices)
        if self.minimum is not None and self.maximum is not None:
            if isinstance(self.default, float):
                bounds = FloatingPointRange(
                    from_value=float(self.minimum), to_value=float(self.maximum)
                )
                descriptor.floating_point_range = [bounds]
            else:
                limits = IntegerRange(from_value=int(self.minimum), to_value=int(self.maximum))
                descriptor.integer_range = [limits]
        return descriptor

    def problem(self, value: Scalar) -> str:
        """Say why a value is no choice or out of the range, or ''."""
        if self.choices and value not in self.choices:
            return f'{self.name}: {value!r} is not one of {", ".join(self.choices)}'
        if self.minimum is None or self.maximum is None:
            return ''
        # rclpy lets pass what is beyond a bound by less than a millionth of it.
        if not self.minimum <= float(value) <= self.maximum:
            return f'{self.name}: {value} is not in {self.minimum:g} to {self.maximum:g}'
        return ''


class ParameterError(ValueError):
    """A parameter given at start that cannot be used."""


class Parameters:
    """The declared parameters of a node, as plain values."""

    def __init__(self, node: Node, table: Sequence[Parameter], check: Check | None = None) -> None:
        """Declare the table. Raises ParameterError where a value given at start is no good."""
        self._node = node
        self._table = {parameter.name: parameter for parameter in table}
        self._check = check
        for parameter in table:
            node.declare_parameter(parameter.name, parameter.default, parameter.descriptor())
        problem = self._problem(self.values())
        if problem:
            raise ParameterError(problem)
        node.add_on_set_parameters_callback(self._on_set)

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - of the parameter's type
        """Return a parameter's current value."""
        return self._node.get_parameter(name).value

    def values(self) -> dict[str, Any]:
        """Return every declared parameter's current value by name."""
        return {name: self[name] for name in self._table}

    def _problem(self, values: dict[str, Any]) -> str:
        for name, parameter in self._table.items():
            problem = parameter.problem(values[name])
            if problem:
                return problem
        return self._check(values) if self._check else ''

    def _on_set(self, changed: list[Any]) -> SetParametersResult:
        known = {change.name: change.value for change in changed if change.name in self._table}
        problem = self._problem(self.values() | known) if known else ''
        return SetParametersResult(successful=not problem, reason=problem)
