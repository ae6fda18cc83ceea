"""Receives the masks of Nav2's costmap filters: keepout areas and speed limits."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.messages.fields import grid_from_message
from nav_msgs.msg import OccupancyGrid
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node

from llm_astar_planner.costmap.filter_masks import (
    FilterInfo,
    FilterKind,
    FilterMask,
    filter_info,
)
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import LATCHED, LATCHED_BY_MANY
from llm_astar_planner.parameter import ParameterError

try:
    from nav2_msgs.msg import CostmapFilterInfo
except ImportError:
    CostmapFilterInfo = None

OnMasks = Callable[[tuple[FilterMask, ...]], None]


class MaskSubscription:
    """Subscribes to the topic of CostmapFilterInfo, and to the masks that its messages name.

    One mask of keepout areas and one of speed limits are used at a time: a new info replaces the
    one of its sort, as in Nav2, and the last mask stays until the new one comes. Malformed
    messages are logged and dropped.
    """

    def __init__(self, side: Node, parent: Node, topic: str, on_masks: OnMasks) -> None:
        """Subscribe on the node `side`, if nav2_msgs is installed and a topic is given.

        `parent` remaps the names and logs; `on_masks` gets all masks when one has changed.
        Raises ParameterError for a topic that cannot be one.
        """
        self._side = side
        self._parent = parent
        self._on_masks = on_masks
        self._group = MutuallyExclusiveCallbackGroup()
        # By sort: keepout areas (True) or speed limits (False).
        self._infos: dict[bool, FilterInfo] = {}
        self._subscriptions: dict[bool, Entities] = {}
        self._masks: dict[bool, FilterMask] = {}
        if CostmapFilterInfo is not None and topic:
            try:
                name = parent.resolve_topic_name(topic)
            except InvalidTopicNameException as error:
                raise ParameterError(f'filter_info_topic: {error}') from None
            entities = Entities(side)
            entities.subscription(
                CostmapFilterInfo, name, self.on_info, LATCHED_BY_MANY, self._group
            )

    def on_info(self, message: Any) -> None:  # noqa: ANN401 - nav2_msgs may not be there
        """Subscribe to the mask that an info names."""
        topic = message.filter_mask_topic
        try:
            info = filter_info(message.type, topic, message.base, message.multiplier)
            self.subscribe(info)
        except Exception as error:  # noqa: BLE001 - no message may end the thread of the maps
            self.log('costmap filter info', error)

    def subscribe(self, info: FilterInfo) -> None:
        """Subscribe to the mask of an info. Raises what rclpy does for a wrong topic."""
        is_keepout = info.kind is FilterKind.KEEPOUT
        if self._infos.get(is_keepout) == info:
            return
        entities = Entities(self._side)
        name = self._parent.resolve_topic_name(info.topic)
        entities.subscription(
            OccupancyGrid, name, partial(self.on_mask, info), LATCHED, self._group
        )
        before = self._subscriptions.pop(is_keepout, None)
        if before is not None:
            before.close()
        self._infos[is_keepout], self._subscriptions[is_keepout] = info, entities

    def on_mask(self, info: FilterInfo, message: OccupancyGrid) -> None:
        """Use a mask from now on."""
        is_keepout = info.kind is FilterKind.KEEPOUT
        if self._infos.get(is_keepout) != info:
            return
        try:
            masks = self._masks | {is_keepout: FilterMask(info, grid_from_message(message))}
            self._on_masks(tuple(masks.values()))
        except Exception as error:  # noqa: BLE001 - no message may end the thread of the maps
            self.log(f'filter mask {info.topic}', error)
        else:
            self._masks = masks

    def log(self, what: str, error: Exception) -> None:
        """Log that something was refused."""
        name = '' if isinstance(error, LlmAstarError) else f'{type(error).__name__}: '
        self._parent.get_logger().error(f'{what} refused, the last one stays: {name}{error}')
