"""Zones by the services of Nav2's vector object server, where its messages are installed."""

from __future__ import annotations

import math
import traceback
import uuid
from collections.abc import Callable, Iterable
from typing import Any

import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import FAR
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.costmap.zones import MAX_VERTICES, MAX_ZONES, Zone, ZonesError
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.planner.zone_server import ZoneServer

try:
    from nav2_msgs.srv import AddShapes, GetShapes, RemoveShapes
except ImportError:  # only versions after Kilted have them
    AddShapes = GetShapes = RemoveShapes = None

# Half the width, in metres, of the line around a shape that is not filled.
LINE = 1e-3
# Corners to a quarter of a circle.
QUARTER = 16
LEAST_POINTS = 3


class ShapeServer:
    """Serves `~/add_shapes`, `~/remove_shapes` and `~/get_shapes`.

    A shape is a zone whose id is its uuid and whose cost is its value. Unlike in Nav2, a request
    with a wrong shape adds none of them, and a shape of another frame stays where it is on the
    map when it is added.
    """

    def __init__(self, side: Node, parent: Node, zones: ZoneServer) -> None:
        """Serve on the node `side`; `parent` resolves the names and logs."""
        self._logger = parent.get_logger()
        self._zones = zones
        self._shapes: dict[str, tuple[Zone, Any]] = {}
        if AddShapes is None:
            return
        entities, group = Entities(side), MutuallyExclusiveCallbackGroup()
        for kind, name, callback in (
            (AddShapes, 'add_shapes', self.logged(self.on_add)),
            (RemoveShapes, 'remove_shapes', self.logged(self.on_remove)),
            (GetShapes, 'get_shapes', self.on_get),
        ):
            entities.service(kind, parent.resolve_service_name(f'~/{name}'), callback, group)

    def on_add(self, request: Any) -> None:  # noqa: ANN401 - nav2_msgs may not be there
        """Add shapes, or replace those that have their uuids. Raises LlmAstarError."""
        count = len(request.polygons) + len(request.circles)
        if count > MAX_ZONES:
            raise ZonesError(f'{count} shapes are over {MAX_ZONES}; remove some')
        shapes = [
            *zones_of(request.polygons, polygon_of, 'polygon'),
            *zones_of(request.circles, circle_of, 'circle'),
        ]
        placed = [
            (self._zones.placed(zone, shape.header.frame_id), shape) for zone, shape in shapes
        ]
        self._logger.info(f'shapes: {self._zones.add(tuple(zone for zone, _ in placed))}')
        known = {zone.id: (zone, shape) for zone, shape in (*self._shapes.values(), *placed)}
        self._shapes = {id_: pair for id_, pair in known.items() if self.is_there(pair[0])}

    def on_remove(self, request: Any) -> None:  # noqa: ANN401 - nav2_msgs may not be there
        """Remove shapes. Raises ZonesError if one is not there; the others are removed then."""
        if request.all_objects:
            self._zones.remove(zone for zone, _ in self._shapes.values() if self.is_there(zone))
            return
        ids = [id_of(shape_id) for shape_id in request.uuids]
        found = [zone for id_ in ids for zone in self._zones.zones.find(id_)]
        self._zones.remove(found)
        unknown = set(ids) - {zone.id for zone in found}
        if unknown:
            raise ZonesError(f'uuids: there is no shape {min(unknown)}')

    def on_get(self, _: Any, response: Any) -> Any:  # noqa: ANN401 - nav2_msgs may not be there
        """Answer with the shapes that were added and are still there."""
        shapes = [shape for zone, shape in self._shapes.values() if self.is_there(zone)]
        response.polygons = [shape for shape in shapes if hasattr(shape, 'points')]
        response.circles = [shape for shape in shapes if hasattr(shape, 'radius')]
        return response

    def is_there(self, zone: Zone) -> bool:
        """Tell whether a zone was neither removed nor replaced."""
        return self._zones.zones.find(zone.id)[:1] == (zone,)

    def logged(self, change: Callable[[Any], None]) -> Callable[[Any, Any], Any]:
        """Return a service's callback that answers whether `change` went well."""

        def answer(request: Any, response: Any) -> Any:  # noqa: ANN401 - nav2_msgs' own
            response.success = False
            try:
                change(request)
                response.success = True
            except LlmAstarError as error:
                self._logger.error(f'shapes refused: {error}')
            except Exception:  # noqa: BLE001 - no request may end the thread
                self._logger.error(traceback.format_exc())
            return response

        return answer


def zones_of(
    shapes: Iterable[Any], geometry_of: Callable[[Any], BaseGeometry], what: str
) -> list[tuple[Zone, Any]]:
    """Return the zone of each shape. Raises ZonesError, which says which shape is wrong.

    A shape without a uuid gets one.
    """
    found = []
    for number, shape in enumerate(shapes):
        try:
            if not any(shape.uuid.uuid):
                shape.uuid.uuid = list(uuid.uuid4().bytes)
            zone = Zone(id_of(shape.uuid), geometry_of(shape), int(shape.value))
        except ZonesError as error:
            raise ZonesError(f'{what} {number}: {error}') from None
        found.append((zone, shape))
    return found


def id_of(message: Any) -> str:  # noqa: ANN401 - a unique_identifier_msgs/UUID
    """Return a UUID in the usual form."""
    return str(uuid.UUID(bytes=bytes(bytearray(message.uuid))))


def polygon_of(shape: Any) -> BaseGeometry:  # noqa: ANN401 - a nav2_msgs/PolygonObject
    """Return the area of a polygon, or a thin strip if it is not closed. Raises ZonesError."""
    points = [(float(point.x), float(point.y)) for point in shape.points[: MAX_VERTICES + 1]]
    if not LEAST_POINTS <= len(points) < MAX_VERTICES:
        raise ZonesError(f'points: {len(points)} are not {LEAST_POINTS} to {MAX_VERTICES - 1}')
    if not all(abs(value) <= FAR for point in points for value in point):
        raise ZonesError('points: metres are expected, not NaN or infinity')
    if shape.closed:
        return shapely.Polygon(points)
    return shapely.LineString(points).buffer(LINE, quad_segs=1)


def circle_of(shape: Any) -> BaseGeometry:  # noqa: ANN401 - a nav2_msgs/CircleObject
    """Return a polygon around a circle, or a thin ring if it is not filled. Raises ZonesError."""
    x, y, radius = float(shape.center.x), float(shape.center.y), float(shape.radius)
    if not (abs(x) <= FAR and abs(y) <= FAR and 0.0 < radius <= FAR):
        raise ZonesError(f'center, radius: ({x}, {y}), {radius} are no circle in metres')
    disc = shapely.Point(x, y).buffer(radius / math.cos(math.pi / (4 * QUARTER)), QUARTER)
    return disc if shape.fill else disc.exterior.buffer(LINE, quad_segs=1)
