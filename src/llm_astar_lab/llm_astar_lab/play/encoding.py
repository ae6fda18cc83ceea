# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What the page gets, as JSON values."""

import base64
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Why, finite_or_none
from llm_astar_planner.search.methods import HEURISTIC_NAMES, METHODS
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.pictures.instructed import InstructedPath, instructed_path
from llm_astar_lab.pictures.style import page_colours
from llm_astar_lab.play.maps import MAX_CELLS, Maps, PlayError, PlayMap
from llm_astar_lab.play.planning import PlayedPlan
from llm_astar_lab.play.request import MAX_REPLY, PARAMETERS, SOURCES, PlayRequest, command_of
from llm_astar_planner import __version__

# Cells of an expansion order that are sent, at most.
MAX_ORDER = 1_000_000
EDITED = 'the map is edited (walls, costs, places or zones), and a command plans on its file'
ABOUT = read_yaml(Path(__file__).with_name('choices.yaml'), PlayError)


def options_json(maps: Maps, *, live: bool) -> dict[str, Any]:
    """Return what the page offers to choose from."""
    _, radius = PARAMETERS['robot_radius'].between or (0.0, 0.0)
    return {
        'version': __version__, 'live': live, 'colours': page_colours(),
        'methods': [{'name': name, 'about': ABOUT['methods'][name]} for name in METHODS],
        'sources': [{'name': name, 'about': ABOUT['sources'][name]} for name in SOURCES],
        'heuristics': list(HEURISTIC_NAMES),
        'limits': {'cells': MAX_CELLS, 'text': MAX_REPLY, 'radius_m': radius},
        'maps': [named_json(play_map) for play_map in maps],
    }  # fmt: skip


def named_json(play_map: PlayMap) -> dict[str, Any]:
    """Return a map's names and its unit."""
    unit = 'm' if play_map.is_metric else 'cells'
    return {'id': play_map.id, 'name': play_map.name, 'unit': unit}


def map_json(play_map: PlayMap) -> dict[str, Any]:
    """Return a map with its cells, pairs and places."""
    pairs = [{'start': list(start), 'goal': list(goal)} for start, goal in play_map.pairs()]
    shown = grid_json(play_map.grid_map, play_map.places) | named_json(play_map)
    return shown | {'offset': list(play_map.problem.offset), 'pairs': pairs}


def grid_json(grid_map: GridMap, places: Places) -> dict[str, Any]:
    """Return a grid with places; cells are 0 to 100 or 255 for unknown, row by row from y = 0."""
    size = {name: getattr(grid_map, name) for name in ('width', 'height', 'resolution')}
    return size | {
        'origin': list(grid_map.origin),
        'cells': encoded(grid_map.cells.astype(np.uint8)),
        'places': [place_json(place, grid_map) for place in places],
        'geojson': places.to_geojson(),
    }


def place_json(place: Place, grid_map: GridMap) -> dict[str, Any]:
    """Return a place with its outline, or its point, in cells."""
    geometry = place.geometry
    outline = geometry.exterior if geometry.geom_type == 'Polygon' else geometry
    return {'name': place.name, 'polygon': cells_of(shapely.get_coordinates(outline), grid_map)}


def reply_json(
    request: PlayRequest, planner: Planner, plans: list[PlayedPlan], answer: dict[str, Any] | None
) -> dict[str, Any]:
    """Return the answer to a request for a plan, and to its question where it has one."""
    costmap, command = planner.costmap, command_of(request)
    obstacles = planner.grid_map.blocked(
        costmap.config.occupied_threshold, allow_unknown=costmap.config.allow_unknown
    )
    return {
        'plans': [plan_json(played, planner, request.places) for played in plans],
        'lethal': encoded(np.packbits(costmap.blocked & ~obstacles)), 'answer': answer,
        'rules': rules_json((zone for zone in request.zones if zone.rule), planner.grid_map),
        'command': command, 'command_note': EDITED if command is None else '',
    }  # fmt: skip


def plan_json(played: PlayedPlan, planner: Planner, places: Places) -> dict[str, Any]:
    """Return one plan: what `Plan.to_dict` has, and all that is drawn, in cells."""
    plan, grid_map = played.plan, planner.grid_map
    instructed = instructed_path(plan, Route(planner.costmap, plan.start, plan.goal, places))
    order = np.flatnonzero(plan.expanded) if played.order is None else played.order
    return plan.to_dict() | {
        'found': plan.code == 0, 'role': played.role, 'title': played.title,
        'start': list(plan.start), 'goal': list(plan.goal), 'path': plan.path.tolist(),
        'length_m': finite_or_none(plan.length * grid_map.resolution),
        'waypoints': [(point.x, point.y, point.status.value) for point in plan.checked_waypoints],
        'any_angle': None if plan.any_angle is None else plan.any_angle.points.tolist(),
        'via': [list(cell) for cell in plan.via], 'causes': causes_json(plan.why, grid_map),
        'ways': [way.to_json() | {'path': way.path.tolist()} for way in plan.alternatives],
        'regions': None if instructed is None else regions_json(instructed, grid_map),
        'expanded': {'order': encoded(order[:MAX_ORDER].astype('<i4'))},
        'order_is_known': played.order is not None,
    }  # fmt: skip


def causes_json(why: Why | None, grid_map: GridMap) -> list[dict[str, Any]]:
    """Return where what closes the way lies, by name, in cells."""
    places = () if why is None else why.places()
    return [{'name': name, 'points': cells_of(points, grid_map)} for name, points in places]


def rules_json(zones: Iterable[Zone], grid_map: GridMap) -> list[dict[str, Any]]:
    """Return in cells where zones lie, and from where to where their rules of the road lead."""
    return [{
        'kind': zone.kind, 'name': zone.name, 'cost': zone.cost,
        'width': zone.width / grid_map.resolution, 'rings': rings_of(zone.area, grid_map),
        'arrows': [cells_of(arrow, grid_map) for arrow in zone.arrows()],
    } for zone in zones]  # fmt: skip


def rings_of(shape: BaseGeometry, grid_map: GridMap) -> list[list[list[float]]]:
    """Return the outlines of polygons in metres in cells."""
    return [cells_of(line.coords, grid_map) for line in shapely.get_parts(shape.boundary)]


def regions_json(path: InstructedPath, grid_map: GridMap) -> dict[str, Any]:
    """Return in cells what an instruction is about: areas, parts that violate it, and visits.

    Areas around all walls are left out: they are most of a map.
    """
    areas, parts = [], []
    for outcome in path.outcome.clauses:
        for area in path.shown_areas(outcome.clause) if outcome.clause.regions else ():
            shape = area.outline & path.measurement.regions.map_outline
            look = {'is_avoided': outcome.clause.is_closed, 'status': outcome.status.name}
            areas.append(look | {'rings': rings_of(shape, grid_map)})
        parts += [cells_of(part, grid_map) for part in path.violating_parts(outcome)]
    visits = [*path.visited_points()]
    return {'areas': areas, 'violations': parts, 'visits': cells_of(visits, grid_map)}


def cells_of(points: ArrayLike, grid_map: GridMap) -> list[list[float]]:
    """Return points in metres in cells."""
    cells: list[list[float]] = grid_map.world_to_grid(points).round(2).tolist()
    return cells


def encoded(array: NDArray[Any]) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode('ascii')
