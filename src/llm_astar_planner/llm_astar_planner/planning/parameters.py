# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The one table of parameters: nodes, command line, config/ and docs/reference.md are made of it.

Most are described in `parameters.yaml`.
`docs/make_reference.py` prints the tables of docs/reference.md and the file config/planner.yaml.
ROS parameter files are read without ROS and checked against the table.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import nearest_name, raising, short_repr
from llm_astar_msgs_adapter.files import read_yaml

from llm_astar_planner.costmap import config as costmap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.text import POLICIES, clean_instruction
from llm_astar_planner.parameter import Parameter, ParameterError, Scalar, problem_of
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.plugins import PluginError
from llm_astar_planner.search.methods import HEURISTIC_NAMES, METHODS, SEARCH_METHODS
from llm_astar_planner.waypoints import config as waypoints
from llm_astar_planner.waypoints.config import SourceSettings

TABLE = read_yaml(Path(__file__).with_name('parameters.yaml'), ParameterError)
# What the table cannot say of these parameters: choices and checks that are code.
FACTS: dict[str, dict[str, Any]] = {
    'method': {'choices': METHODS, 'plugins': SEARCH_METHODS},
    'heuristic': {'choices': HEURISTIC_NAMES},
    'footprint': {'check': partial(problem_of, Footprint.parse)},
    'instruction': {'check': partial(problem_of, clean_instruction)},
    'instruction_policy': {'choices': POLICIES},
}


def group(of: str) -> tuple[Parameter, ...]:
    """Return the parameters of a group of the table."""
    found = []
    for name, entry in TABLE[of].items():
        facts: dict[str, Any] = FACTS.get(name, {}) | entry
        lists = {key: tuple(item) for key, item in facts.items() if isinstance(item, list)}
        found.append(Parameter(name, **facts | lists))
    return tuple(found)


COSTMAP, SOURCE = tuple(costmap.COSTMAP.values()), tuple(waypoints.SOURCE.values())
SEARCH, REQUESTS = group('search'), group('requests')
# Parameters of llm_client_node that name an address, a key or a file.
FIXED = (
    'base_url', 'api_key_env', 'prompt', 'examples_file', 'transcript', 'record', 'dataset',
)  # fmt: skip
HIDDEN: dict[str, Any] = {'node_only': True, 'cli_default': None, 'cli_reason': ''}
SET_BEFORE = '; planner_node sets it before it asks'
CLIENT = (
    *SOURCE,
    *(replace(item, sentence=item.sentence + SET_BEFORE, **HIDDEN) for item in COSTMAP),
    *group('llm_client_node'),
)
# The client's parameters that planner_node sets before each query. Neither the source nor its
# cache depends on them, and no file needs to set them.
SET_BY_PLANNER = tuple(costmap.COSTMAP)
PLANNER = (*SEARCH, *COSTMAP, *REQUESTS, *group('planner_node'))

# The nodes with parameters of their own; benchmark_node has options only.
NODES: dict[str, tuple[Parameter, ...]] = {
    'map_node': group('map_node'),
    'llm_client_node': CLIENT,
    'planner_node': PLANNER,
}
# Nav2's names of parameters, which are accepted too, with ours.
OTHERS: dict[str, dict[str, str]] = {'planner_node': {'autostart_node': 'autostart'}}
# Parameters of every ROS node, and the group `qos_overrides.TOPIC...`.
ROS_NAMES = ('use_sim_time', 'start_type_description_service', 'qos_overrides')
# Sections of parameter files for any node.
WILDCARDS = ('*', '**')
# Parameters that are fields of a request by the same names.
SAME = (
    'method', 'heuristic', 'weight', 'first_path_time_limit', 'search_while_waiting', 'any_angle',
    'tolerance', 'start_tolerance', 'allow_partial_planning', 'alternatives',
)  # fmt: skip
# How alike (0 to 1) two names are if one is a misspelling of the other.
MISSPELT = 0.8


def defaults(parameters: Iterable[Parameter], *, cli: bool = False) -> dict[str, Any]:
    """Return the default of each parameter by name: a node's, or the command line's."""
    return {
        item.name: item.cli_default if cli and item.cli_default is not None else item.default
        for item in parameters
    }


def known_names(node: str) -> set[str]:
    """Return the names of a node's parameters, those of OTHERS included."""
    return {item.name for item in NODES[node]} | OTHERS.get(node, {}).keys()


def check_names(
    node: str, names: Iterable[str], *, shared: bool = False, wildcard: bool = False
) -> None:
    """Raise ParameterError for the first name that no parameter of the node has.

    `shared` names are meant for several nodes: those of this package's other nodes are fine.
    `wildcard` names are meant for any node, so an unknown one may be of another package; only one
    that looks like a misspelling is refused.
    """
    known = known_names(node)
    who = f'{node} has no'
    if shared or wildcard:
        known, who = known.union(*map(known_names, NODES)), 'no node of this package has a'
    for name in names:
        if name in known or name.partition('.')[0] in ROS_NAMES:
            continue
        if wildcard and not nearest_name(name, known, MISSPELT):
            continue
        near = nearest_name(name, known_names(node)) or nearest_name(name, known)
        raise ParameterError(f'{name}: {who} parameter of this name{near}')


def costmap_config(values: Mapping[str, Any]) -> CostmapConfig:
    """Return the costmap's rules by parameter name; other values are ignored."""
    return CostmapConfig(**{name: values[name] for name in costmap.COSTMAP if name in values})


def source_config(values: Mapping[str, Any]) -> SourceSettings:
    """Return the settings of a source by parameter name; other values are ignored."""
    return SourceSettings(**{name: values[name] for name in waypoints.SOURCE if name in values})


def request_fields(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a PlanRequest that planner_node's parameters decide.

    Those that only nodes have may be missing.
    """
    return dict(zip(SAME, itemgetter(*SAME)(values))) | {
        'time_limit': values['max_planning_time'],
        'source_time_limit': values['source_timeout'],
        'max_suboptimality': values['max_suboptimality'] or None,
        'smoothing': values.get('smoothing', False),
        'switch_margin': values.get('switch_margin', 0.0),
        'footprint': Footprint.parse(values['footprint']),
    }


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
        with raising(ParameterError, f'{path}: ', ParameterError, PluginError):
            check_sections(sections, {node: node for node in NODES})
            for node in nodes:
                found[node].update(_collected(node, sections))
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
