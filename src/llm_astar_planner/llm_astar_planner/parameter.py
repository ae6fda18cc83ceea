# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""One configurable value: name, type, range, unit and a sentence; the tables are made of these."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import Field, dataclass, field, replace
from inspect import cleandoc
from typing import Any, TypeVar

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr

from llm_astar_planner.plugins import Plugins

Scalar = bool | int | float | str
_T = TypeVar('_T', bool, int, float, str)
_R = TypeVar('_R')


class ParameterError(LlmAstarError, ValueError):
    """A parameter that does not exist or a value it cannot have; the message names both."""


def problem_of(read: Callable[[_R], object], value: _R) -> str | None:
    """Say why a value cannot be read, None where it can."""
    try:
        read(value)
    except (LlmAstarError, FileNotFoundError) as error:
        return str(error)
    return None


@dataclass(frozen=True)
class Parameter:
    """One parameter. Its default gives its type.

    `choices` or `between`, the least and the greatest value, bound it; `plugins` are what else it
    can be; `zero` says what 0 means where 0 is allowed outside of that range; `check` returns what
    else is wrong with a value, None for nothing.
    A `read_only` parameter is set at start and never changed. A `node_only` one has no effect on
    a plan made without ROS, so `llm-astar plan` has no flag for it. Where the command line's
    default has to differ, `cli_default` is that default and `cli_reason` says why; `bench_default`
    and `bench_reason` are the same for `bench` and `evaluate`. `short_flags` are shorter names of
    its flag.
    """

    name: str
    default: Scalar
    sentence: str
    unit: str = ''
    choices: tuple[str, ...] = ()
    plugins: Plugins | None = None
    between: tuple[float, float] | None = None
    zero: str = ''
    read_only: bool = False
    node_only: bool = False
    check: Callable[[Any], str | None] | None = None
    cli_default: Scalar | None = None
    cli_reason: str = ''
    bench_default: Scalar | None = None
    bench_reason: str = ''
    short_flags: tuple[str, ...] = ()

    @property
    def limits(self) -> str:
        """The values it can have, in words; '' where any value of its type will do."""
        if self.choices:
            return ', '.join(self.choices) + (', or a plug-in' if self.plugins else '')
        if self.between is None:
            return ''
        least, most = (int(end) if end == int(end) else end for end in self.between)
        return f'{least} to {most}' + (', or 0' if self.zero else '')

    def for_bench(self) -> Parameter:
        """Return the parameter with the default that it has in `bench` and `evaluate`."""
        if self.bench_default is None:
            return self
        return replace(self, cli_default=self.bench_default, cli_reason=self.bench_reason)

    def problem(self, value: Any) -> str | None:  # noqa: ANN401 - values come from files
        """Say why the parameter cannot have a value of its type; None where it can."""
        if self.choices and value not in self.choices:
            problem: str | None = f'{short_repr(value)} is not one of {self.limits}'
            if self.plugins is not None:
                problem = self.plugins.problem(value)
            if problem:
                return f'{self.name}: {problem}'
        if self.between is not None and not (self.zero and value == 0):
            # Written so that NaN is refused. rclpy's own check lets slight excesses pass.
            is_inside = self.between[0] <= value <= self.between[1]
            if not is_inside:
                return f'{self.name}: {value} is not in {self.limits}'
        return self.check(value) if self.check else None

    def read(self, value: Any) -> Scalar:  # noqa: ANN401 - values come from files
        """Return a value of any type as this parameter's; a whole number serves as a float.

        Raises ParameterError for a value that the parameter cannot have.
        """
        kind = type(self.default)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            words = f'{kind.__name__} is expected, not {short_repr(value)}'
            raise ParameterError(f'{self.name}: {words}')
        problem = self.problem(value)
        if problem:
            raise ParameterError(problem)
        scalar: Scalar = value
        return scalar


def parameter(default: _T, **facts: Any) -> _T:  # noqa: ANN401 - see Parameter
    """Declare an attribute of a class to be a parameter; `facts` are more fields of Parameter."""
    declared: Any = field(default=default, metadata=facts)
    value: _T = declared
    return value


def parameters_of(table: type) -> dict[str, Parameter]:
    """Return the parameters that a class declares, by name; it may be a dataclass.

    Their sentences are in a list at the end of its docstring, each after its name.
    """
    _, *listed = re.split(r'^- `(\w+)`: ', cleandoc(table.__doc__ or ''), flags=re.MULTILINE)
    sentences = {name: ' '.join(text.split()) for name, text in zip(listed[::2], listed[1::2])}
    entries: dict[str, Any] = vars(table).get('__dataclass_fields__', vars(table))
    declared: dict[str, Any] = {n: item for n, item in entries.items() if isinstance(item, Field)}
    return {
        name: Parameter(name, item.default, sentences.get(name, ''), **item.metadata)
        for name, item in declared.items()
    }
