# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The one table of parameters: nodes, command line, config/ and docs/reference.md are made of it.

`docs/make_reference.py` prints the tables of docs/reference.md and the file config/planner.yaml.
ROS parameter files are read without ROS and checked against the table.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import nearest_name, short_repr
from llm_astar_msgs_adapter.files import read_yaml

from llm_astar_planner.costmap import config as costmap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.text import (
    POLICIES,
    PREFER,
    clean_instruction,
)
from llm_astar_planner.parameter import (
    Parameter,
    ParameterError,
    Scalar,
    parameter,
    parameters_of,
    problem_of,
)
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.plugins import PluginError
from llm_astar_planner.search.methods import GUIDED, HEURISTIC_NAMES, METHODS, SEARCH_METHODS
from llm_astar_planner.waypoints import config as waypoints
from llm_astar_planner.waypoints.config import SourceSettings

# Those that only nodes have, and of these those that are fixed at their start.
for_nodes = partial(parameter, node_only=True)
at_start = partial(for_nodes, read_only=True)


class SearchParameters:
    """How a path is searched for.

    - `method`: Search method; see the table of methods. Or the name of an installed plug-in, or,
      at the start only, its `package.module:method` (docs/plugins.md)
    - `max_suboptimality`: `guided` searches until its path is proven to cost at most this many
      times the optimum; 0: it returns its first path
    - `search_while_waiting`: Whether `guided` starts after 30 ms even if the waypoints have not
      arrived
    - `any_angle`: Whether the path is shortened by straight lines at any angle
    - `smoothing`: Whether kinks of the path are rounded, where cells and the footprint leave room
      for it
    - `heuristic`: Heuristic of `llm_astar`, `astar`, `weighted_astar` and `dynamic_weighted_astar`
    - `weight`: Weight of the heuristic in `weighted_astar`
    """

    method = parameter(GUIDED, choices=METHODS, plugins=SEARCH_METHODS)
    max_suboptimality = parameter(
        1.1,
        between=(1.0, 1000.0),
        zero='the first path found',
        bench_default=0.0,
        bench_reason='as the tables measure the first path',
    )
    search_while_waiting = parameter(
        True,
        cli_default=False,
        cli_reason='since a person who names a source wants to see its waypoints used',
    )
    any_angle = parameter(False)
    smoothing = for_nodes(False)
    heuristic = parameter('euclidean', choices=HEURISTIC_NAMES)
    weight = parameter(2.0, between=(1.0, 1000.0))


class RequestParameters:
    """What a request asks for, and what it may take.

    - `footprint`: The robot's polygon as Nav2 writes it, `[[x, y], ...]` in metres of the base
      frame; no path is returned that it cannot pass. Empty: that of the topic
      `published_footprint`, if any
    - `max_planning_time`: Time limit for waypoints, search and path together
    - `first_path_time_limit`: Time limit for a search that has no path yet, for each stretch
      between via points; where it is longer than `max_planning_time`, that one only ends improving
      the path
    - `costmap_update_timeout`: How long a plan waits for a map: for the first one (then
      `TIMEOUT`); after a failure, if maps come periodically, for one that is newer than the
      request, since the costmap may have been cleared (then the last one is used, with a warning).
      Neither counts as planning time. For a newest map that is still being prepared, it is at most
      half of `max_planning_time`. 0: never
    - `costmap_timeout`: After how long without a map or an update goals are refused (`TIMEOUT`),
      if they came at regular times before: the world is not known any more. 0: never, there is a
      warning
    - `tolerance`: How far from an unreachable goal the path may end, and from a via point it may
      pass
    - `start_tolerance`: How far from a blocked start the path may begin; about the robot's radius
    - `allow_partial_planning`: Whether a goal that cannot be reached gets the path to the nearest
      point that can be, marked as partial
    - `alternatives`: How many ways to choose from a plan has besides: they pass obstacles on
      different sides, and each is the cheapest of its kind
    - `switch_margin`: How much more than the new path, as a share, the way of the last path to the
      same goal may cost and still be kept: 0.05 for 5 %; 0: it is not kept
    - `use_final_approach_orientation`: Whether the last pose keeps the direction of travel instead
      of the orientation of the goal
    - `robot_base_frame`: Frame of the robot in tf; the start, where a request has none
    - `use_waypoints`: Whether to ask for waypoints
    - `llm_client`: Node that provides waypoints; empty: plan without one
    - `source_timeout`: Time limit for waypoints, at most 80 % of `max_planning_time`
    - `instruction`: Instruction in plain language for the route, at most 500 characters
    - `instruction_policy`: What to do if the instruction cannot be met: `prefer` the path that
      violates it least, or `require` it and give no path
    - `places_file`: GeoJSON file with the named places of the map, in metres of its frame
    """

    footprint = parameter('', check=partial(problem_of, Footprint.parse))
    max_planning_time = parameter(
        5.0,
        unit='s',
        between=(0.01, 3600.0),
        cli_default=60.0,
        cli_reason='since no robot is waiting, and a language model may take half a minute',
        short_flags=('time_limit',),
    )
    first_path_time_limit = parameter(0.0, unit='s', between=(0.0, 3600.0))
    costmap_update_timeout = for_nodes(2.5, unit='s', between=(0.0, 3600.0))
    costmap_timeout = for_nodes(0.0, unit='s', between=(0.0, 3600.0))
    tolerance = parameter(0.5, unit='m', between=(0.0, 1000.0))
    start_tolerance = parameter(
        0.25,
        unit='m',
        between=(0.0, 1000.0),
        bench_default=0.0,
        bench_reason='as paths from different starts do not compare',
    )
    allow_partial_planning = parameter(False)
    alternatives = parameter(0, between=(0, 20))
    switch_margin = for_nodes(0.0, between=(0.0, 10.0))
    use_final_approach_orientation = for_nodes(False)
    robot_base_frame = for_nodes('base_link')
    use_waypoints = parameter(True)
    llm_client = at_start('llm_client_node')
    source_timeout = parameter(
        4.0,
        unit='s',
        between=(0.0, 3600.0),
        cli_default=3600.0,
        cli_reason='since there `timeout_s` alone limits how long a source is waited for',
    )
    instruction = parameter('', check=partial(problem_of, clean_instruction))
    instruction_policy = parameter(PREFER, choices=POLICIES)
    places_file = parameter('')


class NodeParameters:
    """What planner_node does besides plans.

    - `filter_info_topic`: Topic that names the masks of Nav2's keepout and speed filters, which
      become costs; empty: none are used
    - `max_speed`: Speed of the robot, which masks of speed limits in m/s need; 0: they are not
      used
    - `replan_on_map`: Whether each new map replans the last path even if that path is still free
    - `autostart`: Whether the node configures and activates itself; false: a lifecycle manager
      does
    - `bond_heartbeat_period`: Time between the heartbeats to a lifecycle manager (bond) while
      active; 0 or less: none
    - `introspection_mode`: What `~/get_plan/_service_event` publishes of each request and
      response; recordings need `contents`
    - `client_in_process`: Whether `llm_client_node` runs in this process, which saves the memory
      of another
    """

    filter_info_topic = at_start('costmap_filter_info')
    max_speed = for_nodes(0.0, unit='m/s', between=(0.0, 100.0))
    replan_on_map = for_nodes(False)
    autostart = at_start(True)
    bond_heartbeat_period = at_start(0.1, unit='s', between=(-1.0, 3600.0))
    introspection_mode = at_start('contents', choices=('disabled', 'metadata', 'contents'))
    client_in_process = at_start(False)


class ClientParameters:
    """What llm_client_node has besides the settings of its source.

    - `dataset`: Barrier maps whose ids are the keys of transcripts: a path, or a name in `maps/`
    - `fixed_endpoint`: Whether `base_url`, `api_key_env`, `prompt`, `examples_file`,
      `transcript`, `record`, `dataset` keep the values of the start; otherwise any participant of
      the graph can change where the key is sent and which files are read and written
    """

    dataset = for_nodes('')
    fixed_endpoint = at_start(True)


class MapParameters:
    """The parameters of map_node.

    - `map_file`: Barrier-map JSON file, a path or a name in `maps/`; or a map_server YAML file,
      which states its own resolution, so that `map_id` and `resolution` have no effect
    - `map_id`: Which map of the file
    - `resolution`: Width of a cell
    - `frame_id`: Frame of the map
    """

    map_file = for_nodes('demo.json')
    map_id = for_nodes(0, between=(0, 2**31 - 1))
    resolution = for_nodes(1.0, unit='m', between=(0.001, 1000.0))
    frame_id = for_nodes('map')


COSTMAP, SOURCE = tuple(costmap.COSTMAP.values()), tuple(waypoints.SOURCE.values())
SEARCH = tuple(parameters_of(SearchParameters).values())
REQUESTS = tuple(parameters_of(RequestParameters).values())
# Parameters of llm_client_node that name an address, a key or a file.
FIXED = (
    'base_url', 'api_key_env', 'prompt', 'examples_file', 'transcript', 'record', 'dataset',
)  # fmt: skip
HIDDEN: dict[str, Any] = {'node_only': True, 'cli_default': None, 'cli_reason': ''}
SET_BEFORE = '; planner_node sets it before it asks'
CLIENT = (
    *SOURCE,
    *(replace(item, sentence=item.sentence + SET_BEFORE, **HIDDEN) for item in COSTMAP),
    *parameters_of(ClientParameters).values(),
)
# The client's parameters that planner_node sets before each query. Neither the source nor its
# cache depends on them, and no file needs to set them.
SET_BY_PLANNER = tuple(costmap.COSTMAP)
PLANNER = (*SEARCH, *COSTMAP, *REQUESTS, *parameters_of(NodeParameters).values())

# The nodes with parameters of their own; benchmark_node has options only.
NODES: dict[str, tuple[Parameter, ...]] = {
    'map_node': tuple(parameters_of(MapParameters).values()),
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
