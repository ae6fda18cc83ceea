"""What stands in for the rest of a Nav2 stack around planner_node: costmap, robot, navigator."""

import time

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from lifecycle_msgs.srv import GetState
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import grid_to_message, pose_to_message
from llm_astar_planner.nodes.common.entities import LATCHED
from map_msgs.msg import OccupancyGridUpdate
from nav2_msgs.action import ComputePathThroughPoses, ComputePathToPose
from nav2_msgs.srv import ClearEntireCostmap
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from scipy import ndimage
from tf2_msgs.msg import TFMessage

RESOLUTION = 0.05
ROBOT_RADIUS = 0.22
INSCRIBED, LETHAL = 99, 100


def pose(x, y, yaw=0.0):
    return pose_to_message(Pose2D(x, y, yaw), 'map', Time())


class CostmapNode(Node):
    """Stands in for the global costmap inside planner_server.

    `walls` bool [height, width] are the static layer, `marks` what an obstacle layer has seen.
    It is published each `period` seconds: whole, as Nav2's default parameters do, or whole once
    and then as updates. Clearing it takes the marks away in the next round, unless they
    `come_back` because the obstacle is really there.
    """

    def __init__(self, walls, period=1.0, *, updates=False, namespace=None):
        super().__init__('global_costmap', namespace=namespace)
        self._walls, self._marks, self._updates = walls, np.zeros_like(walls), updates
        self._come_back = self._published = False
        self._group = group = ReentrantCallbackGroup()
        self._whole = self.create_publisher(OccupancyGrid, 'global_costmap/costmap', LATCHED)
        self._part = self.create_publisher(
            OccupancyGridUpdate, 'global_costmap/costmap_updates', LATCHED
        )
        self.create_service(
            ClearEntireCostmap,
            'global_costmap/clear_entirely_global_costmap',
            self._on_clear,
            callback_group=group,
        )
        self._timer = self.create_timer(period, self.publish, callback_group=group)
        self.publish()

    def use(self, period, *, updates=False):
        """Start again without marks, published each `period` seconds."""
        self.destroy_timer(self._timer)
        self._marks, self._published = np.zeros_like(self._walls), False
        self._updates = updates
        self.publish()
        self._timer = self.create_timer(period, self.publish, callback_group=self._group)

    def mark(self, x, y, radius, *, come_back=False):
        """See an obstacle, a disk in metres, and publish the costmap with it."""
        rows, columns = np.indices(self._walls.shape)
        offsets = (columns + 0.5) * RESOLUTION - x, (rows + 0.5) * RESOLUTION - y
        self._marks |= np.hypot(*offsets) <= radius
        self._come_back = come_back
        self.publish()

    @property
    def cells(self):
        """Occupancy int8 [height, width] as nav2_costmap_2d publishes it."""
        lethal = self._walls | self._marks
        distance = ndimage.distance_transform_edt(~lethal) * RESOLUTION
        cells = np.where(distance <= ROBOT_RADIUS, INSCRIBED, 0).astype(np.int8)
        cells[lethal] = LETHAL
        return cells

    @property
    def grid_map(self):
        return GridMap(self.cells, resolution=RESOLUTION)

    def publish(self):
        stamp = self.get_clock().now().to_msg()
        if not (self._updates and self._published):
            self._whole.publish(grid_to_message(self.grid_map, stamp))
            self._published = True
            return
        cells = self.cells
        message = OccupancyGridUpdate(height=cells.shape[0], width=cells.shape[1])
        message.header.stamp, message.header.frame_id = stamp, 'map'
        message.data = cells.ravel().tolist()
        self._part.publish(message)

    def _on_clear(self, _, response):
        if not self._come_back:
            self._marks = np.zeros_like(self._walls)
        return response


class RobotNode(Node):
    """Publishes the robot's pose to tf2, as localization and odometry do."""

    def __init__(self, x, y, namespace=None):
        super().__init__('robot', namespace=namespace)
        publisher = self.create_publisher(TFMessage, 'tf_static', LATCHED)
        odom, base = TransformStamped(child_frame_id='odom'), TransformStamped()
        odom.header.frame_id, base.header.frame_id = 'map', 'odom'
        base.child_frame_id = 'base_link'
        base.transform.translation.x, base.transform.translation.y = x, y
        publisher.publish(TFMessage(transforms=[odom, base]))
        self._publisher = publisher


class Navigator(Node):
    """The calls of nav2_simple_commander's BasicNavigator, for where that is not installed.

    The same clients, waits and order, and the names of BasicNavigator's methods.
    """

    def __init__(self, node_name='basic_navigator', namespace=''):
        super().__init__(node_name, namespace=namespace)
        self.goal_handle = self.result_future = self.status = None
        self.to_pose = ActionClient(self, ComputePathToPose, 'compute_path_to_pose')
        self.through = ActionClient(self, ComputePathThroughPoses, 'compute_path_through_poses')
        self.clear = self.create_client(
            ClearEntireCostmap, 'global_costmap/clear_entirely_global_costmap'
        )

    def destroy_node(self):
        self.to_pose.destroy()
        self.through.destroy()
        super().destroy_node()

    def waitUntilNav2Active(self, navigator='bt_navigator', localizer='amcl'):  # noqa: N802
        names = [navigator] if localizer == 'robot_localization' else [localizer, navigator]
        for name in names:
            client = self.create_client(GetState, f'{name}/get_state')
            while not client.wait_for_service(timeout_sec=1.0):
                pass
            state = 'unknown'
            while state != 'active':
                future = client.call_async(GetState.Request())
                rclpy.spin_until_future_complete(self, future)
                state = future.result().current_state.label
                time.sleep(2)

    def _getPathImpl(self, start, goal, planner_id='', use_start=False):  # noqa: N802
        goal = ComputePathToPose.Goal(
            start=start, goal=goal, planner_id=planner_id, use_start=use_start
        )
        return self._ask(self.to_pose, goal)

    def getPath(self, *arguments, **fields):  # noqa: N802
        result = self._getPathImpl(*arguments, **fields)
        return result.path if self.status == SUCCEEDED and result else None

    def getPathThroughPoses(self, start, goals, planner_id='', use_start=False):  # noqa: N802
        goal = ComputePathThroughPoses.Goal(
            start=start, goals=goals, planner_id=planner_id, use_start=use_start
        )
        result = self._ask(self.through, goal)
        return result.path if self.status == SUCCEEDED and result else None

    def clearGlobalCostmap(self):  # noqa: N802
        while not self.clear.wait_for_service(timeout_sec=1.0):
            pass
        future = self.clear.call_async(ClearEntireCostmap.Request())
        rclpy.spin_until_future_complete(self, future)

    def cancelTask(self):  # noqa: N802
        if self.result_future:
            rclpy.spin_until_future_complete(self, self.goal_handle.cancel_goal_async())

    def _ask(self, client, goal):
        while not client.wait_for_server(timeout_sec=1.0):
            pass
        future = client.send_goal_async(goal)
        rclpy.spin_until_future_complete(self, future)
        self.goal_handle = future.result()
        if not self.goal_handle.accepted:
            return None
        self.result_future = self.goal_handle.get_result_async()
        rclpy.spin_until_future_complete(self, self.result_future)
        self.status = self.result_future.result().status
        return self.result_future.result().result


SUCCEEDED = 4
