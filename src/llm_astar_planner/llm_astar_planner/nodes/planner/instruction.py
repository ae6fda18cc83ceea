"""The planner's current wish: its parameter `instruction`, which the topic of that name sets."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from llm_astar_planner.waypoints.prompts.instruction import clean_instruction


def take_instruction(node: Node, message: String) -> None:
    """Make a message the node's wish from now on, an empty one none; refuse it in the log."""
    result = node.set_parameters([Parameter('instruction', value=message.data)])[0]
    logger = node.get_logger()
    if not result.successful:
        logger.error(f'wish refused, the last one stays: {result.reason}')
    elif message.data:
        logger.info(f'wish from now on: {clean_instruction(message.data)}')
    else:
        logger.info('no wish any more')
