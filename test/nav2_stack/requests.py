"""Random requests to planner_node and to the planner_server beside it, on the same costmap.

`python -m nav2_stack.requests --count 40`, in test/ and in the environment of a stack; prints a
line of JSON for each: codes, lengths and milliseconds of both.
"""

import argparse
import json
import random
import time
from pathlib import Path

import rclpy
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.writing import pose_to_message
from nav2_msgs.action import ComputePathToPose
from rclpy.action import ActionClient
from rclpy.node import Node

from nav2_stack.measures import length
from nav2_stack.missions import Navigator, spinning, waited
from nav2_stack.places import find_map
from nav2_stack.processes import Stack, maps_folder
from nav2_stack.simulator import Simulator
from nav2_stack.world import World

SERVERS = {'ours': 'compute_path_to_pose', 'navfn': 'nav2_planner/compute_path_to_pose'}
# So much of the places lies off the map.
BEYOND = 0.05


def anywhere(grid_map, chance):
    """Return a pose on the map, in walls and unknown cells too, or a little off it."""
    part = [chance.uniform(-BEYOND, 1.0 + BEYOND) for _ in range(2)]
    x, y = grid_map.grid_to_world([part[0] * grid_map.width, part[1] * grid_map.height])[0]
    return Pose2D(float(x), float(y), chance.uniform(-3.0, 3.0))


def ask(client, start, goal):
    """Return code, metres and milliseconds of what one server answers."""
    request = ComputePathToPose.Goal(
        start=pose_to_message(start, 'map', Time()),
        goal=pose_to_message(goal, 'map', Time()),
        use_start=True,
    )
    begin = time.monotonic()
    handle = waited(client.send_goal_async(request), 20.0)
    answer = waited(handle.get_result_async(), 40.0)
    seconds = time.monotonic() - begin
    poses = answer.result.path.poses
    metres = length(path_from_message(answer.result.path)) if len(poses) > 1 else 0.0
    return {'code': answer.result.error_code, 'metres': metres, 'ms': 1000.0 * seconds}


def main():
    """Ask both servers and print what they answer."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--map', default='depot')
    parser.add_argument('--count', type=int, default=40)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--out', type=Path, required=True, help='a folder for logs')
    given = parser.parse_args()
    grid_map, chance = find_map(given.map, maps_folder()), random.Random(given.seed)  # noqa: S311
    rclpy.init()
    simulator, navigator, node = Simulator(World(grid_map)), Navigator(), Node('asker')
    simulator.place(Pose2D(0.0, 0.0, 0.0))
    clients = {name: ActionClient(node, ComputePathToPose, at) for name, at in SERVERS.items()}
    with spinning(simulator, navigator, node), Stack('ours', given.out):
        navigator.wait_until_active()
        for number in range(given.count):
            start, goal = (anywhere(grid_map, chance) for _ in range(2))
            answers = {name: ask(client, start, goal) for name, client in clients.items()}
            print(json.dumps({'request': number, **answers}), flush=True)  # noqa: T201
    rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
