# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What the page gets, as JSON values."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
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
from llm_astar_planner.planning.types import Why, clause_price, finite_or_none
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
        'version': __version__,
        'live': live,
        'colours': page_colours(),
        'methods': [{'name': name, 'about': ABOUT['methods'][name]} for name in METHODS],
        'sources': [{'name': name, 'about': ABOUT['sources'][name]} for name in SOURCES],
        'heuristics': list(HEURISTIC_NAMES),
        'limits': {'cells': MAX_CELLS, 'text': MAX_REPLY, 'radius_m': radius},
        'maps': [map_summary(play_map) for play_map in maps],
    }


def map_summary(play_map: PlayMap) -> dict[str, Any]:
    """Return a map without its cells."""
    kind = 'grid' if play_map.barriers is None else 'barriers'
    counts = {'pairs': len(play_map.pairs()), 'places': bool(len(play_map.places))}
    return named_json(play_map) | {'kind': kind} | size_json(play_map.grid_map) | counts


def size_json(grid_map: GridMap) -> dict[str, Any]:
    """Return the size of a grid in cells, and that of a cell in metres."""
    return {name: getattr(grid_map, name) for name in ('width', 'height', 'resolution')}


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
    return size_json(grid_map) | {
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
        'lethal': encoded(np.packbits(costmap.blocked & ~obstacles)),
        'answer': answer,
        'rules': [rule_json(zone, planner.grid_map) for zone in request.zones if zone.rule],
        'command': command,
        'command_note': EDITED if command is None else '',
    }


def plan_json(played: PlayedPlan, planner: Planner, places: Places) -> dict[str, Any]:
    """Return one plan."""
    plan, grid_map = played.plan, planner.grid_map
    instructed = instructed_path(plan, Route(planner.costmap, plan.start, plan.goal, places))
    order = np.flatnonzero(plan.expanded) if played.order is None else played.order
    waypoints = [(point.x, point.y, point.status.value) for point in plan.checked_waypoints]
    lengths = plan.length, plan.length * grid_map.resolution
    return report_json(plan.to_dict(), waypoints, *map(finite_or_none, lengths)) | {
        'role': played.role,
        'title': played.title,
        'start': list(plan.start),
        'goal': list(plan.goal),
        'path': plan.path.tolist(),
        'any_angle': None if plan.any_angle is None else plan.any_angle.points.tolist(),
        'via': [list(cell) for cell in plan.via],
        'causes': causes_json(plan.why, grid_map),
        'ways': [way.to_json() | {'path': way.path.tolist()} for way in plan.alternatives],
        'regions': None if instructed is None else regions_json(instructed, grid_map),
        'expanded': {'order': encoded(order[:MAX_ORDER].astype('<i4'))},
        'order_is_known': played.order is not None,
    }


def causes_json(why: Why | None, grid_map: GridMap) -> list[dict[str, Any]]:
    """Return where what closes the way lies, by name, in cells."""
    places = () if why is None else why.places()
    return [{'name': name, 'points': cells_of(points, grid_map)} for name, points in places]


def rule_json(zone: Zone, grid_map: GridMap) -> dict[str, Any]:
    """Return in cells where a rule of the road holds, and from where to where it leads."""
    return {
        'kind': zone.kind,
        'name': zone.name,
        'width': zone.width / grid_map.resolution,
        'rings': rings_of(zone.area, grid_map),
        'arrows': [cells_of(arrow, grid_map) for arrow in zone.arrows()],
    }


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


def report_json(
    report: Mapping[str, Any],
    waypoints: Iterable[tuple[float, float, str]],
    length: float | None,
    length_m: float | None,
) -> dict[str, Any]:
    """Return what the page shows of a report, whose names are those of `Plan.to_dict`.

    `waypoints` are in cells, the lengths in cells and metres; times become milliseconds.
    """
    return {
        'found': report['code'] == 0,
        'code': report['code_name'],
        'message': report['message'],
        'warnings': list(report['warnings']),
        'waypoints': [
            {'number': number, 'x': x, 'y': y, 'status': status}
            for number, (x, y, status) in enumerate(waypoints, start=1)
        ],
        'figures': {
            'expansions': report['operation'],
            'length': length,
            'length_m': length_m,
            'bound': report['ratio'],
            'search_ms': 1000.0 * report['seconds_search'],
            'source_ms': 1000.0 * report['seconds_source'],
            'turns': report['turns'],
            'clearance_m': report['clearance'],
        },
        'instruction': instruction_json(report['instruction_report']),
    }


def instruction_json(outcome: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return what became of an instruction, clause by clause."""
    if outcome is None:
        return None
    read = outcome.get('interpretation', {})
    verdict = str(outcome.get('sentence', ''))
    notes = str(outcome.get('note', '')), str(read.get('detail', ''))
    return {
        'verdict': verdict,
        'satisfied': outcome.get('satisfied') is True,
        **{name: str(read.get(name, '')) for name in ('sentence', 'status')},
        'questions': [*map(str, read.get('questions', ()))],
        'clauses': [clause_json(clause) for clause in outcome.get('clauses', [])],
        'note': '; '.join(note for note in notes if note not in verdict),
    }


def clause_json(clause: Mapping[str, Any]) -> dict[str, str]:
    """Return what became of a clause."""
    detail = f'{clause["detail"]}{clause_price(clause)}'.removeprefix(', ')
    return {'clause': str(clause['clause']), 'status': str(clause['status']), 'detail': detail}


def encoded(array: NDArray[Any]) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode('ascii')
