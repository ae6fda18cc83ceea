"""Draws named places: their outlines, and their names where they can be read."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.pictures import raster, style
from llm_astar_lab.pictures.labels import Labels

# Metres around places that are drawn without a map.
MARGIN = 1.0
# Inches of their figure, at most.
WIDTH, MAX_HEIGHT = 8.0, 8.0
TINT = 0.08
# From metres in the map's frame, points [n, 2], to the coordinates of the axes.
Projection = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def draw_places(axes: Axes, places: Places, project: Projection) -> None:
    """Draw the outline of each place."""
    for place in places:
        draw_outline(axes, place, shapely.transform(place.geometry, project))


def write_names(labels: Labels, places: Places, project: Projection) -> None:
    """Write the names of places, clear of each other and of what is taken."""
    shapes = [shapely.transform(place.geometry, project) for place in places]
    # The names of large places have more room to give way.
    for number in np.argsort([shape.area for shape in shapes], kind='stable'):
        labels.add_name(places.places[number].name, shapes[number])


def draw_outline(axes: Axes, place: Place, shape: BaseGeometry) -> None:
    """Draw the outline of a place, or a point."""
    colour = style.OBJECT if place.is_object else style.AREA
    if shape.geom_type == 'Point':
        axes.plot(shape.x, shape.y, 'P', color=colour, markersize=7, zorder=3)
        return
    draw_region(axes, shape, edgecolor=colour, facecolor=(colour, TINT), linewidth=1.2, zorder=2.5)


def draw_region(axes: Axes, shape: BaseGeometry, **look: object) -> None:
    """Draw a polygon, or several, in the coordinates of the axes; holes stay empty."""
    rings = [
        shapely.get_coordinates(ring)
        for part in shapely.get_parts(shape)
        if part.geom_type == 'Polygon' and not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]
    if rings:
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, **look))


def places_figure(places: Places, grid_map: GridMap | None = None) -> Figure:
    """Return a figure of places, axes in metres, on their map where it is given."""
    shapes = [place.geometry.buffer(MARGIN) for place in places]
    x0, y0, x1, y1 = shapely.union_all(shapes).bounds if shapes else (0.0, 0.0, 1.0, 1.0)
    if grid_map is not None:
        outline = shapely.MultiPoint(grid_map.grid_to_world(corners_of(grid_map)))
        x0, y0, x1, y1 = outline.bounds
    aspect = (x1 - x0) / (y1 - y0)
    width = min(WIDTH, MAX_HEIGHT * aspect)
    size = max(WIDTH / 2, width), max(WIDTH / 2, width / aspect) + 0.5
    figure = Figure(figsize=size, layout='constrained')
    axes = figure.add_subplot(aspect='equal', xlabel='x (m)', ylabel='y (m)')
    if grid_map is not None:
        draw_map(axes, grid_map)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    draw_places(axes, places, lambda points: points)
    write_names(Labels(axes), places, lambda points: points)
    return figure


def corners_of(grid_map: GridMap) -> NDArray[np.float64]:
    """Return the corners of a map [4, 2] in grid coordinates."""
    x, y = grid_map.width - 0.5, grid_map.height - 0.5
    return np.array([[-0.5, -0.5], [x, -0.5], [x, y], [-0.5, y]])


def draw_map(axes: Axes, grid_map: GridMap) -> None:
    """Draw a map in metres, turned as its origin is."""
    image = raster.PALETTE[raster.cell_codes(grid_map, np.zeros((0, 0), dtype=np.bool_))]
    size, origin = grid_map.resolution, grid_map.origin
    turn = Affine2D().scale(size).rotate(origin.yaw).translate(origin.x, origin.y)
    axes.imshow(
        image,
        origin='lower',
        interpolation='nearest',
        extent=(0, grid_map.width, 0, grid_map.height),
        transform=turn + axes.transData,
    )
