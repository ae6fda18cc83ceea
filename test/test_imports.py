"""Imports go one way: nodes and command line, planner and sources, search; adapter below all."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / 'src'
ADAPTER = SOURCE / 'llm_astar_msgs_adapter' / 'llm_astar_msgs_adapter'
PLANNER = SOURCE / 'llm_astar_planner' / 'llm_astar_planner'
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
    'tf2_ros',
}
# Adapter modules that hold values and know no message.
PLAIN = {
    f'llm_astar_msgs_adapter.{name}'
    for name in (
        'bag_decoding',
        'bag_file',
        'bag_idl',
        'bag_mcap',
        'bag_messages',
        'bag_paths',
        'bag_problems',
        'bag_reading',
        'bag_sqlite',
        'bag_storage',
        'bag_topics',
        'bag_types',
        'bag_writing',
        'barrier_map',
        'barrier_summary',
        'grid_map',
        'grid_problem',
        'headings',
        'map_server',
        'map_update',
        'message_values',
        'movingai',
        'report_values',
        'transforms',
    )
}


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


def modules(folder):
    return sorted(folder.rglob('*.py'))


def identify(path):
    return str(path.relative_to(SOURCE))


@pytest.mark.parametrize('path', modules(ADAPTER), ids=identify)
def test_the_adapter_never_imports_the_planner(path):
    assert not imported(path, 'llm_astar_planner')
    if f'llm_astar_msgs_adapter.{path.stem}' in PLAIN:
        assert not imported(path, *ROS)


@pytest.mark.parametrize('path', modules(PLANNER / 'search'), ids=identify)
def test_the_search_knows_neither_maps_nor_sources_nor_ros(path):
    own = imported(path, 'llm_astar_planner')
    assert all(name.startswith('llm_astar_planner.search') for name in own)
    assert not imported(path, 'llm_astar_msgs_adapter', *ROS)


@pytest.mark.parametrize(
    'path',
    [path for path in modules(PLANNER) if path.relative_to(PLANNER).parts[0] != 'nodes'],
    ids=identify,
)
def test_only_nodes_know_ros_and_only_the_command_line_knows_nodes(path):
    messages = imported(path, *ROS)
    if path.stem != 'cli_doctor':  # which looks whether it is there
        assert not messages
        adapter = {
            '.'.join(name.split('.')[:2]) for name in imported(path, 'llm_astar_msgs_adapter')
        }
        assert adapter <= PLAIN | {'llm_astar_msgs_adapter'}
    if not path.stem.startswith('cli'):
        assert not imported(path, 'llm_astar_planner.nodes', 'llm_astar_planner.cli')


@pytest.mark.parametrize(
    'path', modules(PLANNER / 'prompts') + modules(PLANNER / 'waypoint_source'), ids=identify
)
def test_prompts_and_sources_never_import_the_planner(path):
    assert not imported(path, 'llm_astar_planner.planner', 'llm_astar_planner.benchmark')
