"""Filter masks that are refused leave nothing behind."""

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from llm_astar_planner.costmap.zone_layer import FilterKind, filter_info
from llm_astar_planner.costmap.zones import ZonesError
from llm_astar_planner.nodes.planner.zone_server import MaskSubscription
from rclpy.node import Node


@pytest.fixture
def node():
    rclpy.init()
    made = Node('masks')
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


def test_a_first_mask_that_is_refused_is_not_handed_on_with_the_next(node):
    given = []

    def take(masks):
        given.append([mask.info.kind for mask in masks])
        if FilterKind.KEEPOUT in given[-1]:
            raise ZonesError('refused')

    subscription = MaskSubscription(node, node, '', take)
    message = grid_to_message(GridMap(np.zeros((3, 4), dtype=np.int8)), Time())
    for kind in (FilterKind.KEEPOUT, FilterKind.SPEED_PERCENT):
        info = filter_info(kind, f'mask_{kind}', 0.0, 1.0)
        subscription.subscribe(info)
        subscription.on_mask(info, message)
    assert given == [[FilterKind.KEEPOUT], [FilterKind.SPEED_PERCENT]]
