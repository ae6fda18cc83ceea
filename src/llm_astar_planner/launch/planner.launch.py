"""Start the planner and its waypoint client, and map_node unless `map:=false`."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = 'llm_astar_planner'


def generate_launch_description() -> LaunchDescription:
    """Describe the three nodes; `ros2 launch --show-args` lists what can be set."""
    config = Path(get_package_share_directory(PACKAGE)) / 'config'
    parameters = [LaunchConfiguration('params_file')]
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file',
                default_value=str(config / 'planner.yaml'),
                description='Parameters of all nodes',
            ),
            DeclareLaunchArgument(
                'map',
                default_value='true',
                description='Whether to start map_node; false: use the /map of another node',
            ),
            DeclareLaunchArgument(
                'map_file',
                default_value='demo.json',
                description='Map of map_node: barrier-map JSON or map_server YAML',
            ),
            DeclareLaunchArgument(
                'map_id', default_value='0', description='Which map of the file'
            ),
            Node(
                package=PACKAGE,
                executable='map_node',
                parameters=[
                    *parameters,
                    {
                        'map_file': LaunchConfiguration('map_file'),
                        'map_id': LaunchConfiguration('map_id'),
                    },
                ],
                condition=IfCondition(LaunchConfiguration('map')),
                output='screen',
            ),
            Node(
                package=PACKAGE,
                executable='llm_client_node',
                parameters=parameters,
                output='screen',
            ),
            Node(
                package=PACKAGE, executable='planner_node', parameters=parameters, output='screen'
            ),
        ]
    )
