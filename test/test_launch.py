"""What the launch files describe, by stand-ins where ROS 2's launch is not installed."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

FOLDER = Path(__file__).resolve().parents[1] / 'src' / 'llm_astar_planner' / 'launch'
MODULES = {
    'ament_index_python.packages': (),
    'launch': ('LaunchDescription',),
    'launch.actions': (
        'DeclareLaunchArgument',
        'GroupAction',
        'IncludeLaunchDescription',
        'LogInfo',
        'Shutdown',
    ),
    'launch.conditions': ('IfCondition',),
    'launch.launch_description_sources': ('PythonLaunchDescriptionSource',),
    'launch.substitutions': ('LaunchConfiguration',),
    'launch_ros.actions': ('Node', 'SetParameter', 'SetRemap'),
    'nav2_common.launch': ('RewrittenYaml',),
}


def stand_in(kind):
    """Return a class that records what it is called with."""

    def make(*values, **options):
        return SimpleNamespace(kind=kind, values=values, **options)

    return make


@pytest.fixture
def described(monkeypatch):
    """Describe a launch file and return its actions, those of groups too, in order."""
    for name, kinds in MODULES.items():
        module = ModuleType(name)
        for kind in kinds:
            setattr(module, kind, stand_in(kind))
        monkeypatch.setitem(sys.modules, name, module)
    sys.modules['ament_index_python.packages'].get_package_share_directory = '/share/{}'.format

    def describe(name):
        spec = importlib.util.spec_from_file_location(name.replace('.', '_'), FOLDER / name)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        actions = []
        for action in module.generate_launch_description().values[0]:
            actions += action.values[0] if action.kind == 'GroupAction' else [action]
        return actions

    return describe


def of_kind(actions, kind):
    return [action for action in actions if action.kind == kind]


def arguments_of(actions):
    declared = of_kind(actions, 'DeclareLaunchArgument')
    assert all(action.description for action in declared)
    return {action.values[0]: action.default_value for action in declared}


def nodes_of(actions):
    nodes = {node.name: node for node in of_kind(actions, 'Node')}
    for node in nodes.values():
        assert node.namespace.values == ('namespace',)
        assert node.arguments[:2] == ['--ros-args', '--log-level']
        assert node.arguments[2].values == ('log_level',)
    return nodes


def test_the_planner_starts_with_a_map_node_of_its_own_or_without(described):
    actions = described('planner.launch.py')
    assert arguments_of(actions) == {
        'namespace': '',
        'use_sim_time': 'false',
        'autostart': 'true',
        'params_file': '/share/llm_astar_planner/config/planner.yaml',
        'log_level': 'info',
        'map': 'true',
        'map_file': 'demo.json',
        'map_id': '0',
    }
    nodes = nodes_of(actions)
    assert set(nodes) == {'map_node', 'llm_client_node', 'planner_node'}
    assert nodes['map_node'].condition.values[0].values == ('map',)
    # The whole launch ends with them, but not with the client, without which plans go on.
    assert nodes['map_node'].on_exit.kind == nodes['planner_node'].on_exit.kind == 'Shutdown'
    assert not hasattr(nodes['llm_client_node'], 'on_exit')
    assert nodes['planner_node'].parameters[1]['autostart'].values == ('autostart',)
    (set_time,) = of_kind(actions, 'SetParameter')
    assert set_time.values[0] == 'use_sim_time'


def test_nav2_starts_with_its_planner_server_moved_aside(described):
    actions = described('nav2.launch.py')
    moved = dict(action.values for action in of_kind(actions, 'SetRemap'))
    assert len(moved) == 12
    for name in ('compute_path_to_pose/_action/send_goal', 'is_path_valid', 'plan'):
        assert moved[f'planner_server:{name}'] == f'nav2_planner/{name}'
    (included,) = of_kind(actions, 'IncludeLaunchDescription')
    assert included.values[0].values == ('/share/nav2_bringup/launch/navigation_launch.py',)
    passed = dict(included.launch_arguments)
    own = {
        *('planner_params_file', 'respawn_planner', 'server_timeout', 'costmap_rate'),
        'llm_client',
    }
    assert set(arguments_of(actions)) == {*passed, *own}
    assert passed['use_composition'] == 'False'
    rewritten = passed['params_file']
    assert rewritten.source_file.values == ('params_file',)
    timeout, rate = rewritten.param_rewrites.values()
    assert (timeout.values, rate.values) == (('server_timeout',), ('costmap_rate',))
    (told,) = of_kind(actions, 'LogInfo')
    assert told.condition.values[0].values == ('use_composition',)
    # The remaps come before what they are for.
    assert actions.index(of_kind(actions, 'SetRemap')[-1]) < actions.index(included)
    nodes = nodes_of(actions)
    assert dict(nodes['planner_node'].remappings)['map'] == 'global_costmap/costmap'
    assert nodes['planner_node'].respawn.values == ('respawn_planner',)
    assert nodes['llm_client_node'].condition.values[0].values == ('llm_client',)
    (managed,) = nodes['lifecycle_manager_llm_astar'].parameters
    assert managed['node_names'] == ['planner_node']


def test_ros_2s_own_launch_accepts_the_planners_description():
    launch = pytest.importorskip('launch', reason="ROS 2's launch is not installed")
    pytest.importorskip('launch_ros', reason='launch_ros is not installed')
    source = launch.launch_description_sources.PythonLaunchDescriptionSource
    found = source(str(FOLDER / 'planner.launch.py')).try_get_launch_description_without_context()
    assert {entity.name for entity in found.get_launch_arguments()} >= {'namespace', 'map'}
