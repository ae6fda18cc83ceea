"""Small maps to hold paths against: a free field, rooms with a wall between, and turned ones."""

import math

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import ORIGIN, GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.outcome import ClauseStatus
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.verify import verify

SATISFIED = ClauseStatus.KEPT
VIOLATED = ClauseStatus.NOT_KEPT
IMPOSSIBLE = ClauseStatus.IMPOSSIBLE
NOT_UNDERSTOOD = ClauseStatus.NOT_UNDERSTOOD
AS_FAR = ClauseStatus.AS_FAR_AS_POSSIBLE
UNSURE = ClauseStatus.UNSURE
UNSUPPORTED = ClauseStatus.UNSUPPORTED

PLACES = Places(
    [
        Place('kitchen', shapely.box(4.0, 4.0, 8.0, 8.0), 'room', ('cook room',), ('blue',)),
        Place('lab', shapely.box(12.0, 4.0, 16.0, 8.0), 'room', (), ('blue',)),
        Place('rack', shapely.box(9.0, 12.0, 11.0, 16.0), 'object'),
        Place('dock', shapely.Point(18.0, 18.0), 'point'),
        Place('far hall', shapely.box(100.0, 100.0, 110.0, 110.0)),
    ]
)


def field(resolution=0.5, origin=ORIGIN, size=20.0, walls=(), **config):
    """A costmap of `size` metres square; `walls` are boxes x0, y0, x1, y1 in the grid's frame."""
    cells = np.zeros((round(size / resolution),) * 2, np.int8)
    for box in walls:
        x0, y0, x1, y1 = (round(side / resolution) for side in box)
        cells[y0:y1, x0:x1] = 100
    return Costmap(GridMap(cells, resolution, origin), CostmapConfig(**config))


def route(costmap, points, places=PLACES, driven=()):
    """The route between the ends of a path in metres."""
    start, goal = (costmap.grid_map.world_to_cell(*points[end]) for end in (0, -1))
    return Route(costmap, start, goal, places, np.reshape(np.array(driven, float), (-1, 2)))


def outcomes(points, *clauses, costmap=None, places=PLACES, driven=()):
    """What becomes of clauses on a path."""
    costmap = costmap or field()
    return verify(Specification(clauses), points, route(costmap, points, places, driven))


def outcome(points, clause, **how):
    """What becomes of one clause on a path."""
    return outcomes(points, clause, **how)[0]


def turned(points, yaw, about=(0.0, 0.0)):
    """Points turned about the origin of the map's frame and moved."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(points, float) @ np.array([[cos, sin], [-sin, cos]]) + about
