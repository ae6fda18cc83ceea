"""Draws named places: their outlines, and their names where they can be read."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

AREA, OBJECT = '#5b7f95', '#8c6d46'
FREE_COLOUR, UNKNOWN_COLOUR, OBSTACLE_COLOUR = (1.0, 1.0, 1.0), (0.91, 0.89, 0.85), (0.3, 0.3, 0.3)
# Metres around places that are drawn without a map.
MARGIN = 1.0
TINT = 0.08
# Sizes of a name in points, tried in this order, and shifts in its own sizes.
SIZES = (9.0, 7.5, 6.0)
SHIFTS = ((0, 0), (0, 1), (0, -1), (0, 2), (0, -2), (0.6, 0), (-0.6, 0))
HALO = [withStroke(linewidth=2.5, foreground='white')]

# Left, bottom, right, top in pixels.
Box = tuple[float, float, float, float]
# From metres in the map's frame, points [n, 2], to the coordinates of the axes.
Projection = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def draw_places(axes: Axes, places: Places, project: Projection) -> None:
    """Draw the outline of each place."""
    for place in places:
        draw_outline(axes, place, shapely.transform(place.geometry, project))


def write_names(
    axes: Axes, places: Places, project: Projection, taken: Iterable[tuple[float, float]] = ()
) -> None:
    """Write the names of places, clear of each other and of the points `taken`.

    Call it last: the axes must have their final limits and size.
    """
    shapes = [shapely.transform(place.geometry, project) for place in places]
    labels = NameLabels(axes, taken)
    # The names of large places have more room to give way.
    for number in np.argsort([shape.area for shape in shapes], kind='stable'):
        labels.add(places.places[number].name, shapes[number])


def draw_outline(axes: Axes, place: Place, shape: BaseGeometry) -> None:
    """Draw the outline of a place, or a point."""
    colour = OBJECT if place.is_object else AREA
    if shape.geom_type == 'Point':
        axes.plot(shape.x, shape.y, 'P', color=colour, markersize=7, zorder=3)
        return
    draw_region(axes, shape, edgecolor=colour, facecolor=(colour, TINT), linewidth=1.2, zorder=2.5)


def draw_region(axes: Axes, shape: BaseGeometry, **style: object) -> None:
    """Draw a polygon, or several, in the coordinates of the axes; holes stay empty."""
    rings = [
        shapely.get_coordinates(ring)
        for part in shapely.get_parts(shape)
        if part.geom_type == 'Polygon' and not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]
    if rings:
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, **style))


class NameLabels:
    """Writes names at places so that none hides another."""

    def __init__(self, axes: Axes, taken: Iterable[tuple[float, float]] = ()) -> None:
        """Take the axes and the points that no name may hide."""
        self.axes = axes
        # The layout moves the axes when the figure is drawn.
        root = axes.get_figure(root=True)
        if root is not None:
            root.draw_without_rendering()
        points = axes.transData.transform(np.array([*taken], dtype=float).reshape(-1, 2))
        self.boxes: list[Box] = [(x - 8, y - 8, x + 8, y + 8) for x, y in points.tolist()]
        self.frame = axes.get_window_extent()

    def add(self, name: str, shape: BaseGeometry) -> None:
        """Write a name in the middle of its place, upright where the place is too narrow.

        It is written smaller, or moved, where it would hide another name.
        """
        middle = shape.centroid if shape.contains(shape.centroid) else shape.representative_point()
        text = self.axes.text(
            middle.x, middle.y, name, ha='center', va='center', color='black', zorder=6,
            path_effects=HALO, clip_on=True, parse_math=False,
        )  # fmt: skip
        # The name of a point stands above its mark.
        shifts = (*SHIFTS[1:], SHIFTS[0]) if shape.geom_type == 'Point' else SHIFTS
        for size in SIZES:
            text.set_fontsize(size)
            text.set_rotation(self.rotation(text, shape))
            extent = text.get_window_extent()
            box = (extent.x0, extent.y0, extent.x1, extent.y1)
            free = [moved for shift in shifts if self.is_free(moved := shifted(box, shift))]
            if free:
                break
        chosen = free[0] if free else shifted(box, shifts[0])
        corners = np.reshape(chosen, (2, 2))
        x, y = self.axes.transData.inverted().transform(corners).mean(axis=0)
        text.set_position((x, y))
        self.boxes.append(chosen)

    def is_free(self, box: Box) -> bool:
        """Tell whether a name in a box is within the picture and hides no other."""
        x0, y0, x1, y1 = box
        inside = self.frame.x0 <= x0 and x1 <= self.frame.x1
        return inside and not any(
            x0 < right and left < x1 and y0 < top and bottom < y1
            for left, bottom, right, top in self.boxes
        )

    def rotation(self, text: Text, shape: BaseGeometry) -> float:
        """Return 90 degrees for a name that fits into its place only upright, else 0."""
        text.set_rotation(0.0)
        box = text.get_window_extent()
        corners = np.reshape(shape.bounds, (2, 2))
        width, height = np.ptp(self.axes.transData.transform(corners), axis=0)
        return 90.0 if box.width > width and height > 1.2 * max(width, box.height) else 0.0


def shifted(box: Box, shift: tuple[float, float]) -> Box:
    """Return a box moved by parts of its own size."""
    x0, y0, x1, y1 = box
    dx, dy = shift[0] * (x1 - x0), shift[1] * (y1 - y0)
    return x0 + dx, y0 + dy, x1 + dx, y1 + dy


def places_figure(places: Places, grid_map: GridMap | None = None) -> Figure:
    """Return a figure of places, axes in metres, on their map where it is given."""
    shapes = [place.geometry.buffer(MARGIN) for place in places]
    x0, y0, x1, y1 = shapely.union_all(shapes).bounds if shapes else (0.0, 0.0, 1.0, 1.0)
    if grid_map is not None:
        outline = shapely.MultiPoint(grid_map.grid_to_world(corners_of(grid_map)))
        x0, y0, x1, y1 = outline.bounds
    aspect = (x1 - x0) / (y1 - y0)
    figure = Figure(figsize=(min(14.0, max(6.0, 6.5 * aspect)), 6.5), layout='constrained')
    axes = figure.add_subplot(aspect='equal', xlabel='x (m)', ylabel='y (m)')
    if grid_map is not None:
        draw_map(axes, grid_map)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    draw_places(axes, places, lambda points: points)
    write_names(axes, places, lambda points: points)
    return figure


def corners_of(grid_map: GridMap) -> NDArray[np.float64]:
    """Return the corners of a map [4, 2] in grid coordinates."""
    x, y = grid_map.width - 0.5, grid_map.height - 0.5
    return np.array([[-0.5, -0.5], [x, -0.5], [x, y], [-0.5, y]])


def draw_map(axes: Axes, grid_map: GridMap) -> None:
    """Draw a map in metres, turned as its origin is."""
    image = np.full((*grid_map.cells.shape, 3), FREE_COLOUR)
    image[grid_map.cells < 0] = UNKNOWN_COLOUR
    image[grid_map.blocked()] = OBSTACLE_COLOUR
    size, origin = grid_map.resolution, grid_map.origin
    turn = Affine2D().scale(size).rotate(origin.yaw).translate(origin.x, origin.y)
    axes.imshow(
        image,
        origin='lower',
        interpolation='nearest',
        extent=(0, grid_map.width, 0, grid_map.height),
        transform=turn + axes.transData,
    )
