"""Drive missions with one planner, in the ROS domain of this process; a line of JSON for each.

Started by `python -m nav2_stack`, once for each planner, so that all of them drive at the same
time on the same machine.
"""

import argparse
import contextlib
import json
import os
import threading
import time
from pathlib import Path as FilePath

import numpy as np
import rclpy
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from lifecycle_msgs.srv import GetState
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.writing import pose_to_message
from nav2_msgs.action import NavigateToPose
from nav2_msgs.srv import ClearEntireCostmap
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from nav2_stack.measures import length, turning
from nav2_stack.places import DOOR_BOX, find_map, missions
from nav2_stack.processes import PLANNING, Stack, maps_folder
from nav2_stack.simulator import Simulator
from nav2_stack.world import World

# Seconds for the stack to start, for a costmap to see a new world, and how long a mission may
# take: so many seconds, and so many a metre of its straight line.
STARTS, SETTLES, MISSION, A_METRE = 180.0, 2.5, 40.0, 6.0
CLEARED = (
    'global_costmap/clear_entirely_global_costmap',
    'local_costmap/clear_entirely_local_costmap',
)
COLLISION = 'collision ahead'


class Navigator(Node):
    """Sends missions to bt_navigator, and notes when a plan arrives and what is recovered."""

    def __init__(self):
        super().__init__('navigator')
        self._action = ActionClient(self, NavigateToPose, 'navigate_to_pose')
        self._state = self.create_client(GetState, 'bt_navigator/get_state')
        self._clear = [self.create_client(ClearEntireCostmap, name) for name in CLEARED]
        self.create_subscription(Path, 'plan', self._on_plan, 10, raw=True)
        self.plans, self.recoveries = [], 0

    def wait_until_active(self):
        deadline = time.monotonic() + STARTS
        while time.monotonic() < deadline:
            if self._state.wait_for_service(1.0):
                answer = waited(self._state.call_async(GetState.Request()), 5.0)
                if answer is not None and answer.current_state.label == 'active':
                    return
            time.sleep(0.5)
        raise TimeoutError('bt_navigator is not active')

    def clear_costmaps(self):
        for client in self._clear:
            waited(client.call_async(ClearEntireCostmap.Request()), 5.0)

    def _on_plan(self, message):
        self.plans.append((time.monotonic(), message))

    def send(self, pose):
        """Send a goal; return its handle, once it is accepted, and the future of its result."""
        goal = NavigateToPose.Goal(pose=pose_to_message(pose, 'map', Time()))
        handle = waited(self._action.send_goal_async(goal, self._on_feedback), 20.0)
        if handle is None or not handle.accepted:
            return None, None
        return handle, handle.get_result_async()

    def _on_feedback(self, message):
        self.recoveries = max(self.recoveries, message.feedback.number_of_recoveries)


def waited(future, seconds):
    """Return what a future gives, which another thread spins for; None when time is up."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    return future.result() if done.wait(seconds) else None


class Driver:
    """Drives missions one after the other: simulator, navigator, and the stack's processes."""

    def __init__(self, stack, simulator, navigator):
        self._stack, self._simulator, self._navigator = stack, simulator, navigator

    def drive(self, mission):
        """Drive a mission from its start to its end; return what was measured."""
        stack, simulator, navigator = self._stack, self._simulator, self._navigator
        simulator.moving = mission.boxes if mission.event == 'moving' else ()
        simulator.put('boxes', *mission.boxes)
        simulator.put('door')
        simulator.place(mission.start)
        time.sleep(0.5)
        navigator.clear_costmaps()
        time.sleep(SETTLES)
        simulator.place(mission.start)
        navigator.plans, navigator.recoveries = [], 0
        self._count_lines()
        spent, begin = stack.seconds(), time.monotonic()
        handle, result = navigator.send(mission.goal)
        status, code = self._wait(mission, handle, result, begin)
        seconds = time.monotonic() - begin
        track = np.array(simulator.track)
        after = stack.seconds()
        return {
            'arrived': status == GoalStatus.STATUS_SUCCEEDED,
            'status': status,
            'code': code,
            'seconds': seconds,
            'driven': length(track),
            'turning': turning(track),
            'near': simulator.near,
            'bumps': simulator.world.bumps,
            'recoveries': navigator.recoveries,
            'plans': len(navigator.plans),
            **self._of_first_plan(begin),
            **self._count_lines(),
            'cpu': {
                name: max(0.0, after[name] - spent[name]) for name in PLANNING if name in spent
            },
            'memory': stack.memory(),
            'load': os.getloadavg()[0],
            # Last of all, since it plans.
            'back': self._plans_again(mission) if mission.event == 'kill' else None,
        }

    def _wait(self, mission, handle, result, begin):
        """Wait until a mission ends; let its event happen on the way."""
        if handle is None:
            return GoalStatus.STATUS_UNKNOWN, -1
        straight = float(np.hypot(*np.subtract(mission.goal[:2], mission.start[:2])))
        limit = MISSION + A_METRE * straight
        if mission.event:
            waited(result, mission.after)
            handle, result = self._happen(mission, handle, result)
        answer = waited(result, limit - (time.monotonic() - begin)) if result else None
        if answer is None:
            waited(handle.cancel_goal_async(), 5.0)
            answer = waited(result, 10.0)
            return GoalStatus.STATUS_CANCELED, answer.result.error_code if answer else -1
        return answer.status, answer.result.error_code

    def _happen(self, mission, handle, result):
        if mission.event == 'door':
            self._simulator.put('door', DOOR_BOX)
        elif mission.event == 'kill':
            self._stack.kill()
        elif mission.event == 'goal':
            return self._navigator.send(mission.second)
        return handle, result

    def _plans_again(self, mission):
        """Return the seconds until a goal has a plan again; None where that takes too long."""
        begin = time.monotonic()
        while time.monotonic() - begin < STARTS / 3:
            self._navigator.plans = []
            handle, result = self._navigator.send(mission.goal)
            if handle is not None:
                waited(result, 2.0)
                waited(handle.cancel_goal_async(), 5.0)
            if self._navigator.plans:
                return self._navigator.plans[0][0] - begin
            time.sleep(0.5)
        return None

    def _of_first_plan(self, begin):
        plans = self._navigator.plans
        if not plans:
            return {'first_plan_ms': None, 'planned': None}
        arrived, message = plans[0]
        points = path_from_message(deserialize_message(message, Path))
        return {'first_plan_ms': 1000.0 * (arrived - begin), 'planned': length(points)}

    def _count_lines(self):
        """Return the warnings of what plans, and the collisions that the controller foresaw."""
        of_planner = [line for name in PLANNING for line in self._stack.new_lines(name)]
        warned = [line for line in of_planner if '[WARN]' in line or '[ERROR]' in line]
        controller = self._stack.new_lines('controller_server')
        return {'warned': warned, 'collisions': sum(COLLISION in line for line in controller)}


@contextlib.contextmanager
def spinning(*nodes):
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join(5.0)


def drive_all(planner, grid_map, todo, folder, noise=0.0):
    """Start a stack and drive missions; yield what was measured of each."""
    rclpy.init()
    try:
        simulator, navigator = Simulator(World(grid_map), noise), Navigator()
        simulator.place(todo[0].start)
        with spinning(simulator, navigator), Stack(planner, folder) as stack:
            navigator.wait_until_active()
            driver = Driver(stack, simulator, navigator)
            for mission in todo:
                yield driver.drive(mission)
    finally:
        rclpy.try_shutdown()


def main():
    """Drive as the arguments say; append the measures to `FOLDER/missions.jsonl`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('planner')
    parser.add_argument('map')
    parser.add_argument('scenario')
    parser.add_argument('--count', type=int, default=30)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--noise', type=float, default=0.0)
    parser.add_argument('--out', type=FilePath, required=True)
    given = parser.parse_args()
    # Doors are on the map that is made here.
    grid_map = find_map(given.map, None if given.scenario == 'door' else maps_folder())
    todo = missions(grid_map, given.scenario, given.count, given.seed)
    names = {'planner': given.planner, 'map': given.map, 'scenario': given.scenario}
    names |= {'seed': given.seed, 'noise': given.noise}
    logs = given.out / f'{given.map}-{given.scenario}-{given.planner}'
    driven = drive_all(given.planner, grid_map, todo, logs, given.noise)
    with (given.out / 'missions.jsonl').open('a') as out:
        for number, measures in enumerate(driven):
            out.write(json.dumps({**names, 'mission': number, **measures}) + '\n')
            out.flush()
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
