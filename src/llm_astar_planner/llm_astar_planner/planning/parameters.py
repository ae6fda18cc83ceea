"""The planner node's own options outside of it: rules and searches by its parameters' names."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from llm_astar_planner.costmap.config import MAX_RADIUS, CostmapConfig
from llm_astar_planner.search.paper import HEURISTICS, METHODS

NODE = 'planner_node'


class OptionError(ValueError):
    """An option that cannot be used; the message names the file and the parameter."""


@dataclass(frozen=True)
class Option:
    """One parameter of planner_node: its default gives its type, a range bounds it."""

    name: str
    default: bool | int | float | str
    minimum: float = -math.inf
    maximum: float = math.inf


# Where paths may go, by the names of CostmapConfig, but for Nav2's of the price of occupancy.
RULES = (
    Option('occupied_threshold', 65, 1, 100),
    Option('allow_unknown', True),
    Option('corner_cutting', False),
    Option('cost_travel_multiplier', 2.0, 0.0, 100.0),
    Option('robot_radius', 0.0, 0.0, MAX_RADIUS),
    Option('inflation_radius', 0.0, 0.0, MAX_RADIUS),
    Option('cost_scaling_factor', 10.0, 0.0, 1000.0),
)
# How a request is taken.
REQUESTS = (
    Option('tolerance', 0.5, 0.0, 1000.0),
    Option('start_tolerance', 0.0, 0.0, 1000.0),
    Option('robot_base_frame', 'base_link'),
)
SEARCH = (
    Option('method', 'guided'),
    Option('heuristic', 'euclidean'),
    Option('weight', 2.0, 1.0, 100.0),
    Option('max_suboptimality', 1.1, 0.0, 1000.0),
    Option('max_planning_time', 5.0, 0.0, 3600.0),
)
OPTIONS = {option.name: option for option in (*RULES, *REQUESTS, *SEARCH)}


def grid_rules(values: Mapping[str, Any]) -> CostmapConfig:
    """Return the rules that options set; those not named are at the node's defaults."""
    chosen = {option.name: values.get(option.name, option.default) for option in RULES}
    multiplier = chosen.pop('cost_travel_multiplier')
    return CostmapConfig(cost_multiplier=multiplier, **chosen)


def request_options(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return how requests are taken, by name; those not given are at the node's defaults."""
    return {option.name: values.get(option.name, option.default) for option in REQUESTS}


def read_params_file(path: str | Path) -> dict[str, Any]:
    """Return the planning parameters a ROS parameter file gives planner_node, checked.

    Sections of `/**` and of a node so named, in any namespace, count; others and other parameters
    do not. Raises OptionError.
    """
    path = Path(path)
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise OptionError(f'{path}: {getattr(error, "strerror", None) or error}') from None
    if not isinstance(content, dict):
        raise OptionError(
            f'{path}: a ROS parameter file is expected: {NODE}: ros__parameters: ...'
        )
    given: dict[str, Any] = {}
    sections = list(_sections(content))
    if not sections:
        raise OptionError(f'{path}: has no ros__parameters for {NODE}')
    for section in sections:
        given.update(section)
    return {
        name: _checked(option, given[name], f'{path}: {name}')
        for name, option in OPTIONS.items()
        if name in given
    }


def check_options(values: Mapping[str, Any]) -> None:
    """Raise OptionError for the first value that its parameter cannot have."""
    for name, value in values.items():
        _checked(OPTIONS[name], value, f'--{name.replace("_", "-")}')


def _sections(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the parameters meant for the node, the wildcard's first."""
    found: list[Mapping[str, Any]] = []
    for name, inner in sorted(content.items(), key=lambda item: str(item[0]) != '/**'):
        if not isinstance(inner, dict):
            continue
        parameters = inner.get('ros__parameters')
        if isinstance(parameters, dict) and str(name).rsplit('/', 1)[-1] in (NODE, '**', '*'):
            found.append(parameters)
        elif parameters is None:
            found += _sections(inner)
    return found


def _checked(option: Option, value: Any, where: str) -> Any:  # noqa: ANN401 - of its type
    """Return a value as its parameter has it. Raises OptionError where it can have no such."""
    kind: Any = type(option.default)
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is not kind:
        raise OptionError(f'{where}: {kind.__name__} is expected, not {value!r}')
    bounded = isinstance(value, (int, float)) and not isinstance(value, bool)
    if bounded and not option.minimum <= value <= option.maximum:
        raise OptionError(f'{where}: {value} is not in {option.minimum:g} to {option.maximum:g}')
    choices = {'method': METHODS, 'heuristic': HEURISTICS}.get(option.name)
    if choices is not None and value not in choices:
        raise OptionError(f'{where}: {value!r} is none of {", ".join(choices)}')
    if option.name == 'max_suboptimality' and 0 < float(value) < 1:
        raise OptionError(f'{where}: {value} is neither 0 (first path) nor 1 or more')
    return value
