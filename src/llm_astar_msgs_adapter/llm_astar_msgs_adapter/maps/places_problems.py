"""What is doubtful about places on a map: they overlap, lie off the map or wholly in walls."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places

# Parts of an area below this count as drawn inexactly. Rooms usually share the wall between them.
TOLERATED = 0.05
MAX_PROBLEMS = 20
BLOCK = 10_000


def places_problems(places: Places, grid_map: GridMap) -> list[str]:
    """Return a sentence for each doubtful place, at most MAX_PROBLEMS and a last one.

    None of them is an error: the places can be used as they are.
    """
    problems = []
    if places and places.frame_id != grid_map.frame_id:
        problems.append(
            f'the places are in frame {places.frame_id!r}, the map is in {grid_map.frame_id!r}'
        )
    outline, free = map_outline(grid_map), ~grid_map.blocked(allow_unknown=False)
    for place in places:
        problem = position_problem(place, grid_map, outline, free)
        if problem is not None:
            problems.append(f'{place.name!r} {problem}')
    problems += overlaps(places)
    if len(problems) > MAX_PROBLEMS:
        problems[MAX_PROBLEMS:] = [f'and {len(problems) - MAX_PROBLEMS} more']
    return problems


def map_outline(grid_map: GridMap) -> BaseGeometry:
    """Return the rectangle of a map, in metres in its frame."""
    right, top = grid_map.width - 0.5, grid_map.height - 0.5
    corners = [[-0.5, -0.5], [right, -0.5], [right, top], [-0.5, top]]
    return shapely.Polygon(grid_map.grid_to_world(corners))


def position_problem(
    place: Place, grid_map: GridMap, outline: BaseGeometry, free: NDArray[np.bool_]
) -> str | None:
    """Say what is doubtful about where a place is, or None."""
    geometry = place.geometry
    if not outline.intersects(geometry):
        return 'lies off the map'
    if geometry.difference(outline).area > TOLERATED * geometry.area:
        return 'lies partly off the map'
    if not place.is_object and not has_free_cell(geometry, grid_map, free):
        return "lies wholly in walls or unknown space; its kind is perhaps 'object'"
    return None


def has_free_cell(geometry: BaseGeometry, grid_map: GridMap, free: NDArray[np.bool_]) -> bool:
    """Tell whether the centre of a free cell, or a place's own middle, lies in a free cell."""
    middle = geometry.representative_point()
    cell = grid_map.world_to_cell(middle.x, middle.y)
    if grid_map.contains(cell) and free[cell[1], cell[0]]:
        return True
    corners = np.rint(grid_map.world_to_grid(shapely.get_coordinates(geometry))).astype(int)
    (x, y), (right, top) = np.maximum(corners.min(axis=0), 0), corners.max(axis=0) + 1
    rows, columns = np.nonzero(free[y:top, x:right])
    shapely.prepare(geometry)
    # In blocks: most places have a free cell among the first.
    for block in range(0, len(rows), BLOCK):
        part = slice(block, block + BLOCK)
        centres = grid_map.grid_to_world(np.stack((columns[part] + x, rows[part] + y), axis=-1))
        if shapely.intersects_xy(geometry, *centres.T).any():
            return True
    return False


def overlaps(places: Places) -> Iterator[str]:
    """Yield a sentence for each two areas of which one covers more than an edge of the other.

    Objects are left out: a table stands in a kitchen, and walls cross each other.
    """
    areas = [place for place in places if not place.is_object]
    if not areas:
        return
    found = [place.geometry for place in areas]
    pairs = shapely.STRtree(found).query(found, predicate='intersects').T
    for first, second in sorted((int(a), int(b)) for a, b in pairs if a < b):
        shared = found[first].intersection(found[second]).area
        if shared > TOLERATED * min(found[first].area, found[second].area):
            yield f'{areas[first].name!r} and {areas[second].name!r} overlap by {shared:.1f} m²'
