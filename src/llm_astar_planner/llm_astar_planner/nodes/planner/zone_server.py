# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The zones and filter masks of planner_node, and every map with them."""

import json
import math
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from diagnostic_msgs.srv import AddDiagnostics
from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.errors import LlmAstarError, raising, short_repr
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import grid_from_message
from llm_astar_msgs_adapter.messages.markers import zones_to_markers
from llm_astar_msgs_adapter.messages.writing import pose_to_message
from nav_msgs.msg import OccupancyGrid
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from llm_astar_planner.costmap import zone_layer as layers
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.raster import window_of
from llm_astar_planner.costmap.zones import (
    KEEPOUT,
    NO_ZONES,
    Zone,
    Zones,
    ZonesError,
    zones_from_text,
    zones_to_geojson,
)
from llm_astar_planner.nodes.common.entities import LATCHED, LATCHED_BY_MANY, Entities
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.tf import Frames
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import costmap_config

# Names all zones in a request to remove some.
ALL = '*'
# The frame of zones that are shown before there is a map.
DEFAULT_FRAME = 'map'
# Zones that an answer names.
MOST_NAMED = 10
# Seconds between two equal complaints in the log.
QUIET_SECONDS = 2.0
LEAST_SECONDS = 0.001
# Drawing a thousand zones takes a third of a second.
PUBLICATION_SECONDS = 0.05

try:
    from nav2_msgs.msg import CostmapFilterInfo
except ImportError:
    CostmapFilterInfo = None


@dataclass(eq=False)
class ZoneServer:
    """Composes zones and filter masks onto every map, and hands the result on.

    `~/add_zones` adds those of a GeoJSON text, `~/remove_zones` removes some; `~/zones` and
    `~/zones_geojson` show them. A request that is refused changes nothing. Services, maps, masks
    and timers have one thread, that of the node `side`.
    """

    entities: Entities
    side: Node
    settings: Parameters
    frames: Frames
    on_map: Callable[[GridMap, float | None], None]

    def __post_init__(self) -> None:
        """Serve; `entities` are of planner_node, and `on_map` gets each map with its zones."""
        self.zones = NO_ZONES
        entities, side = self.entities, self.side
        self._node = entities.node
        self._masks: tuple[layers.FilterMask, ...] = ()
        self._grid_map: GridMap | None = None
        self._layer: layers.ZoneLayer | None = None
        self._rules = self.rules()
        # Parameters change on another thread.
        self._lock = threading.RLock()
        self._markers = entities.publisher(MarkerArray, '~/zones', LATCHED)
        self._geojson = entities.publisher(String, '~/zones_geojson', LATCHED)
        self._group = MutuallyExclusiveCallbackGroup()
        self._expiry, self._publication = Entities(side), Entities(side)
        self._is_due = False
        services = Entities(side)
        for name, change in (('add_zones', self.add_text), ('remove_zones', self.remove_text)):
            resolved = self._node.resolve_service_name(f'~/{name}')
            services.service(AddDiagnostics, resolved, self.answering(change), self._group)
        self.publish()

    def values(self) -> dict[str, Any]:
        """Return what /diagnostics says."""
        return {'zones': len(self.zones), 'filter_masks': len(self._masks)}

    def take(self, grid_map: GridMap, transit: float = 0.0) -> None:
        """Take a new map, which was sent `transit` seconds ago; never raises."""
        with self._lock:
            before, self._grid_map = self._grid_map, grid_map
            try:
                self.compose(transit)
            except Exception as error:  # noqa: BLE001 - no map may end the thread of the maps
                known = isinstance(error, LlmAstarError)
                problem = str(error) if known else traceback.format_exc()
                self._node.get_logger().error(
                    f'map refused, the last one stays: {problem}',
                    throttle_duration_sec=QUIET_SECONDS,
                )
                return
            if grid_map.frame_id != (DEFAULT_FRAME if before is None else before.frame_id):
                self.show()

    def refresh(self) -> None:
        """Follow changed parameters."""
        with self._lock:
            if (len(self.zones) or self._masks) and self._rules != self.rules():
                self.use()

    def use(
        self, zones: Zones | None = None, masks: Iterable[layers.FilterMask] | None = None
    ) -> None:
        """Use other zones or filter masks from now on; none of them if that fails."""
        with self._lock:
            before = self.zones, self._masks
            self.zones = self.zones if zones is None else zones
            self._masks = self._masks if masks is None else tuple(masks)
            self._layer = None
            try:
                self.compose()
            except Exception:
                self.zones, self._masks = before
                raise
            if zones is not None:
                self.show()
                self.await_expiry()

    def compose(self, transit: float | None = None) -> None:
        """Hand on the newest map with its zones and masks; `transit` if it has just come."""
        grid_map = self._grid_map
        if grid_map is None:
            return
        if not (len(self.zones) or self._masks):
            self.on_map(grid_map, transit)
            return
        layer = self._layer
        if layer is None or not layer.fits(grid_map):
            masks, self._rules = self.usable_masks(grid_map), self.rules()
            layer = layers.ZoneLayer(grid_map, self.zones, masks, *self._rules)
            # With the next map, a mask that cannot be used now is tried again.
            self._layer = layer if len(masks) == len(self._masks) else None
        self.on_map(layer.compose(grid_map), transit)

    def rules(self) -> tuple[CostmapConfig, float]:
        """Return the parameters that decide what zones and masks cost."""
        return costmap_config(self.settings.values()), self.settings['max_speed']

    def usable_masks(self, grid_map: GridMap) -> list[layers.FilterMask]:
        """Return the masks in a map's frame; one that cannot be used is logged and left out."""
        usable = []
        for mask in self._masks:
            try:
                layers.mask_costs(mask.info, *self.rules())
                origin = self.pose_in(grid_map, mask.grid_map.origin, mask.grid_map.frame_id)
            except LlmAstarError as error:
                self._node.get_logger().error(
                    f'filter mask {mask.info.topic}: {error}', throttle_duration_sec=QUIET_SECONDS
                )
                continue
            placed = replace(mask.grid_map, origin=origin, frame_id=grid_map.frame_id)
            usable.append(mask._replace(grid_map=placed))
        return usable

    def pose_in(self, grid_map: GridMap, pose: Pose2D, frame_id: str) -> Pose2D:
        """Return a pose of another frame in that of a map. Raises FrameError."""
        if frame_id in ('', grid_map.frame_id):
            return pose
        stamped = pose_to_message(pose, frame_id, PoseStamped().header.stamp)
        return self.frames.locate(stamped, grid_map.frame_id, 'zone or mask')

    def add_text(self, text: str) -> str:
        """Add the zones of a GeoJSON text, in the place of those that have their ids.

        Return what was done. Raises LlmAstarError.
        """
        zones, frame_id = zones_from_text(text, time.monotonic())
        grid_map = self._grid_map
        if frame_id and (grid_map is None or frame_id != grid_map.frame_id):
            raise ZonesError(
                f'frame_id: {short_repr(frame_id)} is not that of the map; leave it out'
            )
        self.use(self.zones.add(zones))
        said = f'added {named(zones)}; {len(self.zones)} in all'
        if grid_map is not None:
            off = [one for one in zones if not layers.has_cells(window_of(one.area, grid_map))]
            if off:
                said += f'; off the map as it is now: {named(off)}'
        return said

    def remove_text(self, text: str) -> str:
        """Remove the zones of an id or a name, ALL for all; return what was done.

        Raises ZonesError where there is none.
        """
        name = text.strip()
        zones = [*self.zones] if name == ALL else self.zones.find(name)
        if not zones and name != ALL:
            raise ZonesError(
                f'no zone has the id or name {short_repr(name)}; there is {named(self.zones)}'
            )
        return self.remove(zones)

    def remove(self, zones: Iterable[Zone]) -> str:
        """Remove zones; return what was done."""
        gone = list({zone.id: zone for zone in zones}.values())
        if gone:
            self.use(self.zones.remove(gone))
        return f'removed {named(gone)}; {len(self.zones)} left'

    def expire(self) -> None:
        """Remove the zones whose time is over."""
        gone = self.zones.expired(time.monotonic())
        if gone:
            self._node.get_logger().info(f'zones expired: {self.remove(gone)}')
        else:
            self.await_expiry()

    def await_expiry(self) -> None:
        """Have `expire` called when the next zone expires."""
        self._expiry.close()
        seconds = self.zones.next_expiry - time.monotonic()
        if math.isfinite(seconds):
            self._expiry.timer(max(seconds, LEAST_SECONDS), self.expire, self._group)

    def show(self) -> None:
        """Publish the zones soon: once for many changes at a time."""
        if not self._is_due:
            self._is_due = True
            self._publication.timer(PUBLICATION_SECONDS, self.publish, self._group)

    def publish(self) -> None:
        """Publish the zones."""
        self._publication.close()
        self._is_due = False
        frame_id = DEFAULT_FRAME if self._grid_map is None else self._grid_map.frame_id
        stamp = self._node.get_clock().now().to_msg()
        drawn = [
            (zone.label, zone.area, zone.cost == KEEPOUT, zone.arrows()) for zone in self.zones
        ]
        self._markers.publish(zones_to_markers(drawn, frame_id, stamp))
        collection = zones_to_geojson(self.zones, time.monotonic(), frame_id)
        self._geojson.publish(String(data=json.dumps(collection)))

    def answering(self, change: Callable[[str], str]) -> Callable[[Any, Any], Any]:
        """Return a service's callback that answers with what `change` does of the text."""

        def answer(
            request: AddDiagnostics.Request, response: AddDiagnostics.Response
        ) -> AddDiagnostics.Response:
            logger = self._node.get_logger()
            try:
                response.message = change(request.load_namespace)
                response.success = True
                logger.info(f'zones: {response.message}', throttle_duration_sec=QUIET_SECONDS)
            except LlmAstarError as error:
                response.message = str(error)
                logger.error(f'refused: {error}', throttle_duration_sec=QUIET_SECONDS)
            except Exception as error:  # noqa: BLE001 - no request may end the thread
                response.message = f'{type(error).__name__}: {error}'
                logger.error(traceback.format_exc())
            return response

        return answer


def named(zones: Iterable[Zone]) -> str:
    """Return the zones for a person, the first MOST_NAMED of them by name."""
    labels = [zone.label for zone in zones]
    more = f' and {len(labels) - MOST_NAMED} more' if len(labels) > MOST_NAMED else ''
    return (', '.join(labels[:MOST_NAMED]) or 'none') + more


@dataclass(eq=False)
class MaskSubscription:
    """Subscribes to the topic of CostmapFilterInfo, and to the masks that its messages name.

    One mask of keepout areas and one of speed limits are used at a time: a new info replaces the
    one of its sort, as in Nav2, and the last mask stays until the new one comes. Malformed
    messages are logged and dropped.
    """

    side: Node
    parent: Node
    topic: str
    on_masks: Callable[[tuple[layers.FilterMask, ...]], None]

    def __post_init__(self) -> None:
        """Subscribe on the node `side`, if nav2_msgs is installed and a topic is given.

        `parent` remaps the names and logs; `on_masks` gets all masks when one has changed.
        Raises ParameterError for a topic that cannot be one.
        """
        self._group = MutuallyExclusiveCallbackGroup()
        # By sort: keepout areas (True) or speed limits (False).
        self._infos: dict[bool, layers.FilterInfo] = {}
        self._subscriptions: dict[bool, Entities] = {}
        self._masks: dict[bool, layers.FilterMask] = {}
        if CostmapFilterInfo is not None and self.topic:
            with raising(ParameterError, 'filter_info_topic: ', InvalidTopicNameException):
                name = self.parent.resolve_topic_name(self.topic)
            entities = Entities(self.side)
            entities.subscription(
                CostmapFilterInfo, name, self.on_info, LATCHED_BY_MANY, self._group
            )

    def on_info(self, message: Any) -> None:  # noqa: ANN401 - nav2_msgs may not be there
        """Subscribe to the mask that an info names."""
        topic = message.filter_mask_topic
        try:
            info = layers.filter_info(message.type, topic, message.base, message.multiplier)
            self.subscribe(info)
        except Exception as error:  # noqa: BLE001 - no message may end the thread of the maps
            self.log('costmap filter info', error)

    def subscribe(self, info: layers.FilterInfo) -> None:
        """Subscribe to the mask of an info. Raises what rclpy does for a wrong topic."""
        is_keepout = info.kind is layers.FilterKind.KEEPOUT
        if self._infos.get(is_keepout) == info:
            return
        entities = Entities(self.side)
        name = self.parent.resolve_topic_name(info.topic)
        entities.subscription(
            OccupancyGrid, name, partial(self.on_mask, info), LATCHED, self._group
        )
        before = self._subscriptions.pop(is_keepout, None)
        if before is not None:
            before.close()
        self._infos[is_keepout], self._subscriptions[is_keepout] = info, entities

    def on_mask(self, info: layers.FilterInfo, message: OccupancyGrid) -> None:
        """Use a mask from now on."""
        is_keepout = info.kind is layers.FilterKind.KEEPOUT
        if self._infos.get(is_keepout) != info:
            return
        try:
            masks = self._masks | {is_keepout: layers.FilterMask(info, grid_from_message(message))}
            self.on_masks(tuple(masks.values()))
        except Exception as error:  # noqa: BLE001 - no message may end the thread of the maps
            self.log(f'filter mask {info.topic}', error)
        else:
            self._masks = masks

    def log(self, what: str, error: Exception) -> None:
        """Log that something was refused."""
        name = '' if isinstance(error, LlmAstarError) else f'{type(error).__name__}: '
        self.parent.get_logger().error(f'{what} refused, the last one stays: {name}{error}')
