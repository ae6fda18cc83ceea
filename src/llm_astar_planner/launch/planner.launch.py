# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Start the planner and its waypoint client, and map_node unless `map:=false`.

All start at once and need no order: the map is latched, a first goal waits for what is still
being prepared, and the planner does without waypoints until the client is there. Where the planner
or map_node cannot start or dies, everything ends; the waypoint client may be missing.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, SetParameter

PACKAGE = 'llm_astar_planner'


def generate_launch_description() -> LaunchDescription:
    """Describe the three nodes; `ros2 launch --show-args` lists what can be set."""
    config = Path(get_package_share_directory(PACKAGE)) / 'config'
    arguments = {
        'namespace': ('', 'Namespace of all nodes'),
        'use_sim_time': ('false', 'Use the time of /clock'),
        'autostart': ('true', 'false: a lifecycle manager activates planner_node'),
        'params_file': (str(config / 'planner.yaml'), 'Parameters of all nodes'),
        'log_level': ('info', 'Log level of all nodes'),
        'map': ('true', 'Whether to start map_node; false: use the /map of another node'),
        'map_file': ('demo.json', 'Map of map_node: barrier-map JSON or map_server YAML'),
        'map_id': ('0', 'Which map of the file'),
    }
    value = {name: LaunchConfiguration(name) for name in arguments}

    def node(executable: str, set_here: dict[str, LaunchConfiguration], **options: object) -> Node:
        return Node(
            package=PACKAGE,
            executable=executable,
            name=executable,
            namespace=value['namespace'],
            parameters=[value['params_file'], set_here],
            # As Nav2 does, so that a robot in a namespace has its own transforms.
            remappings=[('/tf', 'tf'), ('/tf_static', 'tf_static')],
            # The enclave has an effect only where SROS2 is enabled.
            arguments=[
                *('--ros-args', '--log-level', value['log_level']),
                *('--enclave', f'/llm_astar/{executable}'),
            ],
            output='screen',
            **options,
        )

    def ends(name: str) -> Shutdown:
        return Shutdown(reason=f'{name} has ended')

    declared = [
        DeclareLaunchArgument(name, default_value=default, description=sentence)
        for name, (default, sentence) in arguments.items()
    ]
    shown = {name: value[name] for name in ('map_file', 'map_id')}
    wanted = IfCondition(value['map'])
    nodes = [
        node('map_node', shown, condition=wanted, on_exit=ends('map_node')),
        node('llm_client_node', {}),
        node('planner_node', {'autostart': value['autostart']}, on_exit=ends('planner_node')),
    ]
    use_sim_time = SetParameter('use_sim_time', value['use_sim_time'])
    return LaunchDescription([*declared, use_sim_time, *nodes])
