"""Imports go one way: from the laboratory, cli and nodes down to the search and the maps."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / 'src'
ADAPTER = 'llm_astar_msgs_adapter'
PLANNER = 'llm_astar_planner'
ROS = {
    'rclpy',
    'nav_msgs',
    'geometry_msgs',
    'std_msgs',
    'diagnostic_msgs',
    'visualization_msgs',
    'builtin_interfaces',
    'rcl_interfaces',
    'lifecycle_msgs',
    'map_msgs',
    'nav2_msgs',
    'bond',
    'tf2_ros',
}
LAB = 'llm_astar_lab'
# What each room of the planner may import, besides itself, of the planner's other rooms.
COSTMAP = {'search', 'parameter', 'plugins', 'lazy'}
WAYPOINTS = COSTMAP | {'caches', 'costmap', 'resources'}
INSTRUCTIONS = WAYPOINTS | {'waypoints'}
PLANNING = INSTRUCTIONS | {'instructions'}
NODES = PLANNING | {'planning'}
ROOMS = {
    'search': {'plugins', 'lazy'},
    'costmap': COSTMAP,
    'waypoints': WAYPOINTS,
    'instructions': INSTRUCTIONS,
    'planning': PLANNING,
    'nodes': NODES,
    'cli': NODES | {'nodes'},
}
# And each room of the laboratory of its others; all may import the planner.
RESULTS = {'results', 'datasets', 'runner', 'analysis', 'evaluation', 'bags'}
# Modules of the planner beside its rooms.
OUTSIDE = ('caches', 'parameter', 'plugins', 'resources', 'lazy')
LAB_ROOMS = {
    'bags': {'templates'},
    'pictures': set(),
    'play': {'pictures', 'datasets'},
    'results': {'templates'},
    'datasets': set(),
    'analysis': {'results'},
    'runner': {'results', 'datasets', 'analysis'},
    'evaluation': {'results', 'datasets', 'runner', 'bags', 'templates'},
    'report': RESULTS | {'pictures', 'templates'},
    'instruct_bench': RESULTS | {'report', 'pictures', 'templates'},
    'nodes': RESULTS | {'report', 'pictures', 'play'},
}
# Of the adapter's messages, those that read any object with a message's fields: no ROS needed.
PLAIN_MESSAGES = {'fields', 'report', 'transforms'}


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def imported(path, *prefixes):
    return {
        name
        for name in imports(path)
        if any(name == prefix or name.startswith(prefix + '.') for prefix in prefixes)
    }


def modules(*parts):
    return sorted(SOURCE.joinpath(*parts).rglob('*.py'))


def identify(path):
    return str(path.relative_to(SOURCE))


def rooms_of(path, package):
    return {name.split('.')[1] for name in imported(path, package) if '.' in name}


@pytest.mark.parametrize('path', modules(ADAPTER, ADAPTER), ids=identify)
def test_the_adapter_never_imports_the_planner_and_only_messages_imports_ros(path):
    assert not imported(path, PLANNER, LAB)
    room = path.parent.name
    if room != 'messages' or path.stem in PLAIN_MESSAGES:
        assert not imported(path, *ROS)
    if room == 'maps':
        assert rooms_of(path, ADAPTER) <= {'maps', 'errors', 'files'}


@pytest.mark.parametrize(
    ('room', 'path'),
    [(room, path) for room in ROOMS for path in modules(PLANNER, PLANNER, room)],
    ids=lambda value: value if isinstance(value, str) else identify(value),
)
def test_rooms_import_one_way(room, path):
    known = {entry.stem for entry in (SOURCE / PLANNER / PLANNER).iterdir()}
    assert (rooms_of(path, PLANNER) & known) - {room, '__init__'} <= ROOMS[room]


@pytest.mark.parametrize(
    ('room', 'path'),
    [(room, path) for room in LAB_ROOMS for path in modules(LAB, LAB, room)],
    ids=lambda value: value if isinstance(value, str) else identify(value),
)
def test_rooms_of_the_laboratory_import_one_way(room, path):
    known = {entry.stem for entry in (SOURCE / LAB / LAB).iterdir()}
    assert (rooms_of(path, LAB) & known) - {room, '__init__'} <= LAB_ROOMS[room]


@pytest.mark.parametrize('path', modules(PLANNER, PLANNER), ids=identify)
def test_the_planner_imports_nothing_of_the_laboratory(path):
    assert not imported(
        path, LAB, 'matplotlib', 'jinja2', 'rosbags', 'mcap', 'duckdb', 'starlette'
    )


@pytest.mark.parametrize('name', OUTSIDE)
def test_the_modules_outside_of_the_rooms_import_none_of_them(name):
    path = SOURCE / PLANNER / PLANNER / f'{name}.py'
    assert not rooms_of(path, PLANNER) - set(OUTSIDE)


@pytest.mark.parametrize('path', modules(PLANNER, PLANNER, 'search'), ids=identify)
def test_the_search_knows_numbers_alone(path):
    assert not {name for name in imported(path, ADAPTER) if name != f'{ADAPTER}.errors'} - {
        f'{ADAPTER}.errors.LlmAstarError'
    }


@pytest.mark.parametrize(
    'path',
    [
        path
        for path in (*modules(PLANNER, PLANNER), *modules(LAB, LAB))
        if 'nodes' not in path.parts
    ],
    ids=identify,
)
def test_only_nodes_know_ros(path):
    if path.parts[-2:] == ('cli', 'doctor.py'):  # which looks whether it is there
        return
    assert not imported(path, *ROS)
    messages = {
        name.split('.')[2]
        for name in imported(path, f'{ADAPTER}.messages')
        if len(name.split('.')) > 2
    }
    assert messages <= PLAIN_MESSAGES


def test_no_two_modules_import_each_other():
    named = {
        '.'.join(path.relative_to(folder).with_suffix('').parts).removesuffix('.__init__'): path
        for folder in sorted(SOURCE.iterdir())
        for path in modules(folder.name, folder.name)
    }
    imports_of = {name: set(imports(path)) & named.keys() for name, path in named.items()}
    circles = {
        tuple(sorted((name, other)))
        for name, others in imports_of.items()
        for other in others
        if name in imports_of[other] and name != other
    }
    assert not circles
