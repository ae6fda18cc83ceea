# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Start Nav2's navigation_launch.py with this planner in the place of planner_server's plugin.

planner_server stays for its global costmap and the services that clear it; its actions,
`is_path_valid` and `plan` are moved below `nav2_planner/`. planner_node serves their names and has
a lifecycle manager and a bond of its own. It needs no start order: bt_navigator looks for the
actions when Nav2's manager activates it, which is later.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, LogInfo
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, SetParameter, SetRemap
from nav2_common.launch import RewrittenYaml

PACKAGE = 'llm_astar_planner'
ACTIONS = ('compute_path_to_pose', 'compute_path_through_poses')
# In Jazzy each part of an action is remapped on its own.
PARTS = ('send_goal', 'cancel_goal', 'get_result', 'feedback', 'status')
MOVED_ASIDE = (
    *(f'{action}/_action/{part}' for action in ACTIONS for part in PARTS),
    'is_path_valid',
    'plan',
)
TRANSFORMS = [('/tf', 'tf'), ('/tf_static', 'tf_static')]
COSTMAP_RATE = 'global_costmap.global_costmap.ros__parameters.publish_frequency'
COSTMAP = [
    ('map', 'global_costmap/costmap'),
    ('map_updates', 'global_costmap/costmap_updates'),
    ('published_footprint', 'global_costmap/published_footprint'),
]


def generate_launch_description() -> LaunchDescription:
    """Describe the stack; `ros2 launch --show-args` lists what can be set."""
    nav2 = Path(get_package_share_directory('nav2_bringup'))
    config = Path(get_package_share_directory(PACKAGE)) / 'config'
    arguments = {
        'namespace': ('', 'Namespace of all nodes'),
        'use_sim_time': ('false', 'Use the time of /clock'),
        'autostart': ('true', 'Whether the lifecycle managers activate the nodes'),
        'params_file': (str(nav2 / 'params' / 'nav2_params.yaml'), "Parameters of Nav2's nodes"),
        'planner_params_file': (str(config / 'nav2.yaml'), 'Parameters of planner_node'),
        'use_respawn': ('False', "Whether Nav2's nodes that have died are started again"),
        'respawn_planner': ('True', 'Whether planner_node is started again, at once'),
        'server_timeout': ('1000', 'Milliseconds in which a goal is to be acknowledged'),
        'costmap_rate': ('2.0', 'Hz at which the global costmap is published, if it is updated'),
        'llm_client': ('False', 'Whether to start llm_client_node, to ask a language model'),
        'use_composition': ('False', 'Not possible here: nodes are processes of their own'),
        'log_level': ('info', 'Log level of all nodes'),
    }
    value = {name: LaunchConfiguration(name) for name in arguments}
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=sentence)
        for name, (default, sentence) in arguments.items()
    ]
    navigation = PythonLaunchDescriptionSource(str(nav2 / 'launch' / 'navigation_launch.py'))
    names = ('namespace', 'use_sim_time', 'autostart', 'use_respawn', 'log_level')
    passed = {name: value[name] for name in names} | {
        'use_composition': 'False',
        # bt_navigator gives up a goal after 20 ms, which is too soon on a busy computer. At Nav2's
        # 1 Hz only each second update of the global costmap may be published.
        'params_file': RewrittenYaml(
            source_file=value['params_file'],
            param_rewrites={
                'default_server_timeout': value['server_timeout'],
                COSTMAP_RATE: value['costmap_rate'],
            },
            convert_types=True,
        ),
    }
    refused = LogInfo(
        msg='use_composition: planner_server gives up the names of its actions, which a '
        'component cannot; all nodes are started as processes of their own',
        condition=IfCondition(value['use_composition']),
    )
    # For that node alone: bt_navigator must find the actions by these names.
    moved = [SetRemap(f'planner_server:{name}', f'nav2_planner/{name}') for name in MOVED_ASIDE]
    stack = [*moved, IncludeLaunchDescription(navigation, launch_arguments=passed.items())]

    def node(package: str, executable: str, name: str, **options: object) -> Node:
        return Node(
            package=package,
            executable=executable,
            name=name,
            namespace=value['namespace'],
            arguments=['--ros-args', '--log-level', value['log_level']],
            output='screen',
            **options,
        )

    ours = {'parameters': [value['planner_params_file']], 'respawn': value['respawn_planner']}
    asked = {'condition': IfCondition(value['llm_client']), 'remappings': COSTMAP}
    # RViz's goal is for Nav2's behaviour tree, which calls the action.
    remapped = [*TRANSFORMS, *COSTMAP, ('goal_pose', 'llm_astar/goal_pose')]
    manager = 'lifecycle_manager_llm_astar'
    managed = {'autostart': value['autostart'], 'node_names': ['planner_node']}
    nodes = [
        SetParameter('use_sim_time', value['use_sim_time']),
        node(PACKAGE, 'planner_node', 'planner_node', remappings=remapped, **ours),
        node(PACKAGE, 'llm_client_node', 'llm_client_node', **asked, **ours),
        node('nav2_lifecycle_manager', 'lifecycle_manager', manager, parameters=[managed]),
    ]
    return LaunchDescription([*declared, refused, GroupAction(stack), GroupAction(nodes)])
